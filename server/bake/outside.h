#pragma once

#include "server/bake/brick_level.h"

namespace tenon::bake {

class ParallelWork;
class TriangleTree;

/// Determines which samples are outside from unsigned distances, without normals, winding or watertightness.
///
/// A flood fill from the grid's corner passes only where the surface is more than sigma away, so it does not
/// enter through holes of missing triangles narrower than two sigma; narrow gaps are opened afterwards
/// (openNarrowGaps). The reached region is then extended to the surface: a sample is outside when it lies in
/// the empty ball around a reached one (after Xu and Barbic 2014), or when its own empty ball overlaps that
/// of a reached sample beside it, unless rays through `tree` say that it is in a solid (concave corners,
/// D-077). Both sides of a sheet without thickness are outside.
///
/// With `coarse`, `level` has finer voxels and its flood starts from the coarse level's reached samples.
///
/// Threads: one caller; it and adoptFineSigns use several threads inside.
void findOutside(BrickLevel& level, const BrickLevel* coarse, const TriangleTree& tree, ParallelWork& work);

/// Copies the signs of the fine level to the coarse samples in refined bricks: a slot too narrow for coarse
/// voxels is open only in the fine level.
void adoptFineSigns(BrickLevel& coarse, const BrickLevel& fine, ParallelWork& work);

}  // namespace tenon::bake
