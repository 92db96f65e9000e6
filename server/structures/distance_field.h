#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "idl/types/spatial.h"

namespace tenon {

/// What a field knows about one point.
struct FieldSample {
  double distance = 0.0;  ///< [m] signed, < 0 inside; outside the band a bound: see `exact`
  Vector3 gradient =
      Vector3::Zero();  ///< of the trilinear interpolant, outwards, about unit; zero when !exact
  bool exact =
      false;  ///< false: outside the band, |distance| is only a lower bound of the true one, sign right
};

/// A signed distance to a surface, sampled in a narrow band of 8x8x8-voxel bricks (paper §3.1, "voxelmap").
///
/// The box is cut into a coarse grid of bricks; a flat index says for each: far outside, far inside, a brick
/// of samples, or (where a small clearance asks for it) a refined brick, cut again into refinement^3 bricks
/// of proportionally smaller voxels near the surface, its own coarse samples answering elsewhere. A brick
/// keeps 9^3 int16 samples, one apron layer more than its voxels, so no interpolation ever leaves it. Samples
/// stop growing at kClampVoxels: what lies further is only known to be further. Frame M is the mesh's own.
///
/// A view over memory that somebody else owns (a mapped file, a vector): copying is cheap.
///
/// Threads: constant after construction, any thread may read. Real-time: all queries.
class DistanceField {
 public:
  static constexpr int kBrickVoxels = 8;
  static constexpr int kBrickSide = 9;                                        // samples along an edge
  static constexpr int kBrickSamples = kBrickSide * kBrickSide * kBrickSide;  // 729
  static constexpr int kQuantaPerVoxel = 2048;  // int16 +-16 voxels, steps of 1.5 um at 3 mm
  static constexpr int kFarPerVoxel = 16;
  static constexpr double kBandVoxels = 4.0;
  /// A cell's corners lie within sqrt(3) voxels of any of its points: below kBandVoxels none of them is
  /// clamped.
  static constexpr double kClampVoxels = kBandVoxels + 1.75;
  /// [voxels] Half the diagonal of one, rounded up: no point is further from the nearest sample, and no
  /// interpolated distance from the truth.
  static constexpr double kHalfDiagonal = 0.8661;

  /// An index entry: < 0: see constants; else the number of a brick. Refined: kRefined + the place in `index`
  /// of its first child. The refinement^3 children (x fastest) are followed by one more entry: the coarse
  /// brick that answers where a child has no samples (< 0) or is out of its own narrower band.
  using Entry = std::int32_t;
  static constexpr Entry kFarOutside = -1;
  static constexpr Entry kFarInside = -2;
  static constexpr Entry kRefined = 1 << 30;

  struct Layout {
    Vector3 p_MoFo_M = Vector3::Zero();    ///< the grid's lowest corner
    double voxel = 0.0;                    ///< [m] edge of a coarse voxel
    std::array<std::int32_t, 3> bricks{};  ///< coarse bricks along x, y, z (x runs fastest in `index`)
    std::int32_t refinement = 1;           ///< children of a refined brick along an edge
    double band = 0.0;                     ///< [m] |distance| up to which coarse samples are exact
    double margin = 0.0;                   ///< [m] no surface is nearer than this to the grid's border
    std::span<const Entry> index;  ///< bricks x*y*z entries, then refinement^3 + 1 for each refined brick
    std::span<const std::int16_t>
        samples;  ///< kBrickSamples a brick, in voxels / kQuantaPerVoxel of its level
    /// Per coarse brick [voxel / kFarPerVoxel], for its centre: with samples or far outside, a lower bound of
    /// the signed distance; far inside, minus a lower bound of the depth.
    std::span<const std::int16_t> far;
  };

  DistanceField() = default;
  /// `owner` keeps the memory of the spans alive.
  DistanceField(const Layout& layout, std::shared_ptr<const void> owner);

  /// Distance and gradient at a point (trilinear in the finest brick there).
  [[nodiscard]] FieldSample sample(const Vector3& p_MP) const noexcept;

  /// A number that no signed distance within `radius` of p, and no exact sample() there, is below. For
  /// pruning; costs one look-up.
  [[nodiscard]] double lowerBound(const Vector3& p_MP, double radius = 0.0) const noexcept;

  /// Edge of the voxels that answer at p [m].
  [[nodiscard]] double voxelAt(const Vector3& p_MP) const noexcept;

  [[nodiscard]] const Layout& layout() const { return layout_; }
  [[nodiscard]] double voxel() const { return layout_.voxel; }
  [[nodiscard]] double band() const { return layout_.band; }
  [[nodiscard]] bool empty() const { return layout_.index.empty(); }
  [[nodiscard]] Eigen::AlignedBox3d box() const;

 private:
  struct Place;
  [[nodiscard]] bool locate(const Vector3& p_MP, Place& place) const noexcept;
  [[nodiscard]] bool interpolate(Entry brick, const Vector3& p_brick, double voxel, double band,
                                 FieldSample& sample) const noexcept;
  [[nodiscard]] double farMagnitude(const Place& place) const noexcept;

  Layout layout_;
  double brick_edge_ = 0.0;
  double inverse_brick_edge_ = 0.0;
  std::shared_ptr<const void> owner_;
};

}  // namespace tenon
