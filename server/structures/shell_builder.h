#pragma once

#include <span>
#include <vector>

#include "server/structures/feature_shell.h"
#include "server/structures/huge_pages.h"
#include "server/structures/pointshell.h"

namespace tenon::structures {

/// The arrays of a pointshell under construction.
struct ShellStorage {
  HugeVector<ShellPoint> points;
  HugeVector<ShellSphere> leaves;
  HugeVector<ShellSphere> clusters;
  HugeVector<ShellLevel> levels;

  [[nodiscard]] Pointshell::Layout layout() const { return {points, leaves, clusters, levels}; }
};

/// A pointshell that owns the given arrays, which are sound (structure_checks.h).
[[nodiscard]] Pointshell makeShell(ShellStorage storage);

/// The arrays of a feature shell under construction.
struct FeatureStorage {
  ShellStorage points;
  HugeVector<FeatureEdge> edges;  ///< of each point
};

/// A feature shell that owns the given arrays, which are sound (structure_checks.h).
[[nodiscard]] FeatureShell makeFeatureShell(FeatureStorage storage);

/// A sample of the surface, not yet sorted into levels.
struct SurfaceSample {
  Vector3 p_MP = Vector3::Zero();
  Vector3 inward_M = Vector3::UnitZ();  ///< unit normal, into the object
  double area = 0.0;                    ///< [m^2] surface area it represents
};

/// Sorts surface samples into levels of detail and builds the bounding-sphere hierarchy of each (paper §3.1).
///
/// With n + 1 levels, level 0 takes samples at least 2^n `spacing` [m] apart, every next level halves that,
/// and the last takes all that remain: levels 0..k sample the whole object for any k. Samples with opposite
/// normals (two sides of a thin plate) do not exclude each other. Earlier samples are preferred, so callers
/// put corners and edges first. `spacing` is that of the whole set; 0: the square root of the mean area. No
/// samples give an empty shell.
///
/// Threads: pure. Real-time: no.
[[nodiscard]] Pointshell buildShell(std::span<const SurfaceSample> samples, double spacing = 0.0);

/// The arrays of a shell with all samples in one level, which a query never skips; `spacing` [m] is stored.
/// Sample `order[i]` becomes point i.
[[nodiscard]] ShellStorage buildFlatShell(std::span<const SurfaceSample> samples, double spacing,
                                          std::vector<std::uint32_t>& order);

}  // namespace tenon::structures
