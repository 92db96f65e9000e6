#pragma once

#include <array>
#include <span>

#include "server/collision/island_solver.h"

namespace tenon {

/// [m] A body whose points all have less than this to go has arrived.
inline constexpr double kArrived = 1e-9;

/// [m] What may be left after the last sub-step without being called unfinished.
inline constexpr double kUnfinished = 1e-6;

/// [m] A depth that the field's steps and a turned contact may leave behind.
inline constexpr double kFieldNoise = 5e-6;

/// Of a point of a body that moves.
inline Vector3 pointMotion(const Displacement& motion, const Vector3& p_BoP_W) {
  return motion.translation + motion.rotation.cross(p_BoP_W);
}

/// Two directions across a normal, and across each other.
inline std::array<Vector3, 2> tangentsOf(const Vector3& n_W) {
  Eigen::Index least = 0;
  n_W.cwiseAbs().minCoeff(&least);
  const Vector3 first = n_W.cross(Vector3::Unit(least)).normalized();
  return {first, n_W.cross(first)};
}

/// What an island solver is asked to do, passed from step to step of it; how its files share it. All spans
/// live as long as the call.
///
/// Threads: one. Real-time: everything.
struct IslandSolver::Job {
  std::span<MovableBody> bodies;
  std::span<const IslandPair> pairs;
  const SolveLimits& limits;
  std::span<IslandPairResult> results;

  [[nodiscard]] const Pose& poseOf(std::int32_t body, const Pose& X_W_static) const {
    return body == GapRow::kStatic ? X_W_static : bodies[static_cast<std::size_t>(body)].X_WB;
  }
  [[nodiscard]] const Pose& poseA(const IslandPair& pair) const {
    return poseOf(pair.body_a, pair.X_WA_static);
  }
  [[nodiscard]] const Pose& poseB(const IslandPair& pair) const {
    return poseOf(pair.body_b, pair.X_WB_static);
  }
  /// The pair where its bodies are now, up to a gap of `margin` [m].
  [[nodiscard]] PairQuery queryOf(const IslandPair& pair, double margin) const {
    return {pair.shell_A, pair.field_B, poseA(pair), poseB(pair), pair.dilation,
            margin,       pair.levels,  pair.budget, pair.first};
  }
};

}  // namespace tenon
