#pragma once

#include <memory>
#include <vector>

#include "server/structures/field_builder.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/shell_builder.h"

namespace tenon::test {

/// Shapes with a formula as haptic structures: what a test knows the right answer for.
using StructuresPtr = std::shared_ptr<const HapticStructures>;

/// Any shape; without sites it can only be asked as a field.
[[nodiscard]] StructuresPtr analyticStructures(const AnalyticDistance& distance,
                                               const Eigen::AlignedBox3d& box_M, double voxel,
                                               std::span<const ShellSite> sites = {}, double spacing = 0.0);

// distances of shapes about M's origin
[[nodiscard]] AnalyticDistance sphereDistance(double radius);
[[nodiscard]] AnalyticDistance boxDistance(const Vector3& size);
[[nodiscard]] AnalyticDistance movedDistance(AnalyticDistance distance, const Pose& X_MS);
/// Exact outside; inside it is a bound, exact near a face that no other part covers.
[[nodiscard]] AnalyticDistance unionDistance(AnalyticDistance a, AnalyticDistance b);
/// Unsigned: a sheet without a thickness has no inside.
[[nodiscard]] AnalyticDistance sheetDistance(double edge);

// skins, evenly sampled; areas sum to the surface's
[[nodiscard]] std::vector<ShellSite> sphereSites(double radius, double spacing);
/// With its corners and edges, which come first.
[[nodiscard]] std::vector<ShellSite> boxSites(const Vector3& size, double spacing);

[[nodiscard]] StructuresPtr sphereStructures(double radius, double voxel, double spacing);
[[nodiscard]] StructuresPtr boxStructures(const Vector3& size, double voxel, double spacing);
/// A slab of `edge` x `edge` x 50 mm whose upper side is z = 0; a field only.
[[nodiscard]] StructuresPtr floorStructures(double edge, double voxel);
/// The floor and walls at x = 0 and y = 0: free is x > 0, y > 0, z > 0. Field only.
[[nodiscard]] StructuresPtr cornerStructures(double edge, double voxel);
/// A square sheet across z at z = `offset`; thickness 0 has no inside. Field only.
[[nodiscard]] StructuresPtr sheetStructures(double edge, double thickness, double voxel, double offset = 0.0);
/// A block with a rectangular hole of size `hole` down from z = 0, open above, and `wall` of material round
/// and below it. Its shell is the hole's rim: asked against a peg's field, it keeps the rim out of the peg's
/// sides between the peg's points.
[[nodiscard]] StructuresPtr socketStructures(const Vector3& hole, double wall, double voxel,
                                             double rim_spacing = 0.001);

}  // namespace tenon::test
