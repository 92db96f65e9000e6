#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>

#include "idl/types/fixed_vector.h"
#include "idl/types/spatial.h"

namespace tenon::collision {

/// A linear spring between a body and a goal pose: a hand's virtual coupling, or the inertia of a free body
/// over one tick (M/dt²).
struct Spring {
  Pose X_WG;                          ///< goal pose of the body's frame
  Vector3 p_BC = Vector3::Zero();     ///< [m] attachment point C, in B; the spring's moment is about C
  double stiffness = 0.0;             ///< [N/m]
  double rotational_stiffness = 0.0;  ///< [Nm/rad] isotropic part
  /// [Nm/rad] added to `rotational_stiffness`: of a free body its inertia tensor over the tick squared. Zero
  /// for a hand.
  Matrix3 rotational_tensor_W = Matrix3::Zero();
};

/// Overshoot damping: along a direction in which the last SQP step overshot, the energy's curvature is raised
/// to (1 + factor) times its value (secant estimate). It stands for the curvature of the contact surfaces,
/// which linear constraints do not contain.
struct DirectionalStiffening {
  Displacement direction_W;  ///< [m, rad] the step that overshot
  double factor = 0.0;       ///< [-] added curvature, relative to that of the springs in this direction
};

/// Second-order term of an active contact's gap: the other surface is concave at the contact, so the normal
/// force turns against a displacement along it as the force of a spring would.
struct ContactCurvature {
  /// [-, m] displacement of the contact along the principal direction, per displacement of the body
  Displacement jacobian_W;
  double stiffness = 0.0;  ///< [N/m] normal force times principal curvature
};

/// Capacities of a body's lists. Further springs are refused by push_back. Further stiffenings and curvatures
/// are skipped without a report: the body's steps are then less damped, its constraints are the same.
inline constexpr std::size_t kMaxSprings = 4;
inline constexpr std::size_t kMaxStiffenings = 4;
inline constexpr std::size_t kMaxCurvatures = 12;

/// [m] Convergence tolerance of a body in contact. Interpolated fields are piecewise smooth: as a body moves,
/// gaps change by jumps of about 1.5 um at cell borders, and smaller steps only follow those.
inline constexpr double kSettleTolerance = 2e-6;

/// A body that the solver may move.
struct MovableBody {
  Pose X_WB;
  /// at least one with a stiffness above 0, so that the QP is strictly convex
  FixedVector<Spring, kMaxSprings> springs;
  /// [m] its centre Q, in B: that of its bounding sphere. Displacements, and so the solver's steps, caps and
  /// tolerances, are those of Q and do not depend on where the origin is.
  Vector3 p_BQ = Vector3::Zero();
  double radius = 0.1;                  ///< [m] bound on the distance of its points from Q
  double tolerance = kSettleTolerance;  ///< [m] in contact and with a smaller step, it has converged
  /// [m] no point is displaced by more in one IslandSolver::solve
  double max_displacement = std::numeric_limits<double>::infinity();
  bool pinned = false;  ///< has used up `max_displacement`; set by IslandSolver
  FixedVector<DirectionalStiffening, kMaxStiffenings> stiffenings;  ///< set and cleared by IslandSolver
  FixedVector<ContactCurvature, kMaxCurvatures> curvatures;         ///< set and cleared by IslandSolver
  Wrench
      friction_Bq_W;  ///< [N, Nm] about Q, of its sliding friction patches; set and cleared by IslandSolver

  [[nodiscard]] Vector3 p_WQ() const { return X_WB * p_BQ; }  ///< [m]
};

/// One row of the QP: gap + n_W · (u_A - u_B) >= 0, with u_A, u_B [m] the displacements of the two bodies'
/// points at p_WP. A body index of kStatic does not move.
struct ContactConstraint {
  static constexpr std::int32_t kStatic = -1;
  std::int32_t body_a = kStatic;
  std::int32_t body_b = kStatic;
  Vector3 n_W = Vector3::Zero();   ///< [-] unit normal from B to A; of a friction row a tangent
  Vector3 p_WP = Vector3::Zero();  ///< [m]
  double gap = 0.0;                ///< [m] < 0: overlap, which the solution removes
};

struct MotionResult {
  std::uint32_t iterations = 0;  ///< of the active-set method
  /// The constraints contradict each other, or the iterations ran out (64 + 30 per body). Negative gaps were
  /// then raised to 0 (bodies are not pushed apart, and sink no deeper) and the QP was solved again. If that
  /// failed too, all displacements and multipliers are 0.
  bool infeasible = false;
};

/// The quadratic programme of one contact island at one iterate: minimises over the displacements of all
/// bodies the energy of their springs, subject to the linearised gaps (Gauss' principle of least constraint,
/// as in Ortega et al. 2007, for poses instead of accelerations). Strictly convex; solved by a dual
/// active-set method (Goldfarb and Idnani 1983): exact, with a bounded number of iterations. Of each block of
/// neighbouring rows only the most violated one is a candidate, so hundreds of redundant rows may be given.
/// Rows of a warm start are activated together, by one factorisation.
///
/// Keeps its work space, sized at construction; the active set stays for the next call.
///
/// Threads: one at a time. Real-time: solve.
class MotionSolver {
 public:
  MotionSolver(std::size_t max_bodies, std::size_t max_rows);
  ~MotionSolver();
  MotionSolver(MotionSolver&&) noexcept;
  MotionSolver& operator=(MotionSolver&&) noexcept;

  /// `displacements`[i] [m, rad]: of bodies[i]'s centre Q and its orientation, in W. `multipliers` [N], >= 0,
  /// by row: force along rows[r].n_W on its body A, and the opposite on B. Both spans are as long as bodies
  /// and rows; `multipliers` may be empty.
  ///
  /// `warm_start`: rows to activate first, with the forces that stand in `multipliers` at the call as initial
  /// multipliers. The solution does not depend on it, only the number of iterations. `unchanged`: so many
  /// leading rows, and all poses, are those of the last call. `excluded`: rows to ignore in this call.
  ///
  /// If the constraints are infeasible or the iterations run out: see MotionResult::infeasible.
  MotionResult solve(std::span<const MovableBody> bodies, std::span<const ContactConstraint> rows,
                     std::span<Displacement> displacements, std::span<double> multipliers,
                     std::span<const std::uint32_t> warm_start = {}, std::size_t unchanged = 0,
                     std::span<const std::uint32_t> excluded = {}) noexcept;
  /// The active set of the last solve (rows that hold with equality), in no order.
  [[nodiscard]] std::span<const std::uint32_t> activeRows() const noexcept;

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

/// [Nm] Torque of a spring whose body is `turn_W` [rad] (rotation vector) away from its goal orientation.
[[nodiscard]] inline Vector3 springTorque(const Spring& spring, const Vector3& turn_W) {
  return spring.rotational_stiffness * turn_W + spring.rotational_tensor_W * turn_W;
}

/// [J] Energy stored in a spring.
[[nodiscard]] double springEnergy(const Spring& spring, const Pose& X_WB) noexcept;

/// [N, Nm] Wrench of a spring on its body B, about B's origin, in W; its negative is rendered to the hand.
[[nodiscard]] Wrench springWrench(const Spring& spring, const Pose& X_WB) noexcept;

}  // namespace tenon::collision
