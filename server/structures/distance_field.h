#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "idl/types/spatial.h"

namespace tenon::structures {

/// The field at one point.
struct FieldSample {
  /// [m] signed, < 0 inside. Outside the band a bound: see `exact`.
  double distance = 0.0;
  /// [-] of the trilinear interpolant, in M: points outwards, length about 1. Zero when not `exact`.
  Vector3 gradient = Vector3::Zero();
  /// False outside the band: |distance| is then a lower bound of the true one; its sign is right.
  bool exact = false;
};

/// A plane of the surface beside a concave edge.
struct ValleyPlane {
  Vector3f n_M = Vector3f::Zero();  ///< [-] unit normal, into free space
  float offset = 0.0F;              ///< [m] distance of the grid's lowest corner from it

  /// [m] Of a point `p_FoP_M` from the grid's lowest corner.
  [[nodiscard]] double distance(const Vector3& p_FoP_M) const {
    return n_M.cast<double>().dot(p_FoP_M) + static_cast<double>(offset);
  }
};

/// The cells of a brick that have planes.
struct ValleyBrick {
  std::uint32_t first = 0;               ///< in `Layout::valley_cells`, of the lowest of them
  std::array<std::uint64_t, 8> cells{};  ///< one word per z, bit y * 8 + x
};

/// The cell that is interpolated at one point.
struct FieldCell {
  std::array<double, 8> samples{};   ///< [voxels] at its corners, x fastest
  Vector3 p_cell = Vector3::Zero();  ///< [voxels] the point, from the lowest corner
  double voxel = 0.0;                ///< [m] its edge
};

/// A signed distance field (SDF) of a surface, sampled in a narrow band of 8x8x8-voxel bricks (paper §3.1,
/// "voxelmap").
///
/// The bounding box is divided into a coarse grid of bricks. A flat index holds for each brick: far outside,
/// far inside, a brick of samples, or (where a small clearance requires it) a refined brick. A refined brick
/// is subdivided into refinement^3 bricks of proportionally smaller voxels; its coarse samples are used
/// where these have none. A brick stores 9^3 int16 samples, one apron layer more than its voxels, so that
/// interpolation needs one brick only. Samples are clamped to +-kClampVoxels. Frame M is the mesh's own.
///
/// Where material is too thin for the voxels there, the samples are distances less a *dilation*: the zero
/// level set lies that far outside of the exact surface, so that the wall stays solid between samples. The
/// dilation belongs to the place, trilinear between the corners of coarse bricks; it is 0 at solids.
///
/// A non-owning view (of a mapped file or vectors) with a shared owner: cheap to copy.
///
/// Threads: constant after construction, any thread may read. Real-time: all queries.
class DistanceField {
 public:
  static constexpr int kBrickVoxels = 8;
  static constexpr int kBrickSide = 9;                                        // samples along one edge
  static constexpr int kBrickSamples = kBrickSide * kBrickSide * kBrickSide;  // 729
  static constexpr int kQuantaPerVoxel = 2048;  // int16 +-16 voxels, steps of 1.5 um at 3 mm
  static constexpr int kFarPerVoxel = 16;       // resolution of `Layout::far`
  /// [voxels] From a brick's centre to its corner, rounded up.
  static constexpr double kBrickRadius = 6.9283;
  /// [voxels] |distance| up to which samples are exact; where there is a dilation, outside up to this less
  /// it.
  static constexpr double kBandVoxels = 4.0;
  /// [voxels] Samples are clamped here. A cell's corners are at most sqrt(3) voxels from any of its points:
  /// no corner is clamped where the distance is below kBandVoxels.
  static constexpr double kClampVoxels = kBandVoxels + 1.75;
  /// [voxels] Half a voxel's diagonal, rounded up: no point is further from the nearest sample, and no
  /// interpolated distance is further from the true one.
  static constexpr double kHalfDiagonal = 0.8661;

  /// An index entry. Negative: one of the constants below; below kRefined: the number of a brick of samples.
  /// Refined: kRefined + the position in `index` of its first child. The refinement^3 children (x fastest)
  /// are followed by the coarse brick, used where a child has no samples or is outside its own narrower band.
  using Entry = std::int32_t;
  static constexpr Entry kFarOutside = -1;
  static constexpr Entry kFarInside = -2;
  static constexpr Entry kRefined = 1 << 30;
  /// Most bricks with samples: queries gather samples at byte offsets of 31 bits.
  static constexpr std::int32_t kMaxBricks = 0x7FFFFFFF / (2 * kBrickSamples);  // 1,472,896
  /// Most index entries: positions in the index are below kRefined, bounds are gathered as samples are.
  static constexpr std::int32_t kMaxIndexEntries = 0x7FFFFFFF / 4;
  static constexpr std::int32_t kMaxBricksPerAxis = 1'000'000;

  struct Layout {
    Vector3 p_MoFo_M = Vector3::Zero();    ///< the grid's lowest corner
    double voxel = 0.0;                    ///< [m] edge of a coarse voxel
    std::array<std::int32_t, 3> bricks{};  ///< coarse bricks along x, y, z (x runs fastest in `index`)
    std::int32_t refinement = 1;           ///< children of a refined brick along one edge
    double band = 0.0;                     ///< [m] |distance| up to which coarse samples are exact
    double margin = 0.0;                   ///< [m] least distance of the surface to the grid's border
    double dilation = 0.0;                 ///< [m] the largest of `dilations`
    double slope = 1.0;  ///< [-] samples differ by at most this times the length between them
    /// One entry per coarse brick, then refinement^3 + 1 for each refined brick.
    std::span<const Entry> index;
    /// kBrickSamples per brick [voxels of its level / kQuantaPerVoxel].
    std::span<const std::int16_t> samples;
    /// One bound per coarse brick, for its centre [voxels / kFarPerVoxel]: a lower bound of the signed
    /// distance; for far-inside bricks minus a lower bound of the depth.
    std::span<const std::int16_t> far;
    /// [m] Dilation at the corners of the coarse bricks (x fastest), one more along each axis than there are
    /// bricks. Empty: none anywhere.
    std::span<const float> dilations;
    /// Where the surface in a cell is concave and made of a few planes, these: free space is outside of all
    /// of them, so the distance is the smallest one of those to the planes, while interpolation rounds it
    /// off. Per brick of samples the number of its ValleyBrick, or kNoValley; empty: there are none.
    std::span<const std::int32_t> valley_index;
    std::span<const ValleyBrick> valley_bricks;
    /// Per cell with planes: the number of its first plane times kMaxValleyPlanes, plus that of its planes
    /// less one.
    std::span<const std::uint32_t> valley_cells;
    std::span<const ValleyPlane> valley_planes;
  };
  static constexpr std::int32_t kNoValley = -1;
  static constexpr std::uint32_t kMaxValleyPlanes = 4;  ///< of a cell

  DistanceField() = default;
  /// `owner` keeps the memory of the spans alive.
  DistanceField(const Layout& layout, std::shared_ptr<const void> owner);

  /// Distance and gradient at a point: trilinear in the finest brick there. A point outside the band or the
  /// grid, or not finite, gives a sample that is not `exact`.
  [[nodiscard]] FieldSample sample(const Vector3& p_MP) const noexcept;

  /// The same without the dilation: distances to the exact surface, as well as the voxels resolve them.
  [[nodiscard]] FieldSample undilated(const Vector3& p_MP) const noexcept;

  /// [m] Dilation at a point; 0 outside the grid.
  [[nodiscard]] double dilationAt(const Vector3& p_MP) const noexcept;
  /// [m] By how much the dilation at a point exceeds `most` [m].
  [[nodiscard]] double dilationBeyond(double most, const Vector3& p_MP) const noexcept {
    return most < layout_.dilation ? std::max(dilationAt(p_MP) - most, 0.0) : 0.0;
  }
  /// [m] Largest dilation in a box, of the bricks that have samples.
  [[nodiscard]] double largestDilation(const Eigen::AlignedBox3d& box_M) const noexcept;

  /// [m] A lower bound of the signed distance, and of every exact sample(), within `radius` [m] of p. For
  /// pruning: one look-up.
  [[nodiscard]] double lowerBound(const Vector3& p_MP, double radius = 0.0) const noexcept;

  /// The cell that sample() interpolates at a point; false where that is not `exact`.
  [[nodiscard]] bool cellAt(const Vector3& p_MP, FieldCell& cell) const noexcept;

  /// The planes that are the surface in the cell of a point, see Layout::valley_planes; empty where there
  /// are none.
  [[nodiscard]] std::span<const ValleyPlane> planesAt(const Vector3& p_MP) const noexcept;

  /// [m] Edge of the voxels that sample() interpolates at p.
  [[nodiscard]] double voxelAt(const Vector3& p_MP) const noexcept;

  [[nodiscard]] const Layout& layout() const { return layout_; }
  [[nodiscard]] double voxel() const { return layout_.voxel; }
  [[nodiscard]] double band() const { return layout_.band; }
  [[nodiscard]] double dilation() const { return layout_.dilation; }
  [[nodiscard]] double slope() const { return layout_.slope; }
  [[nodiscard]] bool empty() const { return layout_.index.empty(); }
  /// Whether some cells have planes, see planesAt().
  [[nodiscard]] bool hasPlanes() const { return !layout_.valley_index.empty(); }
  [[nodiscard]] Eigen::AlignedBox3d box() const;

 private:
  struct BrickLocation;
  /// False outside the grid.
  [[nodiscard]] bool locate(const Vector3& p_MP, BrickLocation& location) const noexcept;
  /// Whether the distance at `p_brick` [bricks] is within `band` [m]; `voxel` [m] is that of the brick's
  /// level.
  [[nodiscard]] bool interpolate(Entry brick, const Vector3& p_brick, double voxel, double band,
                                 FieldSample& sample) const noexcept;
  /// planesAt() `p_brick` [bricks] in a brick of samples.
  [[nodiscard]] std::span<const ValleyPlane> planesIn(Entry brick, const Vector3& p_brick) const noexcept;
  /// [m] A lower bound of |distance| in a brick without samples.
  [[nodiscard]] double farMagnitude(const BrickLocation& location) const noexcept;
  /// [m] Dilation at `p_brick` [bricks] in the coarse brick with coordinates x, y, z.
  [[nodiscard]] double dilationIn(std::size_t x, std::size_t y, std::size_t z,
                                  const Vector3& p_brick) const noexcept;

  Layout layout_;
  double brick_edge_ = 0.0;          ///< [m]
  double inverse_brick_edge_ = 0.0;  ///< [1/m]
  std::shared_ptr<const void> owner_;
};

}  // namespace tenon::structures
