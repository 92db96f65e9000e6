#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "idl/types/spatial.h"
#include "server/structures/distance_field.h"
#include "server/structures/pointshell.h"

namespace tenon::collision {

/// R v, summed from left to right: Eigen's order differs from row to row, and with it the last bits.
[[nodiscard]] inline Vector3 rotated(const Matrix3& R, const Vector3& v) {
  return {R(0, 0) * v[0] + R(0, 1) * v[1] + R(0, 2) * v[2], R(1, 0) * v[0] + R(1, 1) * v[1] + R(1, 2) * v[2],
          R(2, 0) * v[0] + R(2, 1) * v[1] + R(2, 2) * v[2]};
}

/// Transform from A into the field's grid in single precision, for culling: unit is the voxel, origin the
/// centre of the grid's first voxel. `slack` bounds the rounding error.
struct CullFrame {
  /// Largest number of voxels along an axis. In longer grids floats do not resolve voxels, and nothing is
  /// culled.
  static constexpr std::int32_t kMaxVoxels = 1 << 22;

  /// `reach_A` [m]: largest distance of a point of A from its origin; `limit_B` [m]: signed distance in B up
  /// to which points are kept.
  CullFrame(const structures::DistanceField& field, const Matrix3& R_BA, const Vector3& p_BA_B,
            double reach_A, double limit_B);

  std::array<float, 9> R{};           ///< [voxels/m] rotation and scale from A, column by column
  std::array<float, 3> p{};           ///< [voxels] A's origin
  std::array<float, 3> last_voxel{};  ///< [voxels] centre of the grid's last voxel
  float per_metre = 0.0F;             ///< [voxels/m]
  float slack = 0.0F;                 ///< [voxels] bound of the rounding error
  float limit = 0.0F;                 ///< [voxels] a point or ball with a larger lower bound is culled
  float outside_grid = 0.0F;          ///< [voxels] lower bound of distances outside the grid
  float slope = 1.0F;                 ///< [-] of the field, see DistanceField::Layout
  float band = 0.0F;         ///< [voxels] lower bound of the samples that a brick outside does not store
  float beyond_band = 0.0F;  ///< [voxels] lower bound of distances outside, in bricks without samples
};

/// What all lanes of a query share: the field, both poses and the margin.
struct LaneFrame {
  /// `the_margin` [m]: as in PairQuery; `reach_A` [m]: as in CullFrame.
  LaneFrame(const structures::DistanceField& the_field, const Pose& X_WA, const Pose& X_WB, double the_margin,
            double reach_A);

  [[nodiscard]] Vector3 inB(const Vector3& p_AP) const { return p_BA_B + rotated(R_BA, p_AP); }
  /// [m] The gap for a lower bound of distance `bound` [voxels] of `cull`.
  [[nodiscard]] double gapOf(float bound) const {
    return static_cast<double>(bound - cull.slack) * field.voxel();
  }

  const structures::DistanceField& field;
  Eigen::AlignedBox3d box_B;  ///< of the field
  double margin;              ///< [m]
  Matrix3 R_WA, R_WB, R_BA;
  Vector3 p_WA, p_BA_B;
  CullFrame cull;
};

/// Points in A as structure of arrays [m]; arrays are readable up to a multiple of sixteen.
struct PointLanes {
  const float* x;  ///< [m]
  const float* y;  ///< [m]
  const float* z;  ///< [m]
  std::size_t count;
};

/// [m] Gap of a pair without points to test: far, but finite, so that arithmetic with it is valid.
inline constexpr double kFarGap = 1e6;

/// Field samples of sixteen points, frame B.
struct alignas(64) SampleLanes {
  std::array<double, structures::ShellBlock::kLanes> distance;                            ///< [m]
  std::array<double, structures::ShellBlock::kLanes> gradient_x, gradient_y, gradient_z;  ///< [-]
  std::uint32_t exact;  ///< bit per lane: inside the field's band (FieldSample::exact)
  std::uint32_t near;   ///< bit per lane: exact, and the gap is within the margin
};

/// Summary over all sampled points.
struct SampleSums {
  double smallest_distance = kFarGap;  ///< [m]
  double smallest_far_gap = kFarGap;   ///< [m] of the points that are not near
  std::uint32_t colliding = 0;         ///< number of points with a negative gap
  std::uint32_t near = 0;              ///< number of near points
};

/// Position and normal of sixteen contacts, in W. Lanes without the `has_normal` bit have no valid normal,
/// lanes that are not exact no valid values.
struct alignas(64) ContactLanes {
  std::array<double, structures::ShellBlock::kLanes> x, y, z;        ///< [m]
  std::array<double, structures::ShellBlock::kLanes> n_x, n_y, n_z;  ///< [-]
  std::uint32_t has_normal;  ///< bit per lane: the gradient is at least kMinGradient long
};

/// Penalty force and torque of sixteen contacts on A about its origin, in W, for a stiffness of 1 N/m; zero
/// for lanes that are not inside.
struct alignas(64) PenaltyLanes {
  std::array<double, structures::ShellBlock::kLanes> f_x, f_y, f_z;  ///< [m] force
  std::array<double, structures::ShellBlock::kLanes> t_x, t_y, t_z;  ///< [m^2] torque
  std::uint32_t inside;  ///< bit per lane: the point is near with a negative gap
};

/// Vectors from a point to the probes around it, in B.
struct alignas(64) ProbeOffsets {
  static constexpr std::size_t kProbes = 8;
  std::array<double, kProbes> x, y, z;  ///< [m]
};

/// [m] Distance that stands for no plane: the gradient at the probe is not of unit length.
inline constexpr double kNoPlane = -std::numeric_limits<double>::infinity();

/// Tangent planes of the field at the probes: distance of the point from each plane or kNoPlane, and the
/// plane's gradient.
struct alignas(64) TangentPlanes {
  std::array<double, ProbeOffsets::kProbes> distance;                            ///< [m]
  std::array<double, ProbeOffsets::kProbes> gradient_x, gradient_y, gradient_z;  ///< [-]
};

/// Points that may be contacts, as structure of arrays in the order of the pointshell.
struct Candidates {
  static constexpr std::size_t kBatchClusters = 4;  ///< clusters of one kernel call
  static constexpr std::size_t kBatchPoints =
      kBatchClusters * structures::Pointshell::kClusterLeaves * structures::Pointshell::kLeafPoints;
  static constexpr std::size_t kCapacity = kBatchPoints + 1024;
  template <typename T>
  using Lanes = std::array<T, kCapacity + structures::ShellBlock::kLanes>;  ///< kernels write whole vectors

  alignas(64) Lanes<float> x, y, z;
  Lanes<std::uint32_t> point;
  std::uint32_t count = 0;

  [[nodiscard]] bool fitsBatch() const { return count + kBatchPoints <= kCapacity; }
};

/// Near points of a traversal and their samples, as structure of arrays in the order of the pointshell.
struct NearPoints {
  static constexpr std::size_t kCapacity = Candidates::kCapacity + 1536;
  template <typename T>
  using Lanes = std::array<T, kCapacity + structures::ShellBlock::kLanes>;  ///< kernels write whole vectors

  alignas(64) Lanes<double> gap;                     ///< [m]
  Lanes<double> gradient_x, gradient_y, gradient_z;  ///< [-] in B
  Lanes<float> x, y, z;                              ///< [m] in A
  Lanes<std::uint32_t> point;                        ///< index in the pointshell
  std::size_t count = 0;

  [[nodiscard]] bool fits(std::size_t more) const { return count + more <= kCapacity; }
  [[nodiscard]] Vector3 gradient(std::size_t i) const {
    return {gradient_x[i], gradient_y[i], gradient_z[i]};
  }
  void set(std::size_t i, const structures::FieldSample& sample) {
    gap[i] = sample.distance;
    gradient_x[i] = sample.gradient.x();
    gradient_y[i] = sample.gradient.y();
    gradient_z[i] = sample.gradient.z();
  }
  void move(std::size_t from, std::size_t to) {
    gap[to] = gap[from];
    gradient_x[to] = gradient_x[from];
    gradient_y[to] = gradient_y[from];
    gradient_z[to] = gradient_z[from];
    x[to] = x[from];
    y[to] = y[from];
    z[to] = z[from];
    point[to] = point[from];
  }
};

/// What culling skipped, and its work.
struct CullResult {
  /// [voxels] smallest lower bound of distance of everything culled
  float smallest_bound = std::numeric_limits<float>::infinity();
  std::uint32_t spheres = 0;  ///< tested
  std::uint32_t points = 0;   ///< tested
};

/// The inner loops of a query, compiled for every instruction set.
///
/// Culling uses floats and is conservative: it only skips what is proved to be beyond the margin. The rest is
/// evaluated in doubles: a lane is a point and computes what DistanceField::sample does, in the same order.
/// Fused multiply-add is never used, so every instruction set gives the same bits.
///
/// Threads: pure. Real-time.
struct QueryKernels {
  std::string_view isa;  ///< "scalar", "sse4", "avx2", "avx512", or Highway's name of the target
  /// Bit mask of the up to sixteen clusters (bounding spheres `balls`) that may hold a contact.
  std::uint32_t (*clusters)(const LaneFrame& frame, const structures::ShellBlock& balls,
                            CullResult& culled) noexcept;
  /// Appends the points that may be contacts of up to Candidates::kBatchClusters clusters, given by index;
  /// requires candidates.fitsBatch().
  void (*candidates)(const LaneFrame& frame, const structures::Pointshell& shell,
                     std::span<const std::uint32_t> cluster_indices, Candidates& candidates,
                     CullResult& culled) noexcept;
  /// Samples the field. `out` has one block for each sixteen points, the last one incomplete.
  void (*samples)(const LaneFrame& frame, const PointLanes& points, SampleLanes* out,
                  SampleSums& sums) noexcept;
  /// Positions and normals of the sixteen near points from number `first`, and of fewer at the end.
  void (*near_contacts)(const LaneFrame& frame, const NearPoints& near, std::size_t first,
                        ContactLanes& out) noexcept;
  /// Positions and normals of sampled points; blocks as in `samples`.
  void (*contacts)(const LaneFrame& frame, const PointLanes& points, const SampleLanes* samples,
                   ContactLanes* out) noexcept;
  /// Penalties of one block. `points`: sixteen pointshell indices; `areas` [m^2] by point, not empty: points
  /// beyond its end have area 0.
  void (*penalties)(const LaneFrame& frame, const SampleLanes& samples, const ContactLanes& contacts,
                    const std::uint32_t* points, std::span<const float> areas, PenaltyLanes& out) noexcept;
  /// Per block a bit mask of the lanes that are inside and have a gradient shorter than
  /// 1, to `lanes`. Returns their number.
  std::uint32_t (*non_unit_gradients)(std::span<const SampleLanes> samples, std::uint32_t* lanes) noexcept;
  /// Tangent planes at probes around p_BP; `scale` [-] of the offsets.
  void (*tangent_planes)(const LaneFrame& frame, const ProbeOffsets& offsets, const Vector3& p_BP,
                         double scale, TangentPlanes& out) noexcept;
};

/// [m^2] The paper gives no unit for its stiffness; here K [N/m] acts when 1 cm^2 of surface is inside.
inline constexpr double kReferenceArea = 1e-4;

/// [-] A shorter gradient of the interpolation gives no normal: the point is near the medial axis (the middle
/// of a thin sheet).
inline constexpr double kMinGradient = 0.3;

/// Kernels for all instruction sets of this processor: the baseline first, the fastest last.
[[nodiscard]] std::span<const QueryKernels> supportedKernels() noexcept;

/// The kernels that queries use.
[[nodiscard]] const QueryKernels& chosenKernels() noexcept;

/// Selects the kernels of all later queries of the process; false, and no change, when `isa` is not supported
/// here. The fastest are the default. For tests, benchmarks and `--isa`. Threads: any, between queries.
bool chooseKernels(std::string_view isa) noexcept;

}  // namespace tenon::collision
