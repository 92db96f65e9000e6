#pragma once

#include <array>
#include <limits>
#include <span>

#include "server/collision/island_solver.h"
#include "server/collision/valley_correction.h"

namespace tenon::collision {

/// [m] Convergence tolerance of bodies without contact.
inline constexpr double kStepTolerance = 1e-9;

/// [m] A solve whose last step is longer than this is unconverged.
inline constexpr double kUnconverged = 1e-6;

/// [m] Overlap that the field's discretisation, and the rotation of contacts in a step, may leave.
inline constexpr double kFieldNoise = 5e-6;

/// [m] Displacement of point P of a body, in W, to first order, for that of its centre Q.
inline Vector3 pointDisplacement(const Displacement& u_W, const Vector3& p_QP_W) {
  return u_W.translation + u_W.rotation.cross(p_QP_W);
}

/// Two unit vectors orthogonal to a unit normal and to each other.
inline std::array<Vector3, 2> tangentsOf(const Vector3& n_W) {
  Eigen::Index least = 0;
  n_W.cwiseAbs().minCoeff(&least);
  const Vector3 first = n_W.cross(Vector3::Unit(least)).normalized();
  return {first, n_W.cross(first)};
}

/// The field a contact is measured in, and its body's pose; none for a crossing of edges.
struct ContactSurface {
  const structures::DistanceField* field = nullptr;
  const Pose* X_WF = nullptr;
  double most_dilation = std::numeric_limits<double>::infinity();  ///< [m] of the field's, so much counts
  double sign = 1.0;  ///< [-] 1: the contact's normal points out of this surface; -1: into it

  /// The field in its frame F.
  [[nodiscard]] structures::FieldSample sample(const Vector3& p_FP) const {
    structures::FieldSample sample = sampleInValley(*field, p_FP);
    sample.distance += field->dilationBeyond(most_dilation, p_FP);
    return sample;
  }
};

/// The arguments of IslandSolver::solve, shared by its files. All spans live as long as the call.
///
/// Threads: one. Real-time: everything.
struct IslandSolver::Job {
  std::span<MovableBody> bodies;
  std::span<const IslandPair> pairs;
  const SolveLimits& limits;
  std::span<IslandPairResult> results;

  [[nodiscard]] const Pose& poseOf(std::int32_t body, const Pose& X_W_static) const {
    return body == ContactConstraint::kStatic ? X_W_static : bodies[static_cast<std::size_t>(body)].X_WB;
  }
  [[nodiscard]] const Pose& poseA(const IslandPair& pair) const {
    return poseOf(pair.body_a, pair.X_WA_static);
  }
  [[nodiscard]] const Pose& poseB(const IslandPair& pair) const {
    return poseOf(pair.body_b, pair.X_WB_static);
  }
  [[nodiscard]] ContactSurface surfaceOf(const IslandPair& pair, const Contact& contact) const {
    switch (contact.kind) {
      case ContactKind::kShellPoint:
        return {.field = pair.field_B, .X_WF = &poseB(pair)};
      case ContactKind::kFeaturePoint:
        return {pair.features.field_A, &poseA(pair), pair.features.most_dilation_A, -1.0};
      case ContactKind::kCrossing:
        break;
    }
    return {};
  }
  /// The query of a pair at the current poses of its bodies, up to a gap of `margin` [m].
  [[nodiscard]] PairQuery queryOf(const IslandPair& pair, double margin) const {
    PairQuery query{pair.shell_A, pair.field_B, poseA(pair), poseB(pair),
                    margin,       pair.levels,  pair.budget, pair.priority_points};
    query.correct_valleys = true;
    return query;
  }
};

}  // namespace tenon::collision
