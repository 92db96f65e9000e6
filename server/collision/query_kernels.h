#pragma once

#include <array>
#include <cstdint>
#include <limits>
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

/// The field's frame in floats: in voxels, from the middle of the grid's first voxel. Good enough to tell
/// what is certainly far; `slack` is more than rounding can do.
struct CullFrame {
  /// Along an axis. In longer grids floats cannot tell voxels apart, and nothing is certainly far.
  static constexpr std::int32_t kMostVoxels = 1 << 22;

  CullFrame(const DistanceField& field, const Matrix3& R_BA, const Vector3& p_BA_B, double reach_A,
            double limit);

  std::array<float, 9> R{};     ///< voxels a metre of A, column by column
  std::array<float, 3> p{};     ///< where A's origin is
  std::array<float, 3> most{};  ///< the middle of the grid's last voxel
  float per_metre = 0.0F;
  float slack = 0.0F;
  float limit = 0.0F;        ///< a bound above this frees a point or a ball
  float outside = 0.0F;      ///< distances outside the grid are not below this
  float beyond_band = 0.0F;  ///< nor, if that is less, those outside in bricks without samples
};

/// What all lanes of a query share: the field, both poses, and how near is near.
struct LaneFrame {
  LaneFrame(const DistanceField& the_field, const Pose& X_WA, const Pose& X_WB, double the_dilation,
            double the_margin, double reach_A);

  [[nodiscard]] Vector3 inB(const Vector3& p_AP) const { return p_BA_B + turned(R_BA, p_AP); }
  /// A bound in voxels of `cull` as a gap [m].
  [[nodiscard]] double gapOf(float bound) const {
    return static_cast<double>(bound - cull.slack) * field.voxel() - dilation;
  }

  const DistanceField& field;
  Eigen::AlignedBox3d box_B;  ///< of the field
  double dilation;
  double margin;
  Matrix3 R_WA, R_WB, R_BA;
  Vector3 p_WA, p_BA_B;
  CullFrame cull;
};

/// Points side by side, in A; whole blocks of sixteen can be read.
struct PointLanes {
  const float* x;
  const float* y;
  const float* z;
  std::size_t count;
};

/// The gap of a pair that has nothing to test [m]: far, yet a number that can be divided.
inline constexpr double kNothingNear = 1e6;

/// What the field says at sixteen of them.
struct alignas(64) SampleLanes {
  std::array<double, ShellBlock::kLanes> distance, gradient_x, gradient_y, gradient_z;
  std::uint32_t exact;  ///< one bit a lane, as in `near`
  std::uint32_t near;   ///< exact, and the gap within the margin
};

/// And at all that were sampled.
struct SampleSums {
  double smallest_distance = kNothingNear;   ///< [m]
  double smallest_gap_apart = kNothingNear;  ///< [m] of the lanes that are not near
  std::uint32_t colliding = 0;               ///< how many gaps are negative
  std::uint32_t near = 0;                    ///< how many lanes are
};

/// Where contacts are and how B pushes; lanes without a slope have no normal, lanes without a sample nothing.
struct alignas(64) ContactLanes {
  std::array<double, ShellBlock::kLanes> x, y, z, n_x, n_y, n_z;
  std::uint32_t sloping;  ///< one bit a lane: the gradient says where outside is
};

/// What B pushes at the contacts with 1 N/m, about A's origin; zero where it does not.
struct alignas(64) PushLanes {
  std::array<double, ShellBlock::kLanes> f_x, f_y, f_z, t_x, t_y, t_z;
  std::uint32_t pushing;  ///< one bit a lane
};

/// The ways from a point to probes on eight sides of it [m], in B.
struct alignas(64) ProbeSides {
  static constexpr std::size_t kSides = 8;
  std::array<double, kSides> x, y, z;
};

/// What the plane of a probe says where the field bends there too.
inline constexpr double kNoPlane = -std::numeric_limits<double>::infinity();

/// The planes that a field has at probes: what each says at the point [m], and its slope.
struct alignas(64) Planes {
  std::array<double, ProbeSides::kSides> distance, gradient_x, gradient_y, gradient_z;
};

/// Points that may be contacts, side by side in the order of the shell.
struct Candidates {
  static constexpr std::size_t kClusters = 4;  ///< are walked at once
  static constexpr std::size_t kAtOnce = kClusters * Pointshell::kClusterLeaves * Pointshell::kLeafPoints;
  static constexpr std::size_t kMost = kAtOnce + 1024;
  template <typename T>
  using Lanes = std::array<T, kMost + ShellBlock::kLanes>;  ///< whole vectors are written

  alignas(64) Lanes<float> x, y, z;
  Lanes<std::uint32_t> point;
  std::uint32_t count = 0;

  [[nodiscard]] bool hasRoom() const { return count + kAtOnce <= kMost; }
};

/// What culling left out, and its work.
struct Culled {
  float smallest_bound = std::numeric_limits<float>::infinity();  ///< in voxels
  std::uint32_t spheres = 0;
  std::uint32_t points = 0;
};

/// The inner loops of a query, compiled for every instruction set.
///
/// Culling is done in floats and only ever leaves out what is certainly too far. What is left is done in
/// doubles: a lane is a point and does what DistanceField::sample does, in the same order. Nowhere is there a
/// fused multiply-add, so every set of kernels gives the same bits.
///
/// Threads: pure. Real-time.
struct QueryKernels {
  std::string_view isa;  ///< "scalar", "sse4", "avx2", "avx512", or what else a processor has
  /// Which of sixteen clusters may hold a contact, a bit each.
  std::uint32_t (*clusters)(const LaneFrame& frame, const ShellBlock& balls, Culled& culled) noexcept;
  /// The points of up to Candidates::kClusters clusters that may be contacts, appended; there has to be room.
  void (*candidates)(const LaneFrame& frame, const Pointshell& shell, std::span<const std::uint32_t> of,
                     Candidates& candidates, Culled& culled) noexcept;
  /// Sixteen points for each of `out`, which are as many as that takes; so for contacts.
  void (*samples)(const LaneFrame& frame, const PointLanes& points, SampleLanes* out,
                  SampleSums& sums) noexcept;
  void (*contacts)(const LaneFrame& frame, const PointLanes& points, const SampleLanes* samples,
                   ContactLanes* out) noexcept;
  /// `points`: the sixteen lanes' names; `areas`, at least one: what points stand for, those beyond the end
  /// for nothing.
  void (*pushes)(const LaneFrame& frame, const SampleLanes& samples, const ContactLanes& contacts,
                 const std::uint32_t* points, std::span<const float> areas, PushLanes& out) noexcept;
  /// Of each block the lanes that are inside the dilated surface, but where the field's slope is less than a
  /// distance's. Returns how many there are.
  std::uint32_t (*bent)(const LaneFrame& frame, std::span<const SampleLanes> samples,
                        std::uint32_t* lanes) noexcept;
  /// Of probes about a point; `scale`: of the ways to them.
  void (*planes)(const LaneFrame& frame, const ProbeSides& sides, const Vector3& p_BP, double scale,
                 Planes& out) noexcept;
};

/// [m^2] The paper gives no unit for its stiffness; here K [N/m] is felt when 1 cm^2 of skin is inside.
inline constexpr double kReferenceArea = 1e-4;

/// Below this the interpolant's gradient says nothing: the point is near a medial axis (a thin sheet's
/// middle).
inline constexpr double kLeastGradient = 0.3;

/// All that this processor can run: what every such processor has first, the fastest last.
[[nodiscard]] std::span<const QueryKernels> supportedKernels() noexcept;

/// Those that queries use.
[[nodiscard]] const QueryKernels& chosenKernels() noexcept;

/// Makes all later queries of the process use one set of kernels; false: not supported here. For tests,
/// benchmarks and `--isa`; without it the fastest are used. Threads: any, between queries.
bool chooseKernels(std::string_view isa) noexcept;

}  // namespace tenon
