#include "server/collision/motion_solver.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "server/collision/motion_workspace.h"

namespace tenon {
namespace {

/// A row whose free part is smaller than this share of it (squared) depends on the active rows.
constexpr double kDependent = 1e-12;

}  // namespace

void MotionSolver::Workspace::dropActive(std::size_t position) {
  is_active[active.row(position)] = 0;
  const std::size_t count = active.size();
  active.drop(position);
  // the multiplier of the row that is being enforced stands behind those of the active ones
  for (std::size_t k = position; k < count; ++k) u[k] = u[k + 1];
}

bool MotionSolver::Workspace::enforce(std::size_t p) {
  std::fill_n(normal.begin(), 6 * bodies, 0.0);
  double norm2 = 0.0;
  for (std::size_t side = 0; side < 2; ++side) {
    if (body_of[p][side] == GapRow::kStatic) continue;
    const auto body = static_cast<std::size_t>(body_of[p][side]);
    const std::size_t moment = 4 + 3 * side;
    Vector6 c;
    c << columns[1][p], columns[2][p], columns[3][p], columns[moment][p], columns[moment + 1][p],
        columns[moment + 2][p];
    segment(normal, body) = L[body].triangularView<Eigen::Lower>().solve(side == 0 ? c : Vector6(-c));
    norm2 += segment(normal, body).squaredNorm();
  }
  u[active.size()] = 0.0;

  while (++iterations <= iteration_limit) {
    active.project(normal);
    active.coordinates(r);
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
    const double free2 = active.freePart2();
    const bool dependent = q == 6 * bodies || free2 <= kDependent * norm2;
    const double primal_step =
        dependent ? std::numeric_limits<double>::infinity() : std::max(-slackOf(p), 0.0) / free2;
    if (dependent && vanishing == q) return false;

    const double t = std::min(dual_step, primal_step);
    for (std::size_t k = 0; k < q; ++k) u[k] = std::max(u[k] - t * r[k], 0.0);
    u[q] += t;
    if (!dependent) {
      active.direction(step);
      for (std::size_t i = 0; i < 6 * bodies; ++i) y[i] += t * step[i];
      updateMotions();
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

bool MotionSolver::Workspace::enforceTried() {
  for (std::size_t p = mostViolatedOfTried(); p < row_count; p = mostViolatedOfTried()) {
    if (!enforce(p)) return false;
  }
  return true;
}

bool MotionSolver::Workspace::run(std::span<const std::uint32_t> first) {
  active.reset(6 * bodies);
  std::copy_n(y0.begin(), 6 * bodies, y.begin());
  updateMotions();
  std::fill_n(is_active.begin(), row_count, std::uint8_t{0});
  iteration_limit = iterations + static_cast<std::uint32_t>(64 + 30 * bodies);
  tried.assign(first.begin(), first.end());
  if (!enforceTried()) return false;
  while (true) {
    findViolated();
    const std::uint32_t before = iterations;
    if (!enforceTried()) return false;
    // what only rounding finds violated counts as kept
    if (iterations == before) return true;
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
