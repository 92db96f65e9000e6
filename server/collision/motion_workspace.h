#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/collision/active_set.h"
#include "server/collision/motion_solver.h"

namespace tenon::collision {

/// The six coordinates of one body in `all` [any unit], a vector of all bodies.
inline Eigen::Map<Vector6> segment(std::vector<double>& all, std::size_t body) {
  return Eigen::Map<Vector6>(&all[6 * body]);
}

/// State of the dual active-set method. It works in the coordinates y = Lᵀ x of each body, where H = L Lᵀ is
/// the Hessian and x the displacement (translation, rotation): there the energy is ½|y - y0|² up to a
/// constant. Slacks of all rows are evaluated in x, from columns of numbers, since rows need no
/// transformation there.
///
/// Threads: one at a time. Real-time: everything but construction.
struct MotionSolver::Workspace {
  /// Rows that are neighbours in the list are neighbours in space: of so many only the most violated is a
  /// candidate.
  static constexpr std::size_t kBlock = 16;

  enum class RowState : std::uint8_t { kInactive, kActive, kExcluded };

  /// Consecutive rows [first, first + count) between the same two bodies.
  struct Run {
    std::size_t first = 0, count = 0;
    std::array<std::int32_t, 2> body{};
  };

  Workspace(std::size_t max_bodies, std::size_t max_rows)
      : active(6 * max_bodies),
        L(max_bodies),
        state(max_rows),
        requested(max_rows),
        body_of(max_rows),
        y0(6 * max_bodies),
        y(6 * max_bodies),
        x(6 * max_bodies),
        u(6 * max_bodies + 1),
        multiplier_step(6 * max_bodies) {
    for (std::vector<double>& column : columns) column.resize(max_rows + kBlock);
    runs.reserve(max_rows);
    candidates.reserve(max_rows);
  }

  /// Sets L and y0 of a body from its springs, friction, curvatures and stiffenings.
  void setBody(std::size_t i, const MovableBody& body);
  /// Copies the rows from `unchanged` on into the columns.
  void setRows(std::span<const ContactConstraint> rows, std::span<const MovableBody> island,
               std::size_t unchanged);
  /// Solves the QP. False: the rows are infeasible, or the iterations ran out. `reuse`: the active set of the
  /// last call may be kept, as most rows are the same. `forces` [N]: initial multipliers by row, or empty.
  bool solve(std::span<const std::uint32_t> warm_start, std::span<const double> forces,
             std::span<const std::uint32_t> excluded, bool reuse);
  /// x from y.
  void updateDisplacements();
  /// [m] gap of a row after the displacements x.
  [[nodiscard]] double slackOf(std::size_t row) const;
  /// Sets `candidates`: the most violated inactive row of each block that has one.
  void findCandidates();
  /// The most violated inactive row of [first, end), a block of a run whose displacements are `m` [m, rad]:
  /// A's translation less B's, A's rotation, minus B's. row_count when none is violated.
  [[nodiscard]] std::uint32_t worstOfBlock(std::size_t first, std::size_t end, const Run& run,
                                           const std::array<double, 9>& m) const;
  /// The most violated of the inactive candidates; row_count when none is violated.
  [[nodiscard]] std::size_t mostViolatedCandidate() const;
  /// A row's normal in the coordinates y.
  [[nodiscard]] RowNormal normalOf(std::size_t row) const;
  /// Keeps of the active rows those that are in `warm_start`, not in `excluded`, and whose normals are
  /// unchanged to the last bit.
  void retainActive(std::span<const std::uint32_t> warm_start, std::span<const std::uint32_t> excluded);
  /// Activates a row with an initial multiplier of `force` [N]; that it holds with equality is left to
  /// ascendDual. False: it is active or excluded already, always holds, or depends on the active rows.
  bool warmStart(std::uint32_t row, double force);
  /// Moves from any multipliers >= 0 to those with which all active rows hold with equality; rows whose
  /// multiplier would become negative are deactivated on the way. The dual objective grows with every step.
  /// False: the iterations ran out.
  bool ascendDual();
  /// Activates candidates, the most violated first, until all hold. False as with activate.
  bool activateCandidates();
  /// Adds row `p` to the active set, and removes those whose multipliers vanish (Goldfarb and Idnani 1983).
  /// False: infeasible, or the iterations ran out.
  bool activate(std::size_t p);
  void dropActive(std::size_t position);

  ActiveSet active;
  std::vector<Matrix6> L;  ///< Cholesky factor of the Hessian, by body
  /// [m] gap; [-] normal; [m] its moment about A's centre, about B's; in W
  std::array<std::vector<double>, 10> columns;
  std::vector<RowState> state;
  std::vector<std::uint8_t> requested;  ///< row is in the warm start; all zero between uses
  std::vector<std::array<std::int32_t, 2>> body_of;
  std::vector<Run> runs;
  std::vector<std::uint32_t> candidates;
  std::vector<double> y0, y;               ///< [sqrt Nm] unconstrained minimum, iterate
  std::vector<double> x;                   ///< [m, rad] iterate as displacements
  std::vector<double> u, multiplier_step;  ///< [N] in the order of `active`
  std::size_t bodies = 0;
  std::size_t row_count = 0;
  bool gaps_clamped = false;  ///< negative gaps were raised to zero
  std::uint32_t iterations = 0;
  std::uint32_t iteration_limit = 0;
};

}  // namespace tenon::collision
