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

/// Works in coordinates y = Lᵀ x of every body (H = L Lᵀ), where the energy is ½|y - y0|². All rows are
/// looked at together as columns of numbers, in x, since there a row needs no preparation.
struct MotionSolver::Workspace {
  /// Neighbours in the list are neighbours in space: of this many, only the most violated row is tried.
  static constexpr std::size_t kBlock = 16;

  /// Rows [first, first + count) between the same two bodies.
  struct Run {
    std::size_t first = 0, count = 0;
    std::array<std::int32_t, 2> body{};
  };

  Workspace(std::size_t max_bodies, std::size_t max_rows)
      : active(6 * max_bodies),
        L(max_bodies),
        slack(max_rows),
        is_active(max_rows),
        body_of(max_rows),
        y0(6 * max_bodies),
        y(6 * max_bodies),
        x(6 * max_bodies),
        normal(6 * max_bodies),
        step(6 * max_bodies),
        r(6 * max_bodies),
        u(6 * max_bodies + 1) {
    for (std::vector<double>& column : columns) column.resize(max_rows);
    runs.reserve(max_rows);
    tried.reserve(max_rows);
  }

  void setBody(std::size_t i, const MovableBody& body);
  void setRows(std::span<const GapRow> rows, std::span<const MovableBody> island);
  /// False: the rows contradict each other, or the iterations have run out.
  bool run(std::span<const std::uint32_t> first);
  void updateMotions();
  [[nodiscard]] double slackOf(std::size_t row) const;
  /// Of all rows; the worst of every block that does not hold goes into `tried`.
  void findViolated();
  [[nodiscard]] std::size_t mostViolatedOfTried() const;
  bool enforceTried();
  bool enforce(std::size_t p);
  void dropActive(std::size_t position);

  ActiveSet active;
  std::vector<Matrix6> L;
  std::array<std::vector<double>, 10> columns;  ///< gap, normal, its moment about A's origin, about B's
  std::vector<double> slack;
  std::vector<std::uint8_t> is_active;
  std::vector<std::array<std::int32_t, 2>> body_of;
  std::vector<Run> runs;
  std::vector<std::uint32_t> tried;
  std::vector<double> y0, y, x, normal, step, r, u;  // u: multipliers in the order of `active`
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
  for (const Curve& curve : body.curves) {
    Vector6 c;
    c << curve.per_motion_W.translation, curve.per_motion_W.rotation;
    H += curve.stiffness * (c * c.transpose());
  }
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

void MotionSolver::Workspace::setRows(std::span<const GapRow> rows, std::span<const MovableBody> island) {
  runs.clear();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const GapRow& row = rows[i];
    body_of[i] = {row.body_a, row.body_b};
    is_active[i] = 0;
    if (runs.empty() || runs.back().body[0] != row.body_a || runs.back().body[1] != row.body_b) {
      runs.push_back({i, 0, body_of[i]});
    }
    ++runs.back().count;
    std::array<Vector3, 2> moment{Vector3::Zero(), Vector3::Zero()};
    for (std::size_t side = 0; side < 2; ++side) {
      if (body_of[i][side] == GapRow::kStatic) continue;
      const auto body = static_cast<std::size_t>(body_of[i][side]);
      assert(body < island.size());
      moment[side] = (row.p_WP - island[body].X_WB.translation()).cross(row.n_W);
    }
    // what moves nobody always holds
    const bool idle = row.body_a == row.body_b || row.n_W.isZero(0.0);
    columns[0][i] = idle ? std::numeric_limits<double>::infinity() : row.gap;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<Eigen::Index>(axis);
      columns[1 + axis][i] = row.n_W[k];
      columns[4 + axis][i] = moment[0][k];
      columns[7 + axis][i] = moment[1][k];
    }
  }
}

void MotionSolver::Workspace::updateMotions() {
  for (std::size_t i = 0; i < bodies; ++i) {
    segment(x, i) = L[i].transpose().triangularView<Eigen::Upper>().solve(segment(y, i));
  }
}

double MotionSolver::Workspace::slackOf(std::size_t row) const {
  double sum = columns[0][row];
  for (std::size_t side = 0; side < 2; ++side) {
    const std::int32_t body = body_of[row][side];
    if (body == GapRow::kStatic) continue;
    const double* motion = &x[6 * static_cast<std::size_t>(body)];
    const double sign = side == 0 ? 1.0 : -1.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sum += sign *
             (columns[1 + axis][row] * motion[axis] + columns[4 + 3 * side + axis][row] * motion[3 + axis]);
    }
  }
  return sum;
}

void MotionSolver::Workspace::findViolated() {
  for (const Run& run : runs) {
    std::array<double, 9> m{};  // A's motion less B's, A's rotation, B's
    for (std::size_t side = 0; side < 2; ++side) {
      if (run.body[side] == GapRow::kStatic) continue;
      const double* motion = &x[6 * static_cast<std::size_t>(run.body[side])];
      const double sign = side == 0 ? 1.0 : -1.0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        m[axis] += sign * motion[axis];
        m[3 + 3 * side + axis] = sign * motion[3 + axis];
      }
    }
    std::array<const double*, 10> c{};
    for (std::size_t k = 0; k < c.size(); ++k) c[k] = columns[k].data() + run.first;
    double* out = slack.data() + run.first;
    for (std::size_t i = 0; i < run.count; ++i) {
      out[i] = c[0][i] + (c[1][i] * m[0] + c[2][i] * m[1] + c[3][i] * m[2]) +
               (c[4][i] * m[3] + c[5][i] * m[4] + c[6][i] * m[5]);
    }
    if (run.body[1] == GapRow::kStatic) continue;
    for (std::size_t i = 0; i < run.count; ++i) {
      out[i] += c[7][i] * m[6] + c[8][i] * m[7] + c[9][i] * m[8];
    }
  }
  for (std::size_t k = 0; k < active.size(); ++k) slack[active.row(k)] = 0.0;

  tried.clear();
  for (std::size_t first = 0; first < row_count; first += kBlock) {
    const std::size_t end = std::min(first + kBlock, row_count);
    std::size_t worst = first;
    for (std::size_t i = first + 1; i < end; ++i) {
      if (slack[i] < slack[worst]) worst = i;
    }
    if (slack[worst] < -kGapTolerance) tried.push_back(static_cast<std::uint32_t>(worst));
  }
}

std::size_t MotionSolver::Workspace::mostViolatedOfTried() const {
  std::size_t worst = row_count;
  double least = -kGapTolerance;
  for (const std::uint32_t row : tried) {
    if (is_active[row] != 0) continue;
    const double s = slackOf(row);
    if (s < least) {
      least = s;
      worst = row;
    }
  }
  return worst;
}

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
                                 std::span<const std::uint32_t> first) noexcept {
  Workspace& w = *workspace_;
  assert(bodies.size() <= w.L.size() && rows.size() <= w.slack.size() && first.size() <= rows.size());
  assert(motions.size() == bodies.size() && multipliers.size() == rows.size());
  w.bodies = bodies.size();
  w.row_count = rows.size();
  w.iterations = 0;
  for (std::size_t i = 0; i < bodies.size(); ++i) w.setBody(i, bodies[i]);
  w.setRows(rows, bodies);

  MotionResult result;
  bool solved = w.run(first);
  if (!solved) {
    // standing still is always admissible then
    result.conflicting = true;
    for (std::size_t i = 0; i < rows.size(); ++i) w.columns[0][i] = std::max(w.columns[0][i], 0.0);
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
  return {f_C_W, p_BoC_W.cross(f_C_W) + spring.rotational_stiffness * toGoal.rotation};
}

}  // namespace tenon
