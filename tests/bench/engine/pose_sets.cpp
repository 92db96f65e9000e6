#include "tests/bench/engine/pose_sets.h"

#include <algorithm>
#include <memory>

#include "server/collision/pair_query.h"

namespace tenon::bench {

namespace {

// [m] what counts as near, the least way that is tried, and how far behind its place a body is pushed
constexpr double kNear = 0.015;
constexpr double kLeastStep = 20e-6;
constexpr double kBeyond = 0.02;
constexpr int kMostSteps = 400;

/// The body on its way in, along the direction.
class Guide {
 public:
  Guide(const Pointshell& shell_A, const DistanceField& field_B, const Insertion& insertion)
      : shell_A_(shell_A), field_B_(field_B), insertion_(insertion) {
    side_ = insertion.direction_B.unitOrthogonal();
    other_side_ = insertion.direction_B.cross(side_);
  }

  /// Before the place, `share` of the way of the spiral gone.
  [[nodiscard]] Pose start(double share, std::size_t turn) const {
    const double astray = insertion_.astray * (1.0 - share) * (1.0 - share);
    const auto step = static_cast<double>(turn);
    // two slow beats that never meet: a spiral without sine and cosine of the C library
    const Vector3 around = expRotation(insertion_.direction_B * (0.11 * step)) * side_;
    const double tilt = 0.05 * (1.1 - share);
    const Vector3 axis = expRotation(insertion_.direction_B * (0.07 * step)) * other_side_;
    const Vector3 p = insertion_.X_BT.translation() - insertion_.direction_B * insertion_.reach;
    return {p + around * astray, expRotation(axis * tilt) * insertion_.X_BT.rotation()};
  }

  /// Pushed in from `X_BA` until it is `depth` deep (negative: until the gap is less).
  [[nodiscard]] Pose pushed(Pose X_BA, double depth) {
    const double most = insertion_.reach + kBeyond;
    double way = 0.0;
    for (int i = 0; i < kMostSteps && way < most; ++i) {
      const double missing = depth + gapAt(X_BA);
      if (missing <= 0.0) break;
      const double step = std::max(missing, kLeastStep);
      X_BA.translation() += insertion_.direction_B * step;
      way += step;
    }
    return X_BA;
  }

  /// A lower bound of the distance, exact when negative.
  [[nodiscard]] double gapAt(const Pose& X_BA) {
    queryPair({&shell_A_, &field_B_, X_BA, Pose()}, *result_);
    return result_->smallest_gap;
  }

 private:
  const Pointshell& shell_A_;
  const DistanceField& field_B_;
  Insertion insertion_;
  Vector3 side_, other_side_;
  std::unique_ptr<PairQueryResult> result_ = std::make_unique<PairQueryResult>();
};

}  // namespace

PoseSets insertionPoses(const Pointshell& shell_A, const DistanceField& field_B, const Insertion& insertion,
                        std::size_t count) {
  Guide guide(shell_A, field_B, insertion);
  PoseSets sets;
  const std::size_t each = count / 3;
  for (std::size_t i = 0; i < each; ++i) {
    const Pose X_BA = guide.start(static_cast<double>(i) / static_cast<double>(each), i);
    if (guide.gapAt(X_BA) >= kNear) sets.free.push_back(X_BA);

    const Pose near = guide.pushed(X_BA, -kNear * static_cast<double>(1 + i % 14) / 15.0);
    if (guide.gapAt(near) > 0.0) sets.near.push_back(near);

    // 0.5 to 5 mm, in a beat of its own
    const double depth = 0.5e-3 + 4.5e-3 * static_cast<double>(i * 7 % 31) / 30.0;
    const Pose pressed = guide.pushed(near, depth);
    if (guide.gapAt(pressed) <= -0.5e-3) sets.contact.push_back(pressed);
  }
  return sets;
}

}  // namespace tenon::bench
