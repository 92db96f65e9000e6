#include "server/structures/structure_checks.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace tenon::structures {
namespace {

using Entry = DistanceField::Entry;
using Problem = std::optional<std::string>;

/// [m] No mesh has larger coordinates (server/bake refuses more than 100 km, and a field has a margin).
constexpr double kMaxCoordinate = 1e6;
constexpr float kMaxSkew = 100.0F;  // [-] of planes in which pieces of edges end

bool plausible(const Vector3& p) { return p.allFinite() && p.cwiseAbs().maxCoeff() <= kMaxCoordinate; }

/// Follows the index in the order in which it is built, and counts bricks of samples and entries of refined
/// blocks.
class IndexCheck {
 public:
  explicit IndexCheck(const DistanceField::Layout& field)
      : field_(field),
        children_(static_cast<std::size_t>(field.refinement) * static_cast<std::size_t>(field.refinement) *
                  static_cast<std::size_t>(field.refinement)) {}

  Problem problem(std::size_t coarse) {
    next_block_ = coarse;
    for (const Entry entry : field_.index.first(coarse)) {
      if (entry < DistanceField::kRefined ? !isNext(entry) : !blockIsNext(entry))
        return "has an index out of order or out of range";
    }
    if (next_block_ != field_.index.size()) return "has index entries that no brick refers to";
    if (next_brick_ * DistanceField::kBrickSamples != field_.samples.size())
      return "has samples that no brick refers to, or fewer than its bricks need";
    return {};
  }

 private:
  bool isNext(Entry entry) {
    if (entry == DistanceField::kFarOutside || entry == DistanceField::kFarInside) return true;
    return entry >= 0 && static_cast<std::size_t>(entry) == next_brick_++;
  }
  bool blockIsNext(Entry entry) {
    const std::size_t block = next_block_;
    if (field_.refinement < 2 || static_cast<std::size_t>(entry - DistanceField::kRefined) != block ||
        field_.index.size() - block <= children_)
      return false;
    next_block_ += children_ + 1;
    const Entry own = field_.index[block + children_];
    if (own < 0 || !isNext(own)) return false;
    const auto children = field_.index.subspan(block, children_);
    return std::all_of(children.begin(), children.end(), [this](Entry child) { return isNext(child); });
  }

  const DistanceField::Layout& field_;
  const std::size_t children_;
  std::size_t next_block_ = 0;
  std::size_t next_brick_ = 0;
};

/// Whether `spheres` hold the elements `first` to `first` + `count` - 1 of the next finer list in order and
/// without gaps, 1 to `most` each.
bool tile(std::span<const ShellSphere> spheres, std::uint64_t first, std::uint64_t count,
          std::uint32_t most) {
  std::uint64_t next = first;
  for (const ShellSphere& sphere : spheres) {
    if (sphere.first != next || sphere.count == 0 || sphere.count > most) return false;
    next += sphere.count;
  }
  return next == first + count;
}

/// The dilations are of every brick's corners, or there are none.
Problem problemOfDilations(const DistanceField::Layout& field) {
  std::uint64_t corners = 1;
  for (const std::int32_t count : field.bricks) corners *= static_cast<std::uint64_t>(count) + 1;
  if (field.dilations.empty() ? field.dilation != 0.0 || field.slope != 1.0
                              : field.dilations.size() != corners)
    return "does not have one dilation for each corner of a brick";
  // the largest that a bake gives is that of a sheet, 0.87 voxels
  if (!(field.dilation >= 0.0 && field.dilation <= field.voxel) ||
      !(field.slope >= 1.0 && field.slope <= 1.5))
    return "has a largest dilation or a slope out of range";
  const bool sound = std::all_of(field.dilations.begin(), field.dilations.end(), [&field](float dilation) {
    return dilation >= 0.0F && static_cast<double>(dilation) <= field.dilation;
  });
  if (!sound) return "has a dilation out of range";
  return {};
}

/// Each brick and each cell has its planes, in order, or there are none.
Problem problemOfValleys(const DistanceField::Layout& field) {
  const std::size_t bricks = field.samples.size() / DistanceField::kBrickSamples;
  if (field.valley_index.size() != (field.valley_bricks.empty() ? 0 : bricks))
    return "does not have one entry of valleys for each brick";
  std::size_t next_brick = 0;
  for (const std::int32_t number : field.valley_index) {
    if (number == DistanceField::kNoValley) continue;
    if (number < 0 || static_cast<std::size_t>(number) != next_brick++)
      return "has valleys out of order or out of range";
  }
  if (next_brick != field.valley_bricks.size()) return "has valleys that no brick refers to";
  std::size_t next_cell = 0;
  for (const ValleyBrick& brick : field.valley_bricks) {
    if (brick.first != next_cell) return "has valleys out of order or out of range";
    for (const std::uint64_t word : brick.cells) next_cell += static_cast<std::size_t>(std::popcount(word));
  }
  if (next_cell != field.valley_cells.size()) return "has valleys in other cells than planes";
  const bool in_range =
      std::all_of(field.valley_cells.begin(), field.valley_cells.end(), [&field](std::uint32_t planes) {
        return std::size_t{planes / DistanceField::kMaxValleyPlanes} +
                   planes % DistanceField::kMaxValleyPlanes <
               field.valley_planes.size();
      });
  const bool sound =
      std::all_of(field.valley_planes.begin(), field.valley_planes.end(), [](const ValleyPlane& plane) {
        return std::abs(plane.n_M.norm() - 1.0F) < 0.01F &&
               std::abs(static_cast<double>(plane.offset)) <= kMaxCoordinate;
      });
  if (!in_range || !sound) return "has planes of valleys out of range";
  return {};
}

bool contains(const ShellSphere& sphere, std::span<const ShellPoint> points) {
  const Vector3 p_MC = sphere.p_MC.cast<double>();
  if (!plausible(p_MC) || !(sphere.radius >= 0.0F) || !std::isfinite(sphere.radius)) return false;
  const double radius = sphere.radius;
  return std::all_of(points.begin(), points.end(), [&](const ShellPoint& point) {
    return (point.p_MP.cast<double>() - p_MC).squaredNorm() <= radius * radius;
  });
}

Problem problemOfLevels(const Pointshell::Layout& shell) {
  std::uint64_t points = 0;
  std::uint64_t leaves = 0;
  std::uint64_t clusters = 0;
  for (const ShellLevel& level : shell.levels) {
    if (level.first_point != points || level.first_leaf != leaves || level.first_cluster != clusters)
      return "is damaged: its levels do not follow one another";
    points += level.point_count;
    leaves += level.leaf_count;
    clusters += level.cluster_count;
    if (points > shell.points.size() || leaves > shell.leaves.size() || clusters > shell.clusters.size())
      return "is damaged: its levels have an index out of range";
    if (!tile(shell.leaves.subspan(level.first_leaf, level.leaf_count), level.first_point, level.point_count,
              Pointshell::kLeafPoints))
      return "is damaged: the leaves of a level do not hold each of its points once";
    if (!tile(shell.clusters.subspan(level.first_cluster, level.cluster_count), level.first_leaf,
              level.leaf_count, Pointshell::kClusterLeaves))
      return "is damaged: the clusters of a level do not hold each of its leaves once";
    if (!std::isfinite(level.spacing) || level.spacing < 0.0F || !std::isfinite(level.area_scale) ||
        level.area_scale < 0.0F)
      return "is damaged: the spacing or the area of a level is not a number of 0 or more";
  }
  if (points != shell.points.size() || leaves != shell.leaves.size() || clusters != shell.clusters.size())
    return "is damaged: its levels do not hold each point once";
  return {};
}

}  // namespace

Problem problemOf(const DistanceField::Layout& field) {
  if (field.index.empty()) {
    if (field.samples.empty() && field.far.empty() && field.dilations.empty() && field.valley_index.empty() &&
        field.valley_bricks.empty() && field.valley_cells.empty() && field.valley_planes.empty())
      return {};
    return "has samples but no index";
  }
  const auto positive = [](double length) { return length > 0.0 && length <= kMaxCoordinate; };
  if (!positive(field.voxel) || !positive(field.band) || !(field.margin >= 0.0) ||
      !(field.margin <= kMaxCoordinate) || !plausible(field.p_MoFo_M))
    return "has a voxel, a band or a corner that is not a plausible length";
  if (field.refinement < 1 || field.refinement > 64) return "has a refinement out of range";
  std::uint64_t coarse = 1;
  for (const std::int32_t count : field.bricks) {
    if (count < 1 || count > DistanceField::kMaxBricksPerAxis) return "has a number of bricks out of range";
    coarse *= static_cast<std::uint64_t>(count);
    if (coarse > field.index.size()) return "has more bricks than index entries";
  }
  const Vector3 bricks(field.bricks[0], field.bricks[1], field.bricks[2]);
  if (!plausible(field.p_MoFo_M + bricks * (field.voxel * DistanceField::kBrickVoxels)))
    return "reaches further than 1,000 km";
  if (field.far.size() != coarse) return "does not have one bound for each brick";
  // a gather reads two bounds at a time
  if (field.far.size() < 2) return "has fewer than two bricks";
  if (field.samples.size() > std::size_t{DistanceField::kMaxBricks} * DistanceField::kBrickSamples ||
      field.index.size() > DistanceField::kMaxIndexEntries)
    return "has more bricks than queries can address (" + std::to_string(DistanceField::kMaxBricks) +
           " with samples, " + std::to_string(DistanceField::kMaxIndexEntries) + " in all)";
  if (auto problem = problemOfDilations(field)) return problem;
  if (auto problem = IndexCheck(field).problem(coarse)) return problem;
  return problemOfValleys(field);
}

Problem problemOf(const Pointshell::Layout& shell) {
  if (auto problem = problemOfLevels(shell)) return problem;
  const auto sound = [](const ShellPoint& point) {
    return plausible(point.p_MP.cast<double>()) && point.inward_M.allFinite() && std::isfinite(point.area) &&
           point.area >= 0.0F;
  };
  if (!std::all_of(shell.points.begin(), shell.points.end(), sound))
    return "is damaged: a point is not finite, or has a negative area";
  for (const ShellSphere& leaf : shell.leaves) {
    if (!contains(leaf, shell.points.subspan(leaf.first, leaf.count)))
      return "is damaged: a leaf's sphere does not contain its points";
  }
  for (const ShellSphere& cluster : shell.clusters) {
    const ShellSphere& first = shell.leaves[cluster.first];
    const ShellSphere& last = shell.leaves[cluster.first + cluster.count - 1];
    if (!contains(cluster, shell.points.subspan(first.first, last.first + last.count - first.first)))
      return "is damaged: a cluster's sphere does not contain its points";
  }
  return {};
}

Problem problemOf(const Pointshell::Layout& points, std::span<const FeatureEdge> edges) {
  if (auto problem = problemOf(points)) return problem;
  if (edges.size() != points.points.size()) return "is damaged: there is not an edge for each point";
  const auto sound = [](const FeatureEdge& edge) {
    return plausible(edge.half_M.cast<double>()) && edge.into_M[0].norm() < 1.01F &&
           edge.into_M[1].norm() < 1.01F && edge.reach >= 0.0F && edge.reach <= kMaxCoordinate &&
           edge.beyond[0] >= 0.0F && edge.beyond[1] >= 0.0F && edge.beyond[0] <= kMaxCoordinate &&
           edge.beyond[1] <= kMaxCoordinate && edge.skew[0].norm() <= kMaxSkew &&
           edge.skew[1].norm() <= kMaxSkew &&
           (edge.reach == 0.0F || edge.into_M[0].cross(edge.into_M[1]).norm() > 0.05F);
  };
  if (!std::all_of(edges.begin(), edges.end(), sound)) return "is damaged: an edge is not plausible";
  return {};
}

}  // namespace tenon::structures
