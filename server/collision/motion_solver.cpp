#include "server/collision/motion_solver.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

#include "server/collision/active_set.h"

namespace tenon {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// [m] A gap kept to this is kept: far below what a field can say, far above rounding.
constexpr double kGapTolerance = 1e-11;

/// A row whose free part is smaller than this share of it (squared) depends on the active rows.
constexpr double kDependent = 1e-12;

/// A body that a spring holds at a point may still turn: this share of what its stiffness would be worth at
/// the body's radius makes the answer unique, and is too weak to be felt.
constexpr double kLeastRotation = 1e-6;

/// The part of a long vector that belongs to a body.
Eigen::Map<Vector6> segment(std::vector<double>& all, std::size_t body) {
  return Eigen::Map<Vector6>(&all[6 * body]);
}

/// A spring seen from the body's pose, to first order: its energy is ½ xᵀ H x - bᵀ x, x = (translation,
/// rotation).
void addSpring(const Spring& spring, const Pose& X_WB, Matrix6& H, Vector6& b) {
  const Displacement toGoal = displacement(X_WB, spring.X_WG);
  const Vector3 p_BoC_W = X_WB.rotation() * spring.p_BC;
  const Vector3 p_CoGc_W = spring.X_WG * spring.p_BC - X_WB * spring.p_BC;
  Eigen::Matrix<double, 3, 6> J;  // motion of C
  J << Matrix3::Identity(), Matrix3{{0.0, p_BoC_W.z(), -p_BoC_W.y()},
                                    {-p_BoC_W.z(), 0.0, p_BoC_W.x()},
                                    {p_BoC_W.y(), -p_BoC_W.x(), 0.0}};
  H += spring.stiffness * (J.transpose() * J);
  H.bottomRightCorner<3, 3>() += spring.rotational_stiffness * Matrix3::Identity();
  b += spring.stiffness * (J.transpose() * p_CoGc_W);
  b.tail<3>() += spring.rotational_stiffness * toGoal.rotation;
}

}  // namespace

/// Works in coordinates y = Lᵀ x of every body (H = L Lᵀ), where the energy is ½|y - y0|².
struct MotionSolver::Workspace {
  struct Row {
    std::array<std::int32_t, 2> body;  ///< index, or kStatic
    std::array<Vector6, 2> normal;     ///< in y of that body
    double norm2 = 0.0;                ///< [1/N m] 0: moves nobody
    double gap = 0.0;
    bool active = false;
  };

  Workspace(std::size_t max_bodies, std::size_t max_rows)
      : active(6 * max_bodies),
        L(max_bodies),
        rows(max_rows),
        y0(6 * max_bodies),
        y(6 * max_bodies),
        normal(6 * max_bodies),
        step(6 * max_bodies),
        r(6 * max_bodies),
        u(6 * max_bodies + 1) {}

  void setBody(std::size_t i, const MovableBody& body);
  void setRow(std::size_t r, const GapRow& row, std::span<const MovableBody> bodies);
  /// False: the rows contradict each other, or the iterations have run out.
  bool run(bool push_out);
  [[nodiscard]] double slack(const Row& row, bool push_out) const;
  [[nodiscard]] std::size_t mostViolated(bool push_out) const;
  bool enforce(std::size_t p, bool push_out);
  void dropActive(std::size_t position);

  ActiveSet active;
  std::vector<Matrix6> L;
  std::vector<Row> rows;
  std::vector<double> y0, y, normal, step, r, u;  // u: multipliers in the order of `active`
  std::size_t bodies = 0;
  std::size_t row_count = 0;
  std::uint32_t iterations = 0;
  std::uint32_t iteration_limit = 0;
};

void MotionSolver::Workspace::setBody(std::size_t i, const MovableBody& body) {
  Matrix6 H = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  double stiffness = 0.0;
  for (const Spring& spring : body.springs) {
    addSpring(spring, body.X_WB, H, b);
    stiffness += spring.stiffness;
  }
  H.bottomRightCorner<3, 3>() +=
      (kLeastRotation * stiffness * body.radius * body.radius) * Matrix3::Identity();
  for (const Brake& brake : body.brakes) {
    Vector6 along;
    along << brake.along_W.translation, brake.along_W.rotation;
    const Vector6 steep = H * along;
    const double energy2 = along.dot(steep);
    if (energy2 > 0.0) H += (brake.share / energy2) * (steep * steep.transpose());
  }
  L[i] = H.llt().matrixL();
  segment(y0, i) = L[i].triangularView<Eigen::Lower>().solve(b);
}

void MotionSolver::Workspace::setRow(std::size_t index, const GapRow& row,
                                     std::span<const MovableBody> island) {
  Row& out = rows[index];
  out = {{row.body_a, row.body_b}, {Vector6::Zero(), Vector6::Zero()}, 0.0, row.gap, false};
  if (row.body_a == row.body_b) return;
  for (std::size_t side = 0; side < 2; ++side) {
    if (out.body[side] == GapRow::kStatic) continue;
    const auto body = static_cast<std::size_t>(out.body[side]);
    assert(body < island.size());
    Vector6 c;
    c << row.n_W, (row.p_WP - island[body].X_WB.translation()).cross(row.n_W);
    out.normal[side] = L[body].triangularView<Eigen::Lower>().solve(side == 0 ? c : Vector6(-c));
    out.norm2 += out.normal[side].squaredNorm();
  }
}

double MotionSolver::Workspace::slack(const Row& row, bool push_out) const {
  double sum = push_out ? row.gap : std::max(row.gap, 0.0);
  for (std::size_t side = 0; side < 2; ++side) {
    if (row.body[side] == GapRow::kStatic) continue;
    sum += row.normal[side].dot(Eigen::Map<const Vector6>(&y[6 * static_cast<std::size_t>(row.body[side])]));
  }
  return sum;
}

std::size_t MotionSolver::Workspace::mostViolated(bool push_out) const {
  std::size_t worst = row_count;
  double least = -kGapTolerance;
  for (std::size_t i = 0; i < row_count; ++i) {
    if (rows[i].active || rows[i].norm2 == 0.0) continue;
    const double s = slack(rows[i], push_out);
    if (s < least) {
      least = s;
      worst = i;
    }
  }
  return worst;
}

void MotionSolver::Workspace::dropActive(std::size_t position) {
  rows[active.row(position)].active = false;
  const std::size_t count = active.size();
  active.drop(position);
  // the multiplier of the row that is being enforced stands behind those of the active ones
  for (std::size_t k = position; k < count; ++k) u[k] = u[k + 1];
}

bool MotionSolver::Workspace::enforce(std::size_t p, bool push_out) {
  const Row& row = rows[p];
  std::fill_n(normal.begin(), 6 * bodies, 0.0);
  for (std::size_t side = 0; side < 2; ++side) {
    if (row.body[side] == GapRow::kStatic) continue;
    segment(normal, static_cast<std::size_t>(row.body[side])) = row.normal[side];
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
    const bool dependent = q == 6 * bodies || free2 <= kDependent * row.norm2;
    const double primal_step =
        dependent ? std::numeric_limits<double>::infinity() : std::max(-slack(row, push_out), 0.0) / free2;
    if (dependent && vanishing == q) return false;

    const double t = std::min(dual_step, primal_step);
    for (std::size_t k = 0; k < q; ++k) u[k] = std::max(u[k] - t * r[k], 0.0);
    u[q] += t;
    if (!dependent) {
      active.direction(step);
      for (std::size_t i = 0; i < 6 * bodies; ++i) y[i] += t * step[i];
    }
    if (primal_step <= dual_step) {
      active.add(static_cast<std::uint32_t>(p));
      rows[p].active = true;
      return true;
    }
    dropActive(vanishing);
  }
  return false;
}

bool MotionSolver::Workspace::run(bool push_out) {
  active.reset(6 * bodies);
  std::copy_n(y0.begin(), 6 * bodies, y.begin());
  for (std::size_t i = 0; i < row_count; ++i) rows[i].active = false;
  iteration_limit = iterations + static_cast<std::uint32_t>(64 + 30 * bodies);
  for (std::size_t p = mostViolated(push_out); p < row_count; p = mostViolated(push_out)) {
    if (!enforce(p, push_out)) return false;
  }
  return true;
}

MotionSolver::MotionSolver(std::size_t max_bodies, std::size_t max_rows)
    : workspace_(std::make_unique<Workspace>(max_bodies, max_rows)) {}
MotionSolver::~MotionSolver() = default;
MotionSolver::MotionSolver(MotionSolver&&) noexcept = default;
MotionSolver& MotionSolver::operator=(MotionSolver&&) noexcept = default;

MotionResult MotionSolver::solve(std::span<const MovableBody> bodies, std::span<const GapRow> rows,
                                 std::span<Displacement> motions, std::span<double> multipliers) noexcept {
  Workspace& w = *workspace_;
  assert(bodies.size() <= w.L.size() && rows.size() <= w.rows.size());
  assert(motions.size() == bodies.size() && multipliers.size() == rows.size());
  w.bodies = bodies.size();
  w.row_count = rows.size();
  w.iterations = 0;
  for (std::size_t i = 0; i < bodies.size(); ++i) w.setBody(i, bodies[i]);
  for (std::size_t i = 0; i < rows.size(); ++i) w.setRow(i, rows[i], bodies);

  MotionResult result;
  bool solved = w.run(true);
  if (!solved) {
    // standing still is always admissible then
    result.conflicting = true;
    solved = w.run(false);
  }
  result.iterations = w.iterations;

  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Vector6 x = solved ? Vector6(w.L[i].transpose().triangularView<Eigen::Upper>().solve(
                                   Eigen::Map<const Vector6>(&w.y[6 * i])))
                             : Vector6(Vector6::Zero());
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
  return {f_C_W, p_BoC_W.cross(f_C_W) + spring.rotational_stiffness * toGoal.rotation};
}

}  // namespace tenon
