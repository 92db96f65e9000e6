#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon {

/// A point on the surface of an object, in its mesh frame M.
struct ShellPoint {
  Vector3f p_MP = Vector3f::Zero();
  Vector3f inward_M = Vector3f::Zero();  ///< unit normal, into the object
  float area = 0.0F;                     ///< [m^2] of surface it stands for when all levels are used
};

/// A ball that holds `count` consecutive things: points (leaf) or leaves (cluster).
struct ShellSphere {
  Vector3f p_MC = Vector3f::Zero();
  float radius = 0.0F;
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

/// Points added by one level. Levels 0..k together sample the whole object, about four times denser each.
struct ShellLevel {
  std::uint32_t first_point = 0, point_count = 0;
  std::uint32_t first_leaf = 0, leaf_count = 0;
  std::uint32_t first_cluster = 0, cluster_count = 0;
  float spacing = 0.0F;     ///< [m] between neighbours when levels 0..this are used
  float area_scale = 1.0F;  ///< all skin over the skin of its points and coarser ones
};

/// Sixteen points or balls side by side, as vector instructions read them; unused lanes repeat the first.
struct alignas(64) ShellBlock {
  static constexpr std::size_t kLanes = 16;
  std::array<float, kLanes> x{}, y{}, z{};  ///< [m] in M
  std::array<float, kLanes> radius{};       ///< [m] of balls; 0 for points
  std::uint32_t count = 0;                  ///< lanes in use
};

/// An object as points on its skin with a tree of spheres over them (paper §3.1, "point-sphere tree").
///
/// Points are stored by level, inside a level by leaf (at most 16 neighbours), leaves by cluster (at most 16
/// leaves). A query walks clusters, then leaves, then points of the levels that its budget allows, sixteen at
/// a time: blocks hold them side by side.
///
/// A view, as DistanceField. Threads: constant. Real-time: all.
class Pointshell {
 public:
  static constexpr std::uint32_t kLeafPoints = 16;
  static constexpr std::uint32_t kClusterLeaves = 16;

  struct Layout {
    std::span<const ShellPoint> points;
    std::span<const ShellSphere> leaves;
    std::span<const ShellSphere> clusters;
    std::span<const ShellLevel> levels;
  };

  Pointshell() = default;
  Pointshell(const Layout& layout, std::shared_ptr<const void> owner);

  [[nodiscard]] std::span<const ShellPoint> points() const { return layout_.points; }
  [[nodiscard]] std::span<const ShellSphere> leaves() const { return layout_.leaves; }
  [[nodiscard]] std::span<const ShellSphere> clusters() const { return layout_.clusters; }
  [[nodiscard]] std::span<const ShellLevel> levels() const { return layout_.levels; }
  [[nodiscard]] bool empty() const { return layout_.points.empty(); }

  /// The points of a leaf, by its number.
  [[nodiscard]] const ShellBlock& pointsOfLeaf(std::size_t leaf) const { return blocks_->leaves[leaf]; }
  /// The leaves of a cluster, by its number.
  [[nodiscard]] const ShellBlock& leavesOfCluster(std::size_t cluster) const {
    return blocks_->clusters[cluster];
  }
  /// The leaf that a point is in, by its number.
  [[nodiscard]] std::uint32_t leafOf(std::size_t point) const { return blocks_->leaf_of_point[point]; }
  /// The clusters of all levels, sixteen at a time; each level begins a new block.
  [[nodiscard]] std::span<const ShellBlock> clusterBlocks() const { return blocks_->levels; }

  /// [m^2] Of the points of levels 0..k, what each stands for when finer levels are left out.
  [[nodiscard]] std::span<const float> areasOfLevel(std::size_t k) const { return blocks_->areas[k]; }

  /// Largest distance of a point from the mesh origin [m]: bounds the speed of any point by |v| + |w| radius.
  [[nodiscard]] double radius() const { return radius_; }
  /// A ball that holds all points: centre in M and radius [m].
  [[nodiscard]] const Vector3& ballCentre() const { return p_MC_; }
  [[nodiscard]] double ballRadius() const { return ball_radius_; }
  /// How many balls there are: that of all points, those of clusters and of leaves.
  [[nodiscard]] std::uint32_t spheres() const { return spheres_; }

 private:
  struct Blocks {
    std::vector<ShellBlock> leaves, clusters, levels;
    std::vector<std::uint32_t> leaf_of_point;
    std::vector<std::vector<float>> areas;
  };

  Layout layout_;
  std::shared_ptr<const void> owner_;
  std::shared_ptr<const Blocks> blocks_;  ///< the same numbers as the spans, side by side
  double radius_ = 0.0;
  Vector3 p_MC_ = Vector3::Zero();
  double ball_radius_ = 0.0;
  std::uint32_t spheres_ = 0;
};

}  // namespace tenon
