#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/bake/exposed_surface.h"
#include "server/structures/filled_space.h"

namespace tenon::bake {

class ParallelWork;
class TriangleTree;

/// Finds empty space that a bake makes solid: closed voids, and slots too narrow for its flood fill. Their
/// walls are not exposed although nothing is in front of them. The space with the largest walls is first.
///
/// `hidden` is the surface that is not exposed, `tree` all of it, `winding` that of WeldedMesh: where it is
/// inconsistent, less is found. Walls less than about four voxels of `coarse` apart are of one space. Less
/// than four squared voxels of walls are none, nor is a gap of a hundredth of a voxel. Boxes are exact to
/// about a voxel.
///
/// Threads: one caller; uses several threads inside.
[[nodiscard]] std::vector<structures::FilledSpace> findFilledSpaces(
    std::span<const ExposedSurface::HiddenPart> hidden, const TriangleTree& tree,
    std::span<const std::int8_t> winding, const BrickLevel& coarse, ParallelWork& work);

}  // namespace tenon::bake
