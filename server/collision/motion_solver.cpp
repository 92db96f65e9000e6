#include "server/collision/motion_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "server/collision/motion_workspace.h"

namespace tenon::collision {

void MotionSolver::Workspace::dropActive(std::size_t position) {
  state[active.row(position)] = RowState::kInactive;
  const std::size_t count = active.size();
  active.drop(position);
  // the multiplier of the row that is being activated stands behind those of the active ones
  for (std::size_t k = position; k < count; ++k) u[k] = u[k + 1];
}

RowNormal MotionSolver::Workspace::normalOf(std::size_t row) const {
  RowNormal normal;
  normal.body = body_of[row];
  for (std::size_t side = 0; side < 2; ++side) {
    if (normal.body[side] == ContactConstraint::kStatic) continue;
    const std::size_t moment = 4 + 3 * side;
    Vector6 c;
    c << columns[1][row], columns[2][row], columns[3][row], columns[moment][row], columns[moment + 1][row],
        columns[moment + 2][row];
    normal.part[side] = L[static_cast<std::size_t>(normal.body[side])].triangularView<Eigen::Lower>().solve(
        side == 0 ? c : Vector6(-c));
  }
  return normal;
}

bool MotionSolver::Workspace::activate(std::size_t p) {
  const RowNormal normal = normalOf(p);
  u[active.size()] = 0.0;

  while (++iterations <= iteration_limit) {
    active.project(normal);
    const std::span<const double> r = active.coordinates();
    // dual step length: until the multiplier of an active row vanishes
    const std::size_t q = active.size();
    double dual_step = std::numeric_limits<double>::infinity();
    std::size_t vanishing = q;
    for (std::size_t k = 0; k < q; ++k) {
      if (r[k] > 0.0 && u[k] / r[k] < dual_step) {
        dual_step = u[k] / r[k];
        vanishing = k;
      }
    }
    // primal step length: until row p holds with equality
    const bool dependent = active.dependent();
    const double slack = columns[0][p] + normal.dot(y);
    const double primal_step =
        dependent ? std::numeric_limits<double>::infinity() : std::max(-slack, 0.0) / active.freeNorm2();
    if (dependent && vanishing == q) return false;

    const double t = std::min(dual_step, primal_step);
    for (std::size_t k = 0; k < q; ++k) u[k] = std::max(u[k] - t * r[k], 0.0);
    u[q] += t;
    if (!dependent) {
      const std::span<const double> direction = active.direction();
      for (std::size_t i = 0; i < direction.size(); ++i) y[i] += t * direction[i];
    }
    if (primal_step <= dual_step) {
      active.add(static_cast<std::uint32_t>(p));
      state[p] = RowState::kActive;
      return true;
    }
    dropActive(vanishing);
  }
  return false;
}

void MotionSolver::Workspace::retainActive(std::span<const std::uint32_t> warm_start,
                                           std::span<const std::uint32_t> excluded) {
  for (const std::uint32_t row : warm_start) requested[row] = 1;
  for (const std::uint32_t row : excluded) requested[row] = 0;
  std::size_t retained = 0;
  for (std::size_t k = 0; k < active.size(); ++k) {
    const std::uint32_t row = active.row(k);
    const bool stays = requested[row] != 0 && normalOf(row) == active.normal(k);
    requested[row] = stays ? 1 : 0;
    retained += stays ? 1 : 0;
  }
  // dropping a row costs as much as adding a few
  if (4 * retained < 3 * active.size()) active.reset(6 * bodies);
  for (std::size_t k = active.size(); k-- > 0;) {
    if (requested[active.row(k)] == 0) dropActive(k);
  }
  for (std::size_t k = 0; k < active.size(); ++k) state[active.row(k)] = RowState::kActive;
  for (const std::uint32_t row : warm_start) requested[row] = 0;
  for (const std::uint32_t row : excluded) state[row] = RowState::kExcluded;
}

bool MotionSolver::Workspace::warmStart(std::uint32_t row, double force) {
  if (state[row] != RowState::kInactive || !std::isfinite(columns[0][row])) return false;
  if (!active.append(row, normalOf(row))) return false;
  state[row] = RowState::kActive;
  u[active.size() - 1] = force;
  return true;
}

bool MotionSolver::Workspace::ascendDual() {
  const std::span<double> all(y.data(), 6 * bodies);
  // two full Newton steps: the second corrects the rounding of the first
  for (int full_steps = 0; full_steps < 2;) {
    const std::size_t q = active.size();
    std::copy_n(y0.begin(), all.size(), y.begin());
    for (std::size_t k = 0; k < q; ++k) active.normal(k).addTo(all, u[k]);
    for (std::size_t k = 0; k < q; ++k) {
      multiplier_step[k] = -columns[0][active.row(k)] - active.normal(k).dot(all);
    }
    active.solve({multiplier_step.data(), q});
    // step fraction up to which all multipliers stay >= 0
    double fraction = 1.0;
    for (std::size_t k = 0; k < q; ++k) {
      if (multiplier_step[k] < 0.0) fraction = std::min(fraction, u[k] / -multiplier_step[k]);
    }
    for (std::size_t k = q; k-- > 0;) {
      active.normal(k).addTo(all, fraction * multiplier_step[k]);
      const bool vanishes =
          fraction < 1.0 && multiplier_step[k] < 0.0 && u[k] / -multiplier_step[k] <= fraction;
      u[k] = std::max(u[k] + fraction * multiplier_step[k], 0.0);
      if (vanishes) dropActive(k);
    }
    full_steps = fraction == 1.0 ? full_steps + 1 : 0;
    if (full_steps == 0 && ++iterations > iteration_limit) return false;
  }
  return true;
}

bool MotionSolver::Workspace::activateCandidates() {
  for (std::size_t p = mostViolatedCandidate(); p < row_count; p = mostViolatedCandidate()) {
    if (!activate(p)) return false;
    updateDisplacements();
  }
  return true;
}

bool MotionSolver::Workspace::solve(std::span<const std::uint32_t> warm_start, std::span<const double> forces,
                                    std::span<const std::uint32_t> excluded, bool reuse) {
  std::copy_n(y0.begin(), 6 * bodies, y.begin());
  std::fill_n(state.begin(), row_count, RowState::kInactive);
  iteration_limit = iterations + static_cast<std::uint32_t>(64 + 30 * bodies);
  if (!reuse || active.variables() != 6 * bodies) active.reset(6 * bodies);
  retainActive(warm_start, excluded);
  for (std::size_t k = 0; k < active.size() && !forces.empty(); ++k) u[k] = forces[active.row(k)];
  for (const std::uint32_t row : warm_start)
    warmStart(row, forces.empty() ? 0.0 : std::max(forces[row], 0.0));
  if (!ascendDual()) return false;
  while (true) {
    updateDisplacements();
    findCandidates();
    const std::uint32_t before = iterations;
    if (!activateCandidates()) return false;
    // no candidate is violated in slackOf's order of summation: feasible up to rounding
    if (iterations == before) return true;
    if (!ascendDual()) return false;
  }
}

MotionSolver::MotionSolver(std::size_t max_bodies, std::size_t max_rows)
    : workspace_(std::make_unique<Workspace>(max_bodies, max_rows)) {}
MotionSolver::~MotionSolver() = default;
MotionSolver::MotionSolver(MotionSolver&&) noexcept = default;
MotionSolver& MotionSolver::operator=(MotionSolver&&) noexcept = default;

MotionResult MotionSolver::solve(std::span<const MovableBody> bodies, std::span<const ContactConstraint> rows,
                                 std::span<Displacement> displacements, std::span<double> multipliers,
                                 std::span<const std::uint32_t> warm_start, std::size_t unchanged,
                                 std::span<const std::uint32_t> excluded) noexcept {
  Workspace& w = *workspace_;
  assert(bodies.size() <= w.L.size() && rows.size() <= w.body_of.size());
  assert(displacements.size() == bodies.size());
  assert(multipliers.empty() || multipliers.size() == rows.size());
  assert(warm_start.size() <= rows.size() && unchanged <= std::min(rows.size(), w.row_count));
  w.bodies = bodies.size();
  w.row_count = rows.size();
  w.iterations = 0;
  w.setRows(rows, bodies, w.gaps_clamped ? 0 : unchanged);
  for (std::size_t i = 0; i < bodies.size(); ++i) w.setBody(i, bodies[i]);

  MotionResult result;
  bool solved = w.solve(warm_start, multipliers, excluded, unchanged > 0);
  if (!solved) {
    // with gaps >= 0 no displacement at all is feasible
    result.infeasible = true;
    w.gaps_clamped = true;
    for (std::size_t i = 0; i < w.row_count; ++i) w.columns[0][i] = std::max(w.columns[0][i], 0.0);
    solved = w.solve({}, {}, excluded, false);
  }
  result.iterations = w.iterations;

  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Vector6 x = solved ? Vector6(segment(w.x, i)) : Vector6(Vector6::Zero());
    displacements[i] = {x.head<3>(), x.tail<3>()};
  }
  std::fill(multipliers.begin(), multipliers.end(), 0.0);
  if (!solved || multipliers.empty()) return result;
  for (std::size_t k = 0; k < w.active.size(); ++k) multipliers[w.active.row(k)] = w.u[k];
  return result;
}

std::span<const std::uint32_t> MotionSolver::activeRows() const noexcept { return workspace_->active.rows(); }

Wrench springWrench(const Spring& spring, const Pose& X_WB) noexcept {
  const Displacement to_goal = displacement(X_WB, spring.X_WG);
  const Vector3 p_BoC_W = X_WB.rotation() * spring.p_BC;
  const Vector3 f_C_W = spring.stiffness * (spring.X_WG * spring.p_BC - X_WB * spring.p_BC);
  return {f_C_W, p_BoC_W.cross(f_C_W) + springTorque(spring, to_goal.rotation)};
}

double springEnergy(const Spring& spring, const Pose& X_WB) noexcept {
  const Vector3 turn_W = displacement(X_WB, spring.X_WG).rotation;
  const double stretch2 = (spring.X_WG * spring.p_BC - X_WB * spring.p_BC).squaredNorm();
  return 0.5 * (spring.stiffness * stretch2 + springTorque(spring, turn_W).dot(turn_W));
}

}  // namespace tenon::collision
