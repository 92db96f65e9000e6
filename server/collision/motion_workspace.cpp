#include "server/collision/motion_workspace.h"

#include <algorithm>
#include <cassert>
#include <limits>

namespace tenon {
namespace {

/// [m] A gap kept to this is kept: far below what a field can say, far above rounding.
constexpr double kGapTolerance = 1e-11;

/// A body that a spring holds at a point may still turn: this share of what its stiffness would be worth at
/// the body's radius makes the answer unique, and is too weak to be felt.
constexpr double kLeastRotation = 1e-6;

/// A body that may go no farther is this many times as hard to move.
constexpr double kPinned = 1e9;

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
  H.bottomRightCorner<3, 3>() +=
      spring.rotational_stiffness * Matrix3::Identity() + spring.rotational_tensor_W;
  b += spring.stiffness * (J.transpose() * p_CoGc_W);
  b.tail<3>() += springTorque(spring, toGoal.rotation);
}

}  // namespace

void MotionSolver::Workspace::setBody(std::size_t i, const MovableBody& body) {
  Matrix6 H = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  double stiffness = 0.0;
  for (const Spring& spring : body.springs) {
    addSpring(spring, body.X_WB, H, b);
    stiffness += spring.stiffness;
  }
  b.head<3>() += body.drag_Bo_W.force;
  b.tail<3>() += body.drag_Bo_W.torque;
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
  if (body.pinned) {
    H *= kPinned;
    b.setZero();
  }
  L[i] = H.llt().matrixL();
  segment(y0, i) = L[i].triangularView<Eigen::Lower>().solve(b);
}

void MotionSolver::Workspace::setRows(std::span<const GapRow> rows, std::span<const MovableBody> island,
                                      std::size_t unchanged) {
  while (!runs.empty() && runs.back().first >= unchanged) runs.pop_back();
  if (!runs.empty()) runs.back().count = std::min(runs.back().count, unchanged - runs.back().first);
  clipped = false;
  bool new_run = true;
  std::array<const Pose*, 2> origin{};
  for (std::size_t i = unchanged; i < rows.size(); ++i) {
    const GapRow& row = rows[i];
    body_of[i] = {row.body_a, row.body_b};
    if (new_run || runs.back().body[0] != row.body_a || runs.back().body[1] != row.body_b) {
      new_run = false;
      runs.push_back({i, 0, body_of[i]});
      for (std::size_t side = 0; side < 2; ++side) {
        const std::int32_t body = body_of[i][side];
        assert(body < static_cast<std::int32_t>(island.size()));
        origin[side] = body == GapRow::kStatic ? nullptr : &island[static_cast<std::size_t>(body)].X_WB;
      }
    }
    ++runs.back().count;
    // what moves nobody always holds
    const bool idle = row.body_a == row.body_b || row.n_W.isZero(0.0);
    columns[0][i] = idle ? std::numeric_limits<double>::infinity() : row.gap;
    columns[1][i] = row.n_W.x();
    columns[2][i] = row.n_W.y();
    columns[3][i] = row.n_W.z();
    for (std::size_t side = 0; side < 2; ++side) {
      if (origin[side] == nullptr) continue;
      const Vector3 moment = (row.p_WP - origin[side]->translation()).cross(row.n_W);
      columns[4 + 3 * side][i] = moment.x();
      columns[5 + 3 * side][i] = moment.y();
      columns[6 + 3 * side][i] = moment.z();
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
  tried.clear();
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
    const std::size_t end = run.first + run.count;
    for (std::size_t first = run.first; first < end; first += kBlock) {
      const std::uint32_t worst = worstOfBlock(first, std::min(first + kBlock, end), run, m);
      if (worst != row_count) tried.push_back(worst);
    }
  }
}

std::uint32_t MotionSolver::Workspace::worstOfBlock(std::size_t first, std::size_t end, const Run& run,
                                                    const std::array<double, 9>& m) const {
  std::array<const double*, 10> c{};
  for (std::size_t k = 0; k < c.size(); ++k) c[k] = columns[k].data() + first;
  // whole blocks, for the sake of vector instructions: what is behind the end is not looked at
  std::array<double, kBlock> slack;
  for (std::size_t i = 0; i < kBlock; ++i) {
    slack[i] = c[0][i] + (c[1][i] * m[0] + c[2][i] * m[1] + c[3][i] * m[2]);
  }
  if (run.body[0] != GapRow::kStatic) {
    for (std::size_t i = 0; i < kBlock; ++i) slack[i] += c[4][i] * m[3] + c[5][i] * m[4] + c[6][i] * m[5];
  }
  if (run.body[1] != GapRow::kStatic) {
    for (std::size_t i = 0; i < kBlock; ++i) slack[i] += c[7][i] * m[6] + c[8][i] * m[7] + c[9][i] * m[8];
  }
  double least = -kGapTolerance;
  std::size_t worst = row_count;
  for (std::size_t row = first; row < end; ++row) {
    if (slack[row - first] >= least || state[row] != RowState::kIdle) continue;
    least = slack[row - first];
    worst = row;
  }
  return static_cast<std::uint32_t>(worst);
}

std::size_t MotionSolver::Workspace::mostViolatedOfTried() const {
  std::size_t worst = row_count;
  double least = -kGapTolerance;
  for (const std::uint32_t row : tried) {
    if (state[row] != RowState::kIdle) continue;
    const double s = slackOf(row);
    if (s < least) {
      least = s;
      worst = row;
    }
  }
  return worst;
}

}  // namespace tenon
