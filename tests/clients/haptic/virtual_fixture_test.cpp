#include "clients/haptic/virtual_fixture.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/ids.h"
#include "tests/support/realtime_guard.h"

namespace tenon::haptic {
namespace {

constexpr double kFixtureStiffness = 200.0;                        // [N/m]
constexpr double kDamping = 2.0;                                   // [Ns/m]
constexpr double kSlope = VirtualFixture::kGrowth * kTickSeconds;  // [N] in a cycle

/// A fixture whose messages come in each cycle until they are stopped.
struct HandAtFixture {
  explicit HandAtFixture(FixtureKind kind = FixtureKind::kPose, GuidanceMode mode = GuidanceMode::kLead,
                         const FixtureLimits& limits = {2000.0, 20.0, 5.0, 20.0, 1.0})
      : fixture(limits) {
    message.kind = kind;
    message.mode = mode;
    message.choice = 1;
    message.stiffness = kFixtureStiffness;
    message.damping = kDamping;
    message.radius = 0.01;
  }
  /// The wrench on the hand at p_WH.
  Wrench step(const Vector3& p_WH) {
    ++message.tick;
    if (heard) fixture.receive(message);
    return fixture.step(Pose(p_WH), kTickSeconds, permitted);
  }
  Vector3 settle(const Vector3& p_WH, int cycles = 4000) {
    Vector3 force = Vector3::Zero();
    for (int i = 0; i < cycles; ++i) force = step(p_WH).force;
    return force;
  }

  VirtualFixture fixture;
  Guidance message;
  bool heard = true;
  bool permitted = true;
};

void expectEqual(const Vector3& a, const Vector3& b, double tolerance = 1e-6) {
  EXPECT_LT((a - b).norm(), tolerance) << a.transpose() << " instead of " << b.transpose();
}

TEST(VirtualFixture, PullsAHandToItsPoseLikeASpring) {
  HandAtFixture hand;
  expectEqual(hand.settle({0.01, -0.02, 0.0}), {-0.01 * kFixtureStiffness, 0.02 * kFixtureStiffness, 0.0});
}

TEST(VirtualFixture, LeavesTheHandFreeAlongAnAxis) {
  HandAtFixture hand(FixtureKind::kAxis);
  expectEqual(hand.settle({0.01, 0.0, 0.3}), {-0.01 * kFixtureStiffness, 0.0, 0.0});
}

TEST(VirtualFixture, LeavesTheHandFreeInAPlane) {
  HandAtFixture hand(FixtureKind::kPlane);
  expectEqual(hand.settle({0.3, 0.2, 0.01}), {0.0, 0.0, -0.01 * kFixtureStiffness});
}

TEST(VirtualFixture, LeavesTheHandFreeInATube) {
  HandAtFixture hand(FixtureKind::kTube);
  expectEqual(hand.settle({0.009, 0.0, 0.3}), {0.0, 0.0, 0.0});
  expectEqual(hand.settle({0.015, 0.0, 0.3}), {-0.005 * kFixtureStiffness, 0.0, 0.0});
}

TEST(VirtualFixture, IsInItsOwnFrame) {
  HandAtFixture hand(FixtureKind::kPlane);
  hand.message.X_WF =
      Pose(Vector3(0.5, 0.0, 0.0), Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitY())));
  expectEqual(hand.settle({0.49, 0.2, 0.1}), {0.01 * kFixtureStiffness, 0.0, 0.0});
}

TEST(VirtualFixture, TurnsAHandWithABoundedTorque) {
  HandAtFixture hand;
  hand.message.rotational_stiffness = 1.0;
  hand.message.X_WF.rotation() = expRotation({0.0, 0.0, 0.1});
  Wrench wrench;
  for (int i = 0; i < 2000; ++i) wrench = hand.step(Vector3::Zero());
  expectEqual(wrench.torque, {0.0, 0.0, 0.1});
  hand.message.X_WF.rotation() = expRotation({0.0, 0.0, 1.0});
  for (int i = 0; i < 2000; ++i) wrench = hand.step(Vector3::Zero());
  expectEqual(wrench.torque, {0.0, 0.0, VirtualFixture::kTorque});
}

TEST(VirtualFixture, BrakesAHandThatMoves) {
  HandAtFixture hand;
  hand.settle({0.01, 0.0, 0.0});
  double x = 0.01;  // [m]
  Vector3 force;
  for (int i = 0; i < 50; ++i) force = hand.step({x += 1e-5, 0.0, 0.0}).force;
  EXPECT_NEAR(force.x(), -kFixtureStiffness * x - kDamping * 0.01, 1e-4);
}

TEST(VirtualFixture, GrowsByTwentyNewtonsASecondAndStaysBelowItsLimit) {
  HandAtFixture hand;
  double last = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const double force = hand.step({0.5, 0.0, 0.0}).force.norm();
    EXPECT_LE(force, last + kSlope + 1e-12);
    last = force;
  }
  EXPECT_NEAR(last, VirtualFixture::kForce, 1e-9);
}

TEST(VirtualFixture, IsNeverAboveWhatItsDeviceHolds) {
  HandAtFixture hand(FixtureKind::kPose, GuidanceMode::kLead, {100.0, 0.0, 1.0, 2.5, 0.0});
  expectEqual(hand.settle({0.5, 0.0, 0.0}), {-2.5, 0.0, 0.0});
  EXPECT_EQ(hand.fixture.stiffness(), 100.0);
}

TEST(VirtualFixture, AHandThatIsLetGoOfIsNotThrown) {
  HandAtFixture hand;
  hand.message.damping = 0.0;
  hand.settle({0.5, 0.0, 0.0});
  // 30 mm nearer: the anchor was at most that far away
  EXPECT_LT(hand.step({0.5 - 0.031, 0.0, 0.0}).force.norm(), 0.5);
}

TEST(VirtualFixture, AJumpOfTheFixtureIsNoJumpOfTheForce) {
  HandAtFixture hand;
  Vector3 last = hand.settle({0.02, 0.0, 0.0});
  hand.message.X_WF.translation() = {0.3, -0.2, 0.0};
  for (int i = 0; i < 3000; ++i) {
    const Vector3 force = hand.step({0.02, 0.0, 0.0}).force;
    ASSERT_LE((force - last).norm(), kSlope + 1e-9);
    last = force;
  }
  EXPECT_GT(last.x(), 0.0);
}

TEST(VirtualFixture, HoldsBackWhatLeadsAwayAndNothingElse) {
  HandAtFixture hand(FixtureKind::kPose, GuidanceMode::kResist);
  expectEqual(hand.settle({0.10, 0.0, 0.0}), Vector3::Zero());
  double x = 0.10;  // [m]
  for (int i = 0; i < 400; ++i) expectEqual(hand.step({x -= 1e-4, 0.0, 0.0}).force, Vector3::Zero());
  Vector3 force;
  for (int i = 0; i < 100; ++i) force = hand.step({x += 1e-4, 0.0, 0.0}).force;
  EXPECT_NEAR(force.x(), -0.01 * kFixtureStiffness - 0.1 * kDamping, 0.01);
  for (int i = 0; i < 1000; ++i) force = hand.step({x += 1e-4, 0.0, 0.0}).force;
  EXPECT_NEAR(force.x(), -VirtualFixture::kForce, 1e-9);
}

/// Ways in which a fixture ends.
class VirtualFixtureEnd : public ::testing::TestWithParam<int> {};

TEST_P(VirtualFixtureEnd, TheForceFallsToZeroWithoutAJump) {
  HandAtFixture hand;
  double last = hand.settle({0.5, 0.0, 0.0}).norm();
  ASSERT_GT(last, 5.9);
  if (GetParam() == 0) hand.heard = false;
  if (GetParam() == 1) hand.message.mode = GuidanceMode::kOff;
  if (GetParam() == 2) hand.permitted = false;
  if (GetParam() == 3) hand.message.X_WF.translation().x() = std::numeric_limits<double>::quiet_NaN();
  int cycles = 0;
  for (; last > 0.0 && cycles < 1000; ++cycles) {
    const double force = hand.step({0.5, 0.0, 0.0}).force.norm();
    ASSERT_LE(std::abs(force - last), kSlope + 1e-9);
    last = force;
  }
  // stale after 100 ms, then 6 N at 20 N/s
  EXPECT_LE(cycles, 402);
  EXPECT_FALSE(hand.fixture.acts());
  EXPECT_EQ(hand.fixture.stiffness(), 0.0);
}

INSTANTIATE_TEST_SUITE_P(All, VirtualFixtureEnd, ::testing::Range(0, 4));

TEST(VirtualFixture, AnotherChoiceBeginsOnceTheFormerHasEnded) {
  HandAtFixture hand;
  Vector3 last = hand.settle({0.5, 0.0, 0.0});
  hand.message.choice = 2;
  hand.message.X_WF.translation() = {1.0, 0.0, 0.0};
  bool was_zero = false;
  for (int i = 0; i < 2000; ++i) {
    const Vector3 force = hand.step({0.5, 0.0, 0.0}).force;
    ASSERT_LE((force - last).norm(), kSlope + 1e-9);
    if (force.x() > 0.0) {
      ASSERT_TRUE(was_zero);
    }
    was_zero = was_zero || force.isZero(0.0);
    last = force;
  }
  EXPECT_NEAR(last.x(), VirtualFixture::kForce, 1e-9);
}

TEST(VirtualFixture, HearsTheNewestMessageAlone) {
  HandAtFixture hand;
  hand.settle({0.01, 0.0, 0.0});
  Guidance old = hand.message;
  old.tick -= 5;
  old.mode = GuidanceMode::kOff;
  hand.fixture.receive(old);
  expectEqual(hand.settle({0.01, 0.0, 0.0}, 1), {-0.01 * kFixtureStiffness, 0.0, 0.0});
}

/// Kind and mode.
class VirtualFixtureEnergy : public ::testing::TestWithParam<std::tuple<FixtureKind, GuidanceMode>> {};

TEST_P(VirtualFixtureEnergy, ACycleOfTheHandTakesEnergyAndGivesNone) {
  HandAtFixture hand(std::get<0>(GetParam()), std::get<1>(GetParam()));
  // closed curves: small within the spring, large so that the anchor is dragged
  for (const double size : {0.005, 0.02, 0.08}) {
    const auto at = [size](double turn) {
      const double angle = 2.0 * std::numbers::pi * turn;
      return Vector3(size * (1.0 + std::cos(angle)), size * std::sin(2.0 * angle), size * std::sin(angle));
    };
    constexpr int kCycles = 2000;
    for (int i = 0; i < 2 * kCycles; ++i) hand.step(at(double(i) / kCycles));
    double delivered = 0.0;  // [J]
    for (int i = 0; i < kCycles; ++i) {
      const Vector3 force = hand.step(at(double(i) / kCycles)).force;
      delivered += force.dot(at(double(i + 1) / kCycles) - at(double(i) / kCycles));
    }
    // an anchor that moves does work: bounded by its force and speed
    const double anchor =
        std::get<1>(GetParam()) == GuidanceMode::kLead && size > 0.02
            ? VirtualFixture::kForce * VirtualFixture::kGrowth / kFixtureStiffness * kCycles * kTickSeconds
            : 0.0;
    EXPECT_LE(delivered, anchor + 1e-9) << size;
  }
}

TEST_P(VirtualFixtureEnergy, NothingIsDeliveredWhileItEnds) {
  HandAtFixture hand(std::get<0>(GetParam()), std::get<1>(GetParam()));
  hand.settle({0.015, 0.01, 0.012});
  hand.message.mode = GuidanceMode::kOff;
  double delivered = 0.0;  // [J]
  Vector3 before(0.015, 0.01, 0.012);
  for (int i = 0; i < 400; ++i) {
    const Vector3 force = hand.step(before).force;
    const Vector3 now = before + Vector3(1e-4 * std::sin(0.1 * i), 1e-4 * std::cos(0.13 * i), 0.0);
    delivered += force.dot(now - before);
    before = now;
  }
  EXPECT_LE(delivered, 0.5 * kFixtureStiffness * Vector3(0.015, 0.01, 0.012).squaredNorm() + 1e-9);
}

INSTANTIATE_TEST_SUITE_P(All, VirtualFixtureEnergy,
                         ::testing::Combine(::testing::Values(FixtureKind::kPose, FixtureKind::kAxis,
                                                              FixtureKind::kPlane, FixtureKind::kTube),
                                            ::testing::Values(GuidanceMode::kLead, GuidanceMode::kResist)));

TEST(VirtualFixture, AllocatesNothingAndLocksNothing) {
  HandAtFixture hand(FixtureKind::kTube);
  hand.settle({0.1, 0.0, 0.0}, 10);
  const test::RealtimeGuard guard;
  hand.settle({0.1, 0.0, 0.0}, 500);
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::haptic
