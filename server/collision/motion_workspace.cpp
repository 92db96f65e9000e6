#include "server/collision/motion_workspace.h"

#include <algorithm>
#include <cassert>
#include <limits>

namespace tenon::collision {
namespace {

/// [m] Feasibility tolerance: far below a field's resolution, far above rounding.
constexpr double kGapTolerance = 1e-11;

/// [-] Rotational regularisation, relative to stiffness times radius²: keeps H definite when the springs
/// leave a rotation free, and is too weak to be perceived.
constexpr double kRotationRegularisation = 1e-6;

/// [-] Factor on the Hessian of a pinned body.
constexpr double kPinnedScale = 1e9;

/// Adds a spring, linearised at the body's pose: its energy is ½ xᵀ H x - bᵀ x, x = (translation of the
/// centre Q, rotation).
void addSpring(const Spring& spring, const MovableBody& body, Matrix6& H, Vector6& b) {
  const Pose& X_WB = body.X_WB;
  const Displacement to_goal = displacement(X_WB, spring.X_WG);
  const Vector3 p_QC_W = X_WB.rotation() * (spring.p_BC - body.p_BQ);
  const Vector3 p_CoGc_W = spring.X_WG * spring.p_BC - X_WB * spring.p_BC;
  Eigen::Matrix<double, 3, 6> J;  // displacement of C per x
  J << Matrix3::Identity(),
      Matrix3{{0.0, p_QC_W.z(), -p_QC_W.y()}, {-p_QC_W.z(), 0.0, p_QC_W.x()}, {p_QC_W.y(), -p_QC_W.x(), 0.0}};
  H += spring.stiffness * (J.transpose() * J);
  H.bottomRightCorner<3, 3>() +=
      spring.rotational_stiffness * Matrix3::Identity() + spring.rotational_tensor_W;
  b += spring.stiffness * (J.transpose() * p_CoGc_W);
  b.tail<3>() += springTorque(spring, to_goal.rotation);
}

}  // namespace

void MotionSolver::Workspace::setBody(std::size_t i, const MovableBody& body) {
  Matrix6 H = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  double stiffness = 0.0;
  for (const Spring& spring : body.springs) {
    addSpring(spring, body, H, b);
    stiffness += spring.stiffness;
  }
  b.head<3>() += body.friction_Bq_W.force;
  b.tail<3>() += body.friction_Bq_W.torque;
  H.bottomRightCorner<3, 3>() +=
      (kRotationRegularisation * stiffness * body.radius * body.radius) * Matrix3::Identity();
  for (const ContactCurvature& curvature : body.curvatures) {
    Vector6 c;
    c << curvature.jacobian_W.translation, curvature.jacobian_W.rotation;
    H += curvature.stiffness * (c * c.transpose());
  }
  for (const DirectionalStiffening& stiffening : body.stiffenings) {
    Vector6 along;
    along << stiffening.direction_W.translation, stiffening.direction_W.rotation;
    const Vector6 H_along = H * along;
    const double along_H_along = along.dot(H_along);
    if (along_H_along > 0.0) H += (stiffening.factor / along_H_along) * (H_along * H_along.transpose());
  }
  if (body.pinned) {
    H *= kPinnedScale;
    b.setZero();
  }
  L[i] = H.llt().matrixL();
  segment(y0, i) = L[i].triangularView<Eigen::Lower>().solve(b);
}

void MotionSolver::Workspace::setRows(std::span<const ContactConstraint> rows,
                                      std::span<const MovableBody> island, std::size_t unchanged) {
  while (!runs.empty() && runs.back().first >= unchanged) runs.pop_back();
  if (!runs.empty()) runs.back().count = std::min(runs.back().count, unchanged - runs.back().first);
  gaps_clamped = false;
  bool new_run = true;
  std::array<Vector3, 2> p_WQ{Vector3::Zero(), Vector3::Zero()};
  for (std::size_t i = unchanged; i < rows.size(); ++i) {
    const ContactConstraint& row = rows[i];
    body_of[i] = {row.body_a, row.body_b};
    if (new_run || runs.back().body[0] != row.body_a || runs.back().body[1] != row.body_b) {
      new_run = false;
      runs.push_back({i, 0, body_of[i]});
      for (std::size_t side = 0; side < 2; ++side) {
        const std::int32_t body = body_of[i][side];
        assert(body < static_cast<std::int32_t>(island.size()));
        if (body != ContactConstraint::kStatic) p_WQ[side] = island[static_cast<std::size_t>(body)].p_WQ();
      }
    }
    ++runs.back().count;
    // a row without a Jacobian always holds
    const bool inert = row.body_a == row.body_b || row.n_W.isZero(0.0);
    columns[0][i] = inert ? std::numeric_limits<double>::infinity() : row.gap;
    columns[1][i] = row.n_W.x();
    columns[2][i] = row.n_W.y();
    columns[3][i] = row.n_W.z();
    for (std::size_t side = 0; side < 2; ++side) {
      if (body_of[i][side] == ContactConstraint::kStatic) continue;
      const Vector3 moment = (row.p_WP - p_WQ[side]).cross(row.n_W);
      columns[4 + 3 * side][i] = moment.x();
      columns[5 + 3 * side][i] = moment.y();
      columns[6 + 3 * side][i] = moment.z();
    }
  }
}

void MotionSolver::Workspace::updateDisplacements() {
  for (std::size_t i = 0; i < bodies; ++i) {
    segment(x, i) = L[i].transpose().triangularView<Eigen::Upper>().solve(segment(y, i));
  }
}

double MotionSolver::Workspace::slackOf(std::size_t row) const {
  double sum = columns[0][row];
  for (std::size_t side = 0; side < 2; ++side) {
    const std::int32_t body = body_of[row][side];
    if (body == ContactConstraint::kStatic) continue;
    const double* motion = &x[6 * static_cast<std::size_t>(body)];
    const double sign = side == 0 ? 1.0 : -1.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sum += sign *
             (columns[1 + axis][row] * motion[axis] + columns[4 + 3 * side + axis][row] * motion[3 + axis]);
    }
  }
  return sum;
}

void MotionSolver::Workspace::findCandidates() {
  candidates.clear();
  for (const Run& run : runs) {
    std::array<double, 9> m{};  // A's translation less B's, A's rotation, minus B's
    for (std::size_t side = 0; side < 2; ++side) {
      if (run.body[side] == ContactConstraint::kStatic) continue;
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
      if (worst != row_count) candidates.push_back(worst);
    }
  }
}

std::uint32_t MotionSolver::Workspace::worstOfBlock(std::size_t first, std::size_t end, const Run& run,
                                                    const std::array<double, 9>& m) const {
  std::array<const double*, 10> c{};
  for (std::size_t k = 0; k < c.size(); ++k) c[k] = columns[k].data() + first;
  // whole blocks, so that the loops vectorise; slacks behind the end are not used
  std::array<double, kBlock> slack;
  for (std::size_t i = 0; i < kBlock; ++i) {
    slack[i] = c[0][i] + (c[1][i] * m[0] + c[2][i] * m[1] + c[3][i] * m[2]);
  }
  if (run.body[0] != ContactConstraint::kStatic) {
    for (std::size_t i = 0; i < kBlock; ++i) slack[i] += c[4][i] * m[3] + c[5][i] * m[4] + c[6][i] * m[5];
  }
  if (run.body[1] != ContactConstraint::kStatic) {
    for (std::size_t i = 0; i < kBlock; ++i) slack[i] += c[7][i] * m[6] + c[8][i] * m[7] + c[9][i] * m[8];
  }
  double least = -kGapTolerance;
  std::size_t worst = row_count;
  for (std::size_t row = first; row < end; ++row) {
    if (slack[row - first] >= least || state[row] != RowState::kInactive) continue;
    least = slack[row - first];
    worst = row;
  }
  return static_cast<std::uint32_t>(worst);
}

std::size_t MotionSolver::Workspace::mostViolatedCandidate() const {
  std::size_t worst = row_count;
  double least = -kGapTolerance;
  for (const std::uint32_t row : candidates) {
    if (state[row] != RowState::kInactive) continue;
    const double s = slackOf(row);
    if (s < least) {
      least = s;
      worst = row;
    }
  }
  return worst;
}

}  // namespace tenon::collision
