#pragma once

#include <memory>
#include <vector>

#include "server/structures/field_builder.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/shell_builder.h"

namespace tenon::test {

/// Haptic structures of shapes with an analytic distance, for which a test knows the exact result.
using StructuresPtr = std::shared_ptr<const structures::HapticStructures>;

/// Structures of any shape. `voxel` [m] of the field, `spacing` [m] of the samples. Without samples there is
/// no pointshell: the structures can only be the SDF side of a pair.
[[nodiscard]] StructuresPtr analyticStructures(const structures::AnalyticDistance& distance,
                                               const Eigen::AlignedBox3d& box_M, double voxel,
                                               std::span<const structures::SurfaceSample> samples = {},
                                               double spacing = 0.0);

// signed distances [m] of shapes centred at the origin of M

/// Sphere of `radius` [m].
[[nodiscard]] structures::AnalyticDistance sphereDistance(double radius);
[[nodiscard]] structures::AnalyticDistance boxDistance(const Vector3& size);
[[nodiscard]] structures::AnalyticDistance movedDistance(structures::AnalyticDistance distance,
                                                         const Pose& X_MS);
/// Exact outside; inside an upper bound, exact near a face that the other shape does not cover.
[[nodiscard]] structures::AnalyticDistance unionDistance(structures::AnalyticDistance a,
                                                         structures::AnalyticDistance b);
/// Square sheet of `edge` [m] without thickness, across z. Unsigned: it has no inside.
[[nodiscard]] structures::AnalyticDistance sheetDistance(double edge);

// evenly sampled surfaces; the areas sum to that of the surface

/// Sphere of `radius` [m], with `spacing` [m] of points.
[[nodiscard]] std::vector<structures::SurfaceSample> sphereSamples(double radius, double spacing);
/// Box with `spacing` [m] of points, including its corners and edges, which come first.
[[nodiscard]] std::vector<structures::SurfaceSample> boxSamples(const Vector3& size, double spacing);

/// Sphere of `radius` [m] with `voxel` [m] and `spacing` [m] of points.
[[nodiscard]] StructuresPtr sphereStructures(double radius, double voxel, double spacing);
/// Box with `voxel` [m] and `spacing` [m] of points.
[[nodiscard]] StructuresPtr boxStructures(const Vector3& size, double voxel, double spacing);
/// A slab of `edge` [m] x `edge` x 50 mm whose upper side is z = 0, with `voxel` [m]. Field only.
[[nodiscard]] StructuresPtr floorStructures(double edge, double voxel);
/// The floor and walls at x = 0 and y = 0, `edge` [m] long, with `voxel` [m]: free space is x > 0, y > 0,
/// z > 0. Field only.
[[nodiscard]] StructuresPtr cornerStructures(double edge, double voxel);
/// A square sheet of `edge` [m] and `thickness` [m] across z, centred at z = `offset` [m], with `voxel` [m].
/// Thickness 0 has no inside. Field only.
[[nodiscard]] StructuresPtr sheetStructures(double edge, double thickness, double voxel, double offset = 0.0);
/// The same with its surface moved outwards by `dilation` [m] everywhere, as the bake does it where walls are
/// thin.
[[nodiscard]] StructuresPtr dilated(const StructuresPtr& structures, double dilation);
[[nodiscard]] structures::DistanceField dilated(const structures::DistanceField& field, double dilation);

/// A block with a rectangular hole of size `hole` down from z = 0, open above, and `wall` [m] of material
/// around and below it, with `voxel` [m]. Its pointshell is the hole's rim, with `rim_spacing` [m] of points:
/// as pointshell side against a peg's field it keeps the rim out of the peg's sides between the peg's points.
[[nodiscard]] StructuresPtr socketStructures(const Vector3& hole, double wall, double voxel,
                                             double rim_spacing = 0.001);

}  // namespace tenon::test
