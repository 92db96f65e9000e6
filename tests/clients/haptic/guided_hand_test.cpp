#include <algorithm>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "clients/haptic/virtual_fixture.h"
#include "devices/safety_rules.h"
#include "tests/clients/haptic/hand_above_floor.h"

// A virtual fixture in the loop of a hand: with its contacts, and through the safety layer.

namespace tenon::haptic {
namespace {

using test::HandAboveFloor;

/// A hand whose arm yields: it wants to be where it is.
struct GuidedHand : HandAboveFloor {
  /// `coupling` [N/m].
  explicit GuidedHand(const std::string& name, double coupling = 1000.0)
      : HandAboveFloor(std::move(*devices::openDevice(name)), 0.03, coupling) {
    message.hand = test::kHand;
    message.choice = 1;
    message.stiffness = 200.0;
    message.damping = 2.0;
    for (int i = 0; i < 1500; ++i) yield();
    message.X_WF = hand.pose();
  }
  void yield() {
    ++message.tick;
    if (heard) hand.receive(message);
    step(hand.pose().translation());
  }
  void lead(const Vector3& p_WF) {
    message.mode = GuidanceMode::kLead;
    message.X_WF = Pose(p_WF);
  }
  [[nodiscard]] double distance() const {
    return (hand.pose().translation() - message.X_WF.translation()).norm();
  }

  Guidance message;
  bool heard = true;
};

class GuidedHandOf : public ::testing::TestWithParam<const char*> {};

TEST_P(GuidedHandOf, AnArmThatYieldsIsLedToTheInstructorsHand) {
  GuidedHand setup(GetParam());
  setup.lead(setup.hand.pose().translation() + Vector3(0.03, 0.02, 0.03));
  double last = setup.hand.state().guidance_force;
  for (int i = 0; i < 6000; ++i) {
    setup.yield();
    const double guidance = setup.hand.state().guidance_force;
    ASSERT_LE(setup.force(), VirtualFixture::kForce + 1e-9);
    ASSERT_LE(guidance - last, 0.1) << "no jolt, millisecond " << i;
    last = guidance;
  }
  EXPECT_LT(setup.distance(), 0.003);
}

TEST_P(GuidedHandOf, AStopTakesItsForceAtOnceAndAfterwardsItBeginsFromZero) {
  GuidedHand setup(GetParam());
  const Vector3 held = setup.hand.pose().translation();
  const auto hold = [&] {
    ++setup.message.tick;
    setup.hand.receive(setup.message);
    setup.step(held);
  };
  setup.lead(held + Vector3(0.0, 0.2, 0.0));
  for (int i = 0; i < 2000; ++i) hold();
  ASSERT_GT(setup.force(), 1.0);
  setup.hand.permitForces(false);
  hold();
  EXPECT_EQ(setup.force(), 0.0);
  EXPECT_EQ(setup.hand.state().guidance_force, 0.0F);
  setup.hand.permitForces(true);
  ASSERT_TRUE(setup.hand.armDevice());
  setup.hand.handBack();
  double last = 0.0;
  for (int i = 0; i < 2000; ++i) {
    hold();
    const double guidance = setup.hand.state().guidance_force;
    ASSERT_LE(guidance - last, 0.1);
    ASSERT_LE(setup.force(), VirtualFixture::kForce + 1e-9);
    last = guidance;
  }
  EXPECT_GT(setup.force(), 1.0) << "it was not ended";
}

/// A guided hand whose answers come `delay` [ms] after their inputs.
struct FarGuidedHand : GuidedHand {
  using GuidedHand::GuidedHand;

  void hold(const Vector3& p_WI) {
    ++message.tick;
    if (heard) hand.receive(message);
    intend(p_WI);
    ++tick;
    world.receive(server.frame(tick));
    HandManifold manifold = server.manifold(tick, hand.pose());
    manifold.answers_seq = tick > delay ? static_cast<std::uint32_t>(tick - delay) : 0;
    hand.receive(manifold);
    hand.step(static_cast<std::uint32_t>(tick), world, kTickSeconds);
    if (hand.events().guidance_alone_began) ++began;
    if (hand.events().guidance_alone_ended) ++ended;
    largest_step = std::max(largest_step, force() - last_force);
    last_force = force();
  }
  void holdFor(int milliseconds, const Vector3& p_WI) {
    for (int i = 0; i < milliseconds; ++i) hold(p_WI);
  }

  Tick delay = 1;  ///< [ticks] there and back
  int began = 0, ended = 0;
  double last_force = 0.0, largest_step = 0.0;  ///< [N]
};

TEST_P(GuidedHandOf, OverALinkTooLongForContactsIsGuidedAndFeelsNoContact) {
  FarGuidedHand setup(GetParam());
  const Vector3 into_floor(0.0, 0.0, 0.002);  // within the workspace, also without the floor
  setup.holdFor(2000, into_floor);
  ASSERT_GT(setup.force(), 0.5) << "the floor is felt";
  // [N] in a millisecond: 0.02 of its growth, and the velocity's noise in the damping of a hand that is led
  const double no_jolt = 0.15;
  setup.delay = 330;  // 165 ms one way
  setup.holdFor(6000, into_floor);
  EXPECT_EQ(setup.began, 1) << "it is told once";
  EXPECT_EQ(setup.ended, 0);
  EXPECT_NEAR(setup.hand.linkDelay(), 0.165, 1e-9);
  EXPECT_NEAR(setup.force(), 0.0, 0.01) << "no contact";
  setup.lead(setup.hand.pose().translation() + Vector3(0.0, 0.025, 0.0));
  setup.last_force = setup.force();
  setup.largest_step = 0.0;
  setup.holdFor(3000, into_floor);
  EXPECT_GT(setup.hand.state().guidance_force, 1.0F);
  EXPECT_GT(setup.force(), 1.0) << "it passes the safety layer";
  EXPECT_LE(setup.largest_step, no_jolt);
  setup.heard = false;
  setup.holdFor(500, into_floor);
  EXPECT_NEAR(setup.force(), 0.0, 0.01) << "its messages have an age of their own";
  setup.delay = 250;
  setup.holdFor(3000, into_floor);
  EXPECT_EQ(setup.ended, 1);
  EXPECT_EQ(setup.began, 1);
  EXPECT_GT(setup.force(), 0.5) << "contacts are felt again";
  EXPECT_LE(setup.largest_step, no_jolt);
}

TEST_P(GuidedHandOf, WhenMessagesEndTheForceFallsToZeroWithoutAJump) {
  GuidedHand setup(GetParam());
  const Vector3 held = setup.hand.pose().translation();
  setup.lead(held + Vector3(0.0, 0.2, 0.0));
  for (int i = 0; i < 2000; ++i) {
    ++setup.message.tick;
    setup.hand.receive(setup.message);
    setup.step(held);
  }
  double last = setup.force();
  ASSERT_GT(last, 1.0);
  for (int i = 0; i < 450; ++i) {
    setup.step(held);
    ASSERT_LE(std::abs(setup.force() - last), 0.2);
    last = setup.force();
  }
  EXPECT_FALSE(setup.hand.fixture().acts());
  EXPECT_EQ(setup.hand.state().guidance_force, 0.0F);
}

TEST_P(GuidedHandOf, IsLedThroughNoWall) {
  GuidedHand setup(GetParam());
  setup.lead(Vector3(0.0, 0.0, -0.10));
  for (int i = 0; i < 6000; ++i) {
    setup.yield();
    ASSERT_LE(setup.force(), setup.device->caps().peak_force + 1e-9);
  }
  EXPECT_GT(setup.hand.local().proxy().X_WO.translation().z(), 0.0);
  EXPECT_GT(setup.hand.pose().translation().z(), 0.0) << "the contact is stiffer than the fixture";
}

TEST_P(GuidedHandOf, SpringsInParallelAreWithinWhatTheDeviceRendersStably) {
  GuidedHand setup(GetParam(), 1e4);
  const auto isLimited = [&] {
    return (setup.hand.state().safety_flags & devices::bit(devices::SafetyRule::kStiffnessLimited)) != 0;
  };
  EXPECT_FALSE(isLimited()) << "the coupling alone is as stiff as the device renders";
  setup.lead(Vector3(0.0, 0.0, -0.10));
  for (int i = 0; i < 3000; ++i) setup.yield();
  EXPECT_TRUE(isLimited());
  for (int i = 0; i < 2000; ++i) {
    setup.yield();
    EXPECT_LT(setup.hand.device().V_DH.linear.norm(), 0.02) << "at rest at the floor";
  }
}

//  a fixture that leads along the floor begins and ends where the hand presses on it: contact and fixture are
//  together stiffer than the device renders, so the contact's force is scaled, and that without a jump
TEST(GuidedHand, AContactBesideItGrowsSofterAndFirmerWithoutAJump) {
  GuidedHand setup("sigma7-sim", 1e4);
  const Vector3 pressed(0.0, 0.0, -0.002);
  for (int i = 0; i < 3000; ++i) setup.step(pressed);
  double last = setup.force();
  ASSERT_GT(last, 1.0);
  const auto press = [&](int cycles) {
    for (int i = 0; i < cycles; ++i) {
      ++setup.message.tick;
      setup.hand.receive(setup.message);
      setup.step(pressed);
      ASSERT_LE(std::abs(setup.force() - last), 0.1) << "millisecond " << i;
      last = setup.force();
    }
  };
  setup.lead(pressed + Vector3(0.0, 0.01, 0.0));
  press(1000);
  setup.message.mode = GuidanceMode::kOff;
  press(1000);
}

INSTANTIATE_TEST_SUITE_P(Devices, GuidedHandOf, ::testing::Values("sigma7-sim", "falcon-sim", "omega3-sim"));

}  // namespace
}  // namespace tenon::haptic
