#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "idl/types/spatial.h"
#include "server/structures/huge_pages.h"

namespace tenon::structures {

/// A point on the surface of an object, in its mesh frame M.
struct ShellPoint {
  Vector3f p_MP = Vector3f::Zero();
  Vector3f inward_M = Vector3f::Zero();  ///< unit normal, into the object
  float area = 0.0F;                     ///< [m^2] surface area it represents when all levels are used
};

/// The bounding sphere of `count` consecutive elements: of points (a leaf) or of leaves (a cluster).
struct ShellSphere {
  Vector3f p_MC = Vector3f::Zero();  ///< centre
  float radius = 0.0F;               ///< [m]
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

/// The points that one level of detail adds. Levels 0..k together sample the whole object; each level has
/// about four times the points of the one before.
struct ShellLevel {
  std::uint32_t first_point = 0, point_count = 0;
  std::uint32_t first_leaf = 0, leaf_count = 0;
  std::uint32_t first_cluster = 0, cluster_count = 0;
  float spacing = 0.0F;  ///< [m] between neighbours when levels 0..this are used
  float area_scale =
      1.0F;  ///< [-] whole surface area over the sum of `area` in levels 0..this; see areasOfLevel
};

/// Up to sixteen points or spheres in structure-of-arrays form for SIMD; unused lanes repeat the first.
struct alignas(64) ShellBlock {
  static constexpr std::size_t kLanes = 16;
  std::array<float, kLanes> x{}, y{}, z{};  ///< [m] in M
  std::array<float, kLanes> radius{};       ///< [m] of spheres; 0 for points
  std::uint32_t count = 0;                  ///< lanes in use
};

/// A pointshell: points on an object's surface with a bounding-sphere hierarchy over them (paper §3.1,
/// "point-sphere tree").
///
/// Points are stored by level, within a level by leaf (at most 16 neighbouring points), leaves by cluster (at
/// most 16 leaves). A query traverses clusters, then leaves, then points of the levels within its budget,
/// sixteen at a time.
///
/// A non-owning view with a shared owner, as DistanceField.
///
/// Threads: constant after construction. Real-time: all but the constructor.
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
  /// `owner` keeps the memory of the spans alive.
  Pointshell(const Layout& layout, std::shared_ptr<const void> owner);

  [[nodiscard]] const Layout& layout() const { return layout_; }
  [[nodiscard]] std::span<const ShellPoint> points() const { return layout_.points; }
  [[nodiscard]] std::span<const ShellSphere> leaves() const { return layout_.leaves; }
  [[nodiscard]] std::span<const ShellSphere> clusters() const { return layout_.clusters; }
  [[nodiscard]] std::span<const ShellLevel> levels() const { return layout_.levels; }
  [[nodiscard]] bool empty() const { return layout_.points.empty(); }

  /// The points of leaf `leaf`.
  [[nodiscard]] const ShellBlock& pointsOfLeaf(std::size_t leaf) const { return blocks_->leaves[leaf]; }
  /// The leaves of cluster `cluster`.
  [[nodiscard]] const ShellBlock& leavesOfCluster(std::size_t cluster) const {
    return blocks_->clusters[cluster];
  }
  /// The number of the leaf that contains point `point`.
  [[nodiscard]] std::uint32_t leafOf(std::size_t point) const { return blocks_->leaf_of_point[point]; }
  /// The clusters of all levels, sixteen per block; each level begins a new block.
  [[nodiscard]] std::span<const ShellBlock> clusterBlocks() const { return blocks_->levels; }
  /// Bounding spheres of the blocks of clusterBlocks(), sixteen per block. Empty for small shells, where
  /// testing all clusters costs no more, and for shells of several levels.
  [[nodiscard]] std::span<const ShellBlock> blockSpheres() const { return blocks_->block_spheres; }

  /// [m^2] The area that each point of levels 0..k represents when finer levels are skipped (levelAreas).
  [[nodiscard]] std::span<const float> areasOfLevel(std::size_t k) const { return blocks_->areas[k]; }

  /// [m] Largest distance of a point from the mesh origin: the speed of any point is at most |v| + |w|
  /// radius.
  [[nodiscard]] double radius() const { return radius_; }
  /// Centre, in M, of the bounding sphere of all points.
  [[nodiscard]] const Vector3& boundingCentre() const { return p_MC_; }
  /// [m] Radius of the bounding sphere of all points.
  [[nodiscard]] double boundingRadius() const { return bounding_radius_; }
  /// Number of bounding spheres: one of all points, those of clusters and of leaves.
  [[nodiscard]] std::uint32_t spheres() const { return spheres_; }

 private:
  struct Blocks {
    HugeVector<ShellBlock> leaves, clusters, levels, block_spheres;
    HugeVector<std::uint32_t> leaf_of_point;
    std::vector<std::vector<float>> areas;  ///< [m^2] by level
  };

  Layout layout_;
  std::shared_ptr<const void> owner_;
  std::shared_ptr<const Blocks> blocks_;  ///< the content of the spans as structure of arrays
  double radius_ = 0.0;                   ///< [m]
  Vector3 p_MC_ = Vector3::Zero();
  double bounding_radius_ = 0.0;  ///< [m]
  std::uint32_t spheres_ = 0;
};

}  // namespace tenon::structures
