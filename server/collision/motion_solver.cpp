#include "server/collision/motion_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "server/collision/motion_workspace.h"

namespace tenon {

void MotionSolver::Workspace::dropActive(std::size_t position) {
  is_active[active.row(position)] = 0;
  const std::size_t count = active.size();
  active.drop(position);
  // the multiplier of the row that is being enforced stands behind those of the active ones
  for (std::size_t k = position; k < count; ++k) u[k] = u[k + 1];
}

RowNormal MotionSolver::Workspace::normalOf(std::size_t row) const {
  RowNormal normal;
  normal.body = body_of[row];
  for (std::size_t side = 0; side < 2; ++side) {
    if (normal.body[side] == GapRow::kStatic) continue;
    const std::size_t moment = 4 + 3 * side;
    Vector6 c;
    c << columns[1][row], columns[2][row], columns[3][row], columns[moment][row], columns[moment + 1][row],
        columns[moment + 2][row];
    normal.part[side] = L[static_cast<std::size_t>(normal.body[side])].triangularView<Eigen::Lower>().solve(
        side == 0 ? c : Vector6(-c));
  }
  return normal;
}

bool MotionSolver::Workspace::enforce(std::size_t p) {
  const RowNormal normal = normalOf(p);
  u[active.size()] = 0.0;

  while (++iterations <= iteration_limit) {
    active.project(normal);
    const std::span<const double> r = active.coordinates();
    // how far until the multiplier of an active row vanishes
    const std::size_t q = active.size();
    double dual_step = std::numeric_limits<double>::infinity();
    std::size_t vanishing = q;
    for (std::size_t k = 0; k < q; ++k) {
      if (r[k] > 0.0 && u[k] / r[k] < dual_step) {
        dual_step = u[k] / r[k];
        vanishing = k;
      }
    }
    // how far until the row holds
    const bool dependent = active.dependent();
    const double slack = columns[0][p] + normal.dot(y);
    const double primal_step =
        dependent ? std::numeric_limits<double>::infinity() : std::max(-slack, 0.0) / active.freePart2();
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
      is_active[p] = 1;
      return true;
    }
    dropActive(vanishing);
  }
  return false;
}

void MotionSolver::Workspace::takeAll(std::span<const std::uint32_t> first) {
  for (const std::uint32_t row : first) {
    if (!std::isfinite(columns[0][row]) || is_active[row] != 0 || !active.append(row, normalOf(row)))
      continue;
    is_active[row] = 1;
    u[active.size() - 1] = 0.0;
  }
  if (active.size() == 0) return;
  while (!settle()) ++iterations;
  // for the digits that the first time has lost
  while (!settle()) ++iterations;
}

bool MotionSolver::Workspace::settle() {
  const std::span<double> all(y.data(), 6 * bodies);
  std::copy_n(y0.begin(), all.size(), y.begin());
  const std::size_t q = active.size();
  for (std::size_t k = 0; k < q; ++k) active.normal(k).addTo(all, u[k]);
  for (std::size_t k = 0; k < q; ++k) {
    correction[k] = -columns[0][active.row(k)] - active.normal(k).dot(all);
  }
  active.solve({correction.data(), q});
  for (std::size_t k = 0; k < q; ++k) {
    u[k] += correction[k];
    active.normal(k).addTo(all, correction[k]);
  }
  for (std::size_t k = q; k-- > 0;) {
    if (u[k] < 0.0) dropActive(k);
  }
  return active.size() == q;
}

bool MotionSolver::Workspace::enforceTried() {
  for (std::size_t p = mostViolatedOfTried(); p < row_count; p = mostViolatedOfTried()) {
    if (!enforce(p)) return false;
    updateMotions();
  }
  return true;
}

bool MotionSolver::Workspace::run(std::span<const std::uint32_t> first) {
  active.reset(6 * bodies);
  std::copy_n(y0.begin(), 6 * bodies, y.begin());
  updateMotions();
  std::fill_n(is_active.begin(), row_count, std::uint8_t{0});
  iteration_limit = iterations + static_cast<std::uint32_t>(64 + 30 * bodies);
  takeAll(first);
  while (true) {
    updateMotions();
    findViolated();
    const std::uint32_t before = iterations;
    if (!enforceTried()) return false;
    // what only rounding finds violated counts as kept
    if (iterations == before) return true;
    while (!settle()) {
    }
  }
}

MotionSolver::MotionSolver(std::size_t max_bodies, std::size_t max_rows)
    : workspace_(std::make_unique<Workspace>(max_bodies, max_rows)) {}
MotionSolver::~MotionSolver() = default;
MotionSolver::MotionSolver(MotionSolver&&) noexcept = default;
MotionSolver& MotionSolver::operator=(MotionSolver&&) noexcept = default;

MotionResult MotionSolver::solve(std::span<const MovableBody> bodies, std::span<const GapRow> rows,
                                 std::span<Displacement> motions, std::span<double> multipliers,
                                 std::span<const std::uint32_t> first, std::size_t unchanged) noexcept {
  Workspace& w = *workspace_;
  assert(bodies.size() <= w.L.size() && rows.size() <= w.body_of.size());
  assert(motions.size() == bodies.size() && multipliers.size() == rows.size());
  assert(first.size() <= rows.size() && unchanged <= std::min(rows.size(), w.row_count));
  w.bodies = bodies.size();
  w.row_count = rows.size();
  w.iterations = 0;
  w.setRows(rows, bodies, w.clipped ? 0 : unchanged);
  for (std::size_t i = 0; i < bodies.size(); ++i) w.setBody(i, bodies[i]);

  MotionResult result;
  bool solved = w.run(first);
  if (!solved) {
    // standing still is always admissible then
    result.conflicting = true;
    w.clipped = true;
    for (std::size_t i = 0; i < w.row_count; ++i) w.columns[0][i] = std::max(w.columns[0][i], 0.0);
    solved = w.run({});
  }
  result.iterations = w.iterations;

  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Vector6 x = solved ? Vector6(segment(w.x, i)) : Vector6(Vector6::Zero());
    motions[i] = {x.head<3>(), x.tail<3>()};
  }
  std::fill(multipliers.begin(), multipliers.end(), 0.0);
  for (std::size_t k = 0; solved && k < w.active.size(); ++k) multipliers[w.active.row(k)] = w.u[k];
  return result;
}

Wrench springWrench(const Spring& spring, const Pose& X_WB) noexcept {
  const Displacement toGoal = displacement(X_WB, spring.X_WG);
  const Vector3 p_BoC_W = X_WB.rotation() * spring.p_BC;
  const Vector3 f_C_W = spring.stiffness * (spring.X_WG * spring.p_BC - X_WB * spring.p_BC);
  return {f_C_W, p_BoC_W.cross(f_C_W) + springTorque(spring, toGoal.rotation)};
}

double springEnergy(const Spring& spring, const Pose& X_WB) noexcept {
  const Vector3 turn_W = displacement(X_WB, spring.X_WG).rotation;
  const double stretch2 = (spring.X_WG * spring.p_BC - X_WB * spring.p_BC).squaredNorm();
  return 0.5 * (spring.stiffness * stretch2 + springTorque(spring, turn_W).dot(turn_W));
}

}  // namespace tenon
