#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "idl/types/spatial.h"
#include "server/structures/distance_field.h"
#include "server/structures/pointshell.h"

namespace tenon {

/// R v, summed from the left: Eigen's own order differs from row to row, and the bits with it.
[[nodiscard]] inline Vector3 turned(const Matrix3& R, const Vector3& v) {
  return {R(0, 0) * v[0] + R(0, 1) * v[1] + R(0, 2) * v[2], R(1, 0) * v[0] + R(1, 1) * v[1] + R(1, 2) * v[2],
          R(2, 0) * v[0] + R(2, 1) * v[1] + R(2, 2) * v[2]};
}

/// What all lanes of a query share: the field, both poses, and how near is near.
struct LaneFrame {
  LaneFrame(const DistanceField& the_field, const Pose& X_WA, const Pose& X_WB, double the_dilation,
            double the_margin);

  [[nodiscard]] Vector3 inB(const Vector3& p_AP) const { return p_BA_B + turned(R_BA, p_AP); }

  const DistanceField& field;
  Eigen::AlignedBox3d box_B;  ///< of the field
  double dilation;
  double margin;
  double sphere_slack = 1e-6;  ///< [m] what rounding centre and radius to floats may take from a ball
  Matrix3 R_WA, R_WB, R_BA;
  Vector3 p_WA, p_BA_B;
};

/// What the field says at the sixteen points of a block.
struct alignas(64) SampleLanes {
  std::array<double, ShellBlock::kLanes> distance, gradient_x, gradient_y, gradient_z;
  std::uint32_t exact = 0;          ///< one bit a lane, as in `near`
  std::uint32_t near = 0;           ///< exact, and the gap within the margin
  std::uint32_t colliding = 0;      ///< how many gaps are negative
  double smallest_distance = 0.0;   ///< [m]
  double smallest_gap_apart = 0.0;  ///< [m] of the lanes that are not near
};

/// Where contacts are and how B pushes; lanes without a slope have no normal.
struct alignas(64) ContactLanes {
  std::array<double, ShellBlock::kLanes> x, y, z, n_x, n_y, n_z;
  std::uint32_t sloping = 0;  ///< one bit a lane: the gradient says where outside is
};

/// Sixteen balls against the field: those that may hold a contact, and a bound for the gaps of the others.
struct BallLanes {
  std::uint32_t reaching = 0;  ///< one bit a lane
  double smallest_bound = 0.0;
};

/// The inner loops of a query, once for every instruction set.
///
/// A lane is a point and does what DistanceField::sample and ::lowerBound do, in doubles, in the same order
/// and without a fused multiply-add: every set of kernels gives the same bits, and so does the field itself.
///
/// Threads: pure. Real-time.
struct QueryKernels {
  std::string_view isa;  ///< "scalar", "sse4", "avx2", "avx512", or what else a processor has
  /// `closer`: a ball that the far bound does not free gets a second chance by the sample at its centre.
  BallLanes (*balls)(const LaneFrame& frame, const ShellBlock& block, bool closer) noexcept;
  void (*samples)(const LaneFrame& frame, const ShellBlock& block, SampleLanes& out) noexcept;
  void (*contacts)(const LaneFrame& frame, const ShellBlock& block, const SampleLanes& samples,
                   ContactLanes& out) noexcept;
};

/// Below this the interpolant's gradient says nothing: the point is near a medial axis (a thin sheet's
/// middle).
inline constexpr double kLeastGradient = 0.3;

/// The gap of a pair that has nothing to test [m]: far, yet a number that can be divided.
inline constexpr double kNothingNear = 1e6;

/// Half the diagonal of a voxel, rounded up: no interpolated distance is further from the truth [voxels].
inline constexpr double kHalfDiagonal = 0.8661;

/// All that this processor can run, the fastest last.
[[nodiscard]] std::span<const QueryKernels> supportedKernels() noexcept;

/// Those for a query of this field: the chosen ones, or plain code when the field is too large for offsets of
/// 32 bits or has no samples.
[[nodiscard]] const QueryKernels& kernelsFor(const DistanceField& field) noexcept;

/// Makes all later queries of the process use one set of kernels; false: not supported here. For tests,
/// benchmarks and `--isa`; without it the fastest are used. Threads: any, between queries.
bool chooseKernels(std::string_view isa) noexcept;

/// Plain code, a point after the other.
[[nodiscard]] QueryKernels scalarKernels() noexcept;

}  // namespace tenon
