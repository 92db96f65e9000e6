#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>

#include "idl/types/fixed_vector.h"
#include "idl/types/spatial.h"

namespace tenon {

/// A pull on a body towards a goal pose: a hand's coupling, or the inertia of a free body.
struct Spring {
  Pose X_WG;                          ///< where it wants the body's frame to be
  Vector3 p_BC = Vector3::Zero();     ///< the point of the body it holds; moments are about it
  double stiffness = 0.0;             ///< [N/m]
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
  /// [Nm/rad] what depends on the axis: an inertia tensor over the tick squared. Zero for a hand.
  Matrix3 rotational_tensor_W = Matrix3::Zero();
};

/// A direction along which a body had overshot: its energy is taken to be `share` times steeper there. This
/// is how the curvature of the other surface, which the rows cannot tell, gets into the problem.
struct Brake {
  Displacement along_W;
  double share = 0.0;
};

/// The other surface curves round a contact of the body: moving along costs as much as a spring would, since
/// the force there turns against it. Second-order part of a gap, which a row cannot tell.
struct Curve {
  Displacement per_motion_W;  ///< [-, m] what a motion of the body moves the contact along the curve
  double stiffness = 0.0;     ///< [N/m] force over the curve's radius
};

inline constexpr std::size_t kMaxSprings = 4;
inline constexpr std::size_t kMaxBrakes = 4;
inline constexpr std::size_t kMaxCurves = 12;

/// [m] A body that others hold back has arrived earlier: what is left is the field's steps of 1.5 um, which
/// change under every point as it goes.
inline constexpr double kSettled = 2e-6;

/// A body that the solver may move.
struct MovableBody {
  Pose X_WB;
  FixedVector<Spring, kMaxSprings> springs;  ///< at least one with a stiffness
  double radius = 0.1;                       ///< [m] of the body about its origin: no point is farther
  double settled = kSettled;  ///< [m] having less than this to go, a body in contact has arrived
  double reach = std::numeric_limits<double>::infinity();  ///< [m] no point goes farther in one solve
  bool pinned = false;                                     ///< has gone that far; set by IslandSolver
  FixedVector<Brake, kMaxBrakes> brakes;                   ///< set and cleared by IslandSolver
  FixedVector<Curve, kMaxCurves> curves;                   ///< likewise
  Wrench drag_Bo_W;                                        ///< of what the body slides on; likewise
};

/// gap + n · (motion of A's point - motion of B's point) >= 0. A body index of kStatic does not move.
struct GapRow {
  static constexpr std::int32_t kStatic = -1;
  std::int32_t body_a = kStatic;
  std::int32_t body_b = kStatic;
  Vector3 n_W = Vector3::Zero();
  Vector3 p_WP = Vector3::Zero();
  double gap = 0.0;
};

struct MotionResult {
  std::uint32_t iterations = 0;
  bool conflicting =
      false;  ///< the gaps could not all be kept: pushing out was given up, nothing sinks deeper
};

/// The contact-island problem of one instant: minimise over all bodies the energy of their springs subject to
/// the gaps (Gauss' principle of least constraint, as in Ortega et al. 2007, for positions). A strictly
/// convex quadratic programme, solved by a dual active-set method (Goldfarb and Idnani 1983): exact, bounded
/// iterations, and picking the most violated of the rows' neighbourhoods at every step, so hundreds of rows
/// may be offered without reducing them. What held before is taken over in one go.
///
/// Keeps its work space, sized at construction. Threads: one at a time. Real-time: solve.
class MotionSolver {
 public:
  MotionSolver(std::size_t max_bodies, std::size_t max_rows);
  ~MotionSolver();
  MotionSolver(MotionSolver&&) noexcept;
  MotionSolver& operator=(MotionSolver&&) noexcept;

  /// motions[i]: displacement of bodies[i]'s origin and its rotation, in W. multipliers[r] >= 0: force [N]
  /// along rows[r].n_W on its body A (and the opposite on B). Both spans are as long as bodies and rows, or
  /// nobody asks for multipliers.
  /// `first`: rows to try first, such as those that held in a problem like this one, with forces like those
  /// that stand in `multipliers`; the motions do not depend on it. `unchanged`: so many of the rows, and all
  /// poses, are those of the last call. `left_out`: rows that count for nothing this time.
  MotionResult solve(std::span<const MovableBody> bodies, std::span<const GapRow> rows,
                     std::span<Displacement> motions, std::span<double> multipliers,
                     std::span<const std::uint32_t> first = {}, std::size_t unchanged = 0,
                     std::span<const std::uint32_t> left_out = {}) noexcept;
  /// Rows that hold with equality since the last solve, in no order.
  [[nodiscard]] std::span<const std::uint32_t> held() const noexcept;

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

/// [Nm] of a spring whose body still has `turn_W` to turn.
[[nodiscard]] inline Vector3 springTorque(const Spring& spring, const Vector3& turn_W) {
  return spring.rotational_stiffness * turn_W + spring.rotational_tensor_W * turn_W;
}

/// [J] stored in a spring.
[[nodiscard]] double springEnergy(const Spring& spring, const Pose& X_WB) noexcept;

/// The wrench of a spring on its body B, about B's origin, in W; minus that is what the hand feels.
[[nodiscard]] Wrench springWrench(const Spring& spring, const Pose& X_WB) noexcept;

}  // namespace tenon
