#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/haptic_hand.h"
#include "clients/haptic/rate_chooser.h"
#include "devices/simulated/sigma7.h"
#include "idl/types/motion_law.h"
#include "tests/clients/haptic/delayed_station.h"
#include "tests/clients/rehearse/path_device.h"

// What a station with a copy of the scene feels of another person's hand.

namespace tenon::haptic {
namespace {

using test::blocks;
using test::DelayedStation;
using test::kBlock;
using test::kEdge;
using test::kLeft;
using test::kPart;
using test::kRight;
using test::kSlowAnswers;
using test::kStiffness;
using test::StationAnswers;

constexpr Tick kWay = 10;  // [ticks] one way

/// The hand of a person with a device that moves as is given, `kWay` from a server, and another hand there.
class HandBesideAnother {
 public:
  using Path = std::function<Vector3(double)>;

  /// `right` [m] at a time [s], in the world.
  explicit HandBesideAnother(const Path& right, const StationAnswers& answers = {},
                             ForceModelKind kind = ForceModelKind::kSceneCopy)
      : scene_(blocks()),
        device_(devices::sigma7Model(), [=](double t) { return Pose(right(t) - right(0.0)); }),
        hand(device_),
        server_(scene_, kWay, answers),
        kind_(kind) {
    hand.setCopy(std::make_unique<SceneCopy>(scene_));
    hand.setForceModel(kind);
    if (answers.manifold_period > 1) hand.setLinkJitter(RateChooser::kSlowAnswers);
    hand.setLinkRoundTrip(2.0 * kWay * kTickSeconds);
    hand.begin(kRight, ClientId{1}, right(0.0), true);
    EXPECT_TRUE(hand.armDevice());
    hand.handBack();
  }

  /// One millisecond with the left hand at p_WLeft.
  void tick(const Vector3& p_WLeft) {
    const std::uint32_t seq =
        server_.deliver([this](const HandManifold& manifold) { hand.receive(manifold); });
    hand.step(seq, server_.world(), kTickSeconds);
    server_.step(hand.input().sample.X_WH, hand.input().sample.V_WH, p_WLeft);
  }
  [[nodiscard]] simulation::Environment& server() { return server_.environment(); }
  [[nodiscard]] Vector3 force() const { return hand.state().F_Ho_W.force; }
  /// The force is that of the model, and was not interrupted.
  [[nodiscard]] bool isRendered() const {
    const std::uint32_t soft_start = devices::bit(devices::SafetyRule::kSoftStart);
    return hand.forceModel() == kind_ && (hand.state().safety_flags & soft_start) == 0;
  }

 private:
  std::shared_ptr<const simulation::Scene> scene_;
  test::PathDevice device_;

 public:
  HapticHand hand;

 private:
  test::DelayedServer server_;
  ForceModelKind kind_;
};

//   [block]->[part]     the block is pressed by 2 mm into the part of another person, whose link then fails
TEST(AnothersFreeze, IsNoStepOfTheForceForWhoPressesWhatTheyHold) {
  const Vector3 p_WLeft(0.1, 0.0, 0.2);
  HandBesideAnother both([&](double t) {
    const double deep = 0.007 * std::clamp((t - 0.5) / 0.5, 0.0, 1.0) - 0.005;
    return Vector3(p_WLeft.x() - kEdge + deep, 0.0, 0.2);
  });
  for (int i = 0; i < 3000; ++i) both.tick(p_WLeft);
  ASSERT_TRUE(both.isRendered());
  const double pressed = both.force().norm();
  ASSERT_GT(pressed, 1.0);
  Vector3 last = both.force();
  for (const bool frozen : {true, false, true, false}) {
    both.server().setHandFrozen(kLeft, frozen);
    for (int i = 0; i < 500; ++i) {
      both.tick(p_WLeft);
      ASSERT_TRUE(both.isRendered()) << i;
      ASSERT_LE((both.force() - last).norm(), 0.2) << (frozen ? "frozen for " : "free for ") << i << " ms";
      last = both.force();
    }
    EXPECT_NEAR(both.force().norm(), pressed, 0.1 * pressed);
  }
}

//   [ block ] held by both, the other one pulls sideways
TEST(AnothersFreeze, FadesTheirPullOnASharedPartAndItReturnsWithoutAStep) {
  const Vector3 p_WH(0.0, 0.0, 0.2);
  HandBesideAnother both([=](double) { return p_WH; });
  const Vector3 away(0.2, 0.0, 0.2);
  for (int i = 0; i < 500; ++i) both.tick(away);
  both.server().grab(kLeft, kBlock);
  double aside = 0.0;  // [m]
  for (int i = 0; i < 3000; ++i) both.tick(away + Vector3(0.0, aside = std::min(0.005, aside + 1e-5), 0.0));
  ASSERT_TRUE(both.isRendered());
  ASSERT_GT(both.force().y(), 2.0);
  Vector3 last = both.force();
  const auto follow = [&](int cycles) {
    for (int i = 0; i < cycles; ++i) {
      both.tick(away + Vector3(0.0, aside, 0.0));
      ASSERT_TRUE(both.isRendered()) << i;
      ASSERT_LE((both.force() - last).norm(), 0.5) << i;
      last = both.force();
    }
  };
  both.server().setHandFrozen(kLeft, true);
  follow(500);
  EXPECT_LT(last.norm(), 0.1);
  both.server().setHandFrozen(kLeft, false);
  follow(500);
  EXPECT_LT(last.norm(), 0.1) << "it holds the part where it is by then";
  for (int i = 0; i < 500; ++i) {
    aside += 1e-5;
    follow(1);
  }
  follow(300);
  EXPECT_GT(last.y(), 2.0) << "and pulls again";
}

//   [ block ] held by both, the other one pulls sideways, lets go and takes the part beside it at once
TEST(AnothersPull, FadesWhenTheyTakeTheirOwnPartInstead) {
  const Vector3 p_WH(0.0, 0.0, 0.2), away(0.15, 0.0, 0.2);
  HandBesideAnother both([=](double) { return p_WH; });
  for (int i = 0; i < 500; ++i) both.tick(away);
  both.server().grab(kLeft, kBlock);
  double aside = 0.0;  // [m]
  for (int i = 0; i < 3000; ++i) both.tick(away + Vector3(0.0, aside = std::min(0.005, aside + 1e-5), 0.0));
  ASSERT_TRUE(both.isRendered());
  Vector3 last = both.force();
  ASSERT_GT(last.y(), 2.0);
  const double step = 0.2 * last.norm();  // the pull fades within 20 ms
  both.server().grab(kLeft, kPart);
  for (int i = 0; i < 500; ++i) {
    both.tick(away + Vector3(0.0, aside, 0.0));
    ASSERT_TRUE(both.isRendered()) << i;
    ASSERT_LE((both.force() - last).norm(), step) << i;
    last = both.force();
  }
  EXPECT_LT(last.norm(), 0.1);
}

//   two people carry a part across at 0.1 m/s; what is heard of the other one comes 50 times a second
TEST(ASharedPart, IsCarriedWithoutStepsOfTheForce) {
  for (const Tick delay : {5, 25}) {
    DelayedStation far(delay, blocks(), kSlowAnswers);
    const Vector3 away(0.2, 0.0, 0.2);
    for (Tick tick = 1; tick <= 500; ++tick) far.tick({0.0, 0.0, 0.1}, away);
    far.server().setHandRoundTrip(kRight, 2.0 * kTickSeconds * static_cast<double>(delay));
    far.server().grab(kLeft, kBlock);
    Vector3 last = Vector3::Zero();
    double drag = 0.0;
    for (Tick tick = 1; tick <= 3000; ++tick) {
      // both accelerate within 100 ms
      const double t = 1e-3 * static_cast<double>(tick) - 1.5;
      const double y = t <= 0.0 ? 0.0 : t < 0.1 ? 0.5 * t * t : 0.1 * (t - 0.05);
      const Vector3 p_WH(0.0, y, 0.1);
      far.tick(p_WH, away + Vector3(0.003, y, 0.0));
      const Vector3 force = DelayedStation::force(far.copy.proxy(), p_WH);
      if (tick > 1000) {
        const bool accelerates = tick > 1500 && tick < 1700;
        ASSERT_LE((force - last).norm(), accelerates ? 0.4 : 0.2) << "delay " << delay << ", " << tick;
      }
      if (tick > 2000) drag = std::max(drag, std::abs(force.y()));
      last = force;
    }
    EXPECT_GT(last.x(), 0.5) << "the other one pulls as before";
    EXPECT_LT(drag, 0.3);
  }
}

//   without copies likewise: what the other one does comes 50 times a second, and between that as it moved;
//   also beyond the end of the workspace, which is drawn along until the springs of both are far from their
//   goals
TEST(ASharedPart, IsCarriedWithoutStepsOfTheForceByWhoHasNoCopyOfTheScene) {
  const auto carried = [](double t) {
    const double since = std::max(0.0, t - 3.0);  // both accelerate within 100 ms
    return Vector3(0.0, since < 0.1 ? 0.5 * since * since : 0.1 * (since - 0.05), 0.0);
  };
  HandBesideAnother both([&](double t) -> Vector3 { return Vector3(0.0, 0.0, 0.2) + carried(t); },
                         kSlowAnswers, ForceModelKind::kManifold);
  const Vector3 away(0.2, 0.0, 0.2);
  for (int i = 0; i < 500; ++i) both.tick(away);
  both.server().setHandRoundTrip(kRight, 2.0 * kTickSeconds * kWay);
  both.server().grab(kLeft, kBlock);
  Vector3 last = Vector3::Zero();
  for (int i = 501; i <= 5500; ++i) {
    const double t = 1e-3 * i;
    // between two manifolds it jumps by 5 mm, as after a loss
    both.tick(away + carried(t) + Vector3(t < 4.005 ? 0.003 : 0.008, 0.0, 0.0));
    if (i <= 2500) continue;
    ASSERT_TRUE(both.isRendered()) << i;
    if (i > 2501) {
      ASSERT_LE((both.force() - last).norm(), 0.2) << i;
    }
    last = both.force();
    if (i == 4000) {
      EXPECT_GT(last.x(), 1.0) << "the other one pulls";
    }
  }
  EXPECT_NEAR(last.norm(), 20.0, 0.01) << "of the device";
}

//   a part that moves to and fro is heard 100 times a second: it is as old as its newest pose, not as the
//   motion before that
TEST(AFollowedBody, HasTheVelocityOfTheNewestFrame) {
  constexpr Tick kFar = 25;
  const auto scene = blocks(100.0 * kStiffness);
  DelayedStation far(kFar, scene, kSlowAnswers);
  constexpr double kAmplitude = 0.05, kOmega = 6.0;  // [m], [rad/s]
  double error = 0.0, jerk_bound = 0.0;
  for (Tick tick = 1; tick <= 3000; ++tick) {
    const double t = 1e-3 * static_cast<double>(tick);
    // beyond the reach of neighbours, so that it is followed
    const Vector3 p_WLeft(0.35, kAmplitude * std::sin(kOmega * t), 0.3);
    far.tick({0.0, 0.0, 0.3}, p_WLeft);
    if (tick < 500 || std::abs(std::cos(kOmega * t)) < 0.3) continue;
    const Vector3 copied = far.copy.environment().objects()[kPart.value].X_WO.translation();
    error = std::max(error, (copied - p_WLeft).norm());
  }
  // the frame is up to 10 ms older than the delay, and two ticks pass until it is followed
  constexpr double kAhead = 1e-3 * (kFar + 12);
  jerk_bound = extrapolationError(kAmplitude * kOmega * kOmega, kAhead);
  EXPECT_LT(error, 1.1 * jerk_bound);
  EXPECT_GT(error, 0.1 * jerk_bound) << "or nothing moved";
}

//   a free part that something pushes of which the station does not know
TEST(AFreePart, IsCorrectedAlsoWhereManifoldsComeAfterTheFramesOfTheirTick) {
  for (const Tick later : {0, 3, 8}) {
    test::SmallScene small;
    small.object("block", test::boxShape(Vector3::Constant(kEdge)), {0.0, 0.0, 0.2});
    small.freeBox("part", Vector3::Constant(kEdge), 1.0, {0.3, 0.0, 0.2}, true);
    small.object("floor", test::boxShape({0.5, 0.3, 0.04}), {0.0, 0.0, -0.02}, ObjectStatus::kFixed);
    small.spec(kPart).body->damping = 10.0;
    small.hand("right", kBlock);
    small.pair(kBlock, kPart);
    test::StationAnswers answers = kSlowAnswers;
    answers.manifolds_later = later;
    DelayedStation far(10, small.build(), answers);
    const Vector3 p_WH(0.0, 0.0, 0.2);
    for (Tick tick = 1; tick <= 400; ++tick) far.tick(p_WH, p_WH);
    for (Tick tick = 1; tick <= 1500; ++tick) {
      if (tick <= 100) far.server().contribute(kPart, 1, {Vector3(0.0, 2.0, 0.0), Vector3::Zero()}, 2);
      far.tick(p_WH, p_WH);
    }
    const double moved = far.server().objects()[kPart.value].X_WO.translation().y();
    EXPECT_GT(moved, 5e-3);
    EXPECT_LT(moved, PredictedBody::kLost);
    EXPECT_NEAR(far.copy.environment().objects()[kPart.value].X_WO.translation().y(), moved, 2e-4) << later;
  }
}

}  // namespace
}  // namespace tenon::haptic
