#include "tests/bench/engine/pose_sets.h"

#include <algorithm>
#include <memory>

#include "server/collision/pair_query.h"

namespace tenon::bench {

namespace {

// [m] largest gap of a near pose, smallest step, and largest distance beyond the target
constexpr double kNear = 0.015;
constexpr double kMinStep = 20e-6;
constexpr double kOvershoot = 0.02;
constexpr int kMaxSteps = 400;

/// Poses along the insertion path.
class InsertionPath {
 public:
  InsertionPath(const structures::Pointshell& shell_A, const structures::DistanceField& field_B,
                const InsertionTask& task)
      : shell_A_(shell_A), field_B_(field_B), task_(task) {
    side_ = task.direction_B.unitOrthogonal();
    other_side_ = task.direction_B.cross(side_);
  }

  /// Start pose number `index`, at the fraction `fraction` [-] of the spiral.
  [[nodiscard]] Pose start(double fraction, std::size_t index) const {
    const double lateral_offset = task_.lateral_offset * (1.0 - fraction) * (1.0 - fraction);
    const auto step = static_cast<double>(index);
    // expRotation instead of sin and cos of the C library, which differ between machines
    const Vector3 around = expRotation(task_.direction_B * (0.11 * step)) * side_;
    const double tilt = 0.05 * (1.1 - fraction);
    const Vector3 axis = expRotation(task_.direction_B * (0.07 * step)) * other_side_;
    const Vector3 p = task_.X_BT.translation() - task_.direction_B * task_.reach;
    return {p + around * lateral_offset, expRotation(axis * tilt) * task_.X_BT.rotation()};
  }

  /// X_BA moved along the direction until it is `depth` [m] deep (negative: until the gap is that small).
  [[nodiscard]] Pose pushed(Pose X_BA, double depth) {
    const double max_distance = task_.reach + kOvershoot;
    double distance = 0.0;
    for (int i = 0; i < kMaxSteps && distance < max_distance; ++i) {
      const double remaining = depth + gapAt(X_BA);
      if (remaining <= 0.0) break;
      const double step = std::max(remaining, kMinStep);
      X_BA.translation() += task_.direction_B * step;
      distance += step;
    }
    return X_BA;
  }

  /// [m] Lower bound of the gap, exact when negative.
  [[nodiscard]] double gapAt(const Pose& X_BA) {
    collision::queryPair({&shell_A_, &field_B_, X_BA, Pose()}, *result_);
    return result_->smallest_gap;
  }

 private:
  const structures::Pointshell& shell_A_;
  const structures::DistanceField& field_B_;
  InsertionTask task_;
  Vector3 side_, other_side_;
  std::unique_ptr<collision::PairQueryResult> result_ = std::make_unique<collision::PairQueryResult>();
};

}  // namespace

PoseSets insertionPoses(const structures::Pointshell& shell_A, const structures::DistanceField& field_B,
                        const InsertionTask& task, std::size_t count) {
  InsertionPath path(shell_A, field_B, task);
  PoseSets sets;
  const std::size_t each = count / 3;
  for (std::size_t i = 0; i < each; ++i) {
    const Pose X_BA = path.start(static_cast<double>(i) / static_cast<double>(each), i);
    if (path.gapAt(X_BA) >= kNear) sets.free.push_back(X_BA);

    const Pose near = path.pushed(X_BA, -kNear * static_cast<double>(1 + i % 14) / 15.0);
    if (path.gapAt(near) > 0.0) sets.near.push_back(near);

    // 0.5 to 5 mm, with a period of 31 poses
    const double depth = 0.5e-3 + 4.5e-3 * static_cast<double>(i * 7 % 31) / 30.0;
    const Pose pressed = path.pushed(near, depth);
    if (path.gapAt(pressed) <= -0.5e-3) sets.contact.push_back(pressed);
  }
  return sets;
}

}  // namespace tenon::bench
