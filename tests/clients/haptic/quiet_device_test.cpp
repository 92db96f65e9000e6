#include "tests/clients/haptic/quiet_device.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include <gtest/gtest.h>

#include "devices/safety_rules.h"
#include "tests/clients/haptic/hand_above_floor.h"

// A device that stops giving readings and says nothing, at the loop of a hand:
//
//   force  1 N ----.
//                   `.____________________.--~~  the person has pressed: softly, from zero
//          readings |20    100 ms: a fault

namespace tenon::haptic {
namespace {

using devices::DeviceFault;
using test::HandAboveFloor;

/// A sigma.7 that rests on the floor.
struct QuietHand {
  QuietHand() {
    for (int i = 0; i < 3000; ++i) step();
    EXPECT_GT(setup.force(), 1.0);
  }
  void step() { setup.step(Vector3(0.0, 0.0, -0.01)); }
  void press() {
    setup.hand.permitForces(true);
    EXPECT_TRUE(setup.hand.wantsArming());
    EXPECT_TRUE(setup.hand.armDevice());
    setup.hand.handBack();
  }

  test::QuietDevice* device = nullptr;
  HandAboveFloor setup{[this] {
    auto quiet = std::make_unique<test::QuietDevice>(std::move(*devices::openDevice("sigma7-sim")));
    device = quiet.get();
    return quiet;
  }()};
};

TEST(DeviceWithoutReadings, ItsForceFadesAsThatOfOldContactsAndItsHandStandsStill) {
  QuietHand rig;
  const double before = rig.setup.force();
  const Pose held = rig.setup.hand.pose();
  rig.device->quiet = true;
  rig.device->writes = 0;
  double last = before + 0.05;
  bool fault_began = false;
  for (int i = 1; i <= 101; ++i) {
    rig.step();
    EXPECT_EQ(rig.device->writes, i) << "its watchdog is served each cycle";
    EXPECT_LE(rig.setup.force(), last + 1e-9) << i << " ms";
    last = rig.setup.force();
    fault_began = fault_began || rig.setup.hand.events().fault_began;
    if (i == 19) {
      EXPECT_NEAR(last, before, 0.1) << "some readings may be late";
    }
    if (i == 60) {
      EXPECT_LT(last, 0.6 * before);
    }
    if (i > 41) {
      EXPECT_EQ(rig.setup.hand.input().sample.V_WH.linear.norm(), 0.0) << "no speed is known";
    }
  }
  EXPECT_EQ(last, 0.0);
  EXPECT_EQ(rig.setup.hand.device().fault, DeviceFault::kCommunication);
  EXPECT_TRUE(fault_began);
  EXPECT_FALSE(rig.setup.hand.input().active);
  EXPECT_LT((rig.setup.hand.pose().translation() - held.translation()).norm(), 1e-4);
}

TEST(DeviceWithoutReadings, TheDampingOfAHandThatIsLedLeavesGradually) {
  test::QuietDevice* device = nullptr;
  auto quiet = std::make_unique<test::QuietDevice>(std::move(*devices::openDevice("falcon-sim")));
  device = quiet.get();
  HandAboveFloor setup(std::move(quiet));
  Guidance message;
  message.hand = test::kHand;
  message.choice = 1;
  message.stiffness = 200.0;
  message.mode = GuidanceMode::kLead;
  const auto yield = [&] {
    ++message.tick;
    setup.hand.receive(message);
    setup.step(setup.hand.pose().translation());
  };
  for (int i = 0; i < 1500; ++i) yield();
  message.X_WF = Pose(setup.hand.pose().translation() + Vector3(0.03, 0.02, 0.03));
  const auto isDamped = [&] {
    return (setup.hand.state().safety_flags & bit(devices::SafetyRule::kPassivity)) != 0 &&
           setup.hand.state().guidance_force - setup.force() > 0.3;
  };
  for (int i = 0; i < 2000 && !isDamped(); ++i) yield();
  ASSERT_TRUE(isDamped());
  device->quiet = true;
  double last = setup.force();
  for (int i = 1; i <= 110; ++i) {
    yield();
    EXPECT_LE(std::abs(setup.force() - last), 0.12) << i << " ms";
    last = setup.force();
  }
  EXPECT_EQ(last, 0.0);
}

TEST(DeviceWithoutReadings, AfterAFaultItsForceComesBackByThePersonsPressAloneAndSoftly) {
  QuietHand rig;
  const double before = rig.setup.force();
  rig.device->quiet = true;
  for (int i = 0; i < 150; ++i) rig.step();
  rig.device->quiet = false;
  for (int i = 0; i < 500; ++i) {
    rig.step();
    ASSERT_EQ(rig.setup.force(), 0.0) << i << " ms with readings again";
  }
  EXPECT_TRUE(rig.setup.hand.faulty());
  rig.press();
  std::array<double, 1000> force{};
  for (std::size_t i = 0; i < force.size(); ++i) {
    rig.step();
    force[i] = rig.setup.force();
    ASSERT_LE(force[i], std::max(before, 3.0) + 1e-3);
    if (i < 20) continue;
    ASSERT_LE(force[i] - force[i - 20], 20.0 * 0.020 + 0.01) << i;
  }
  EXPECT_FALSE(rig.setup.hand.faulty());
  EXPECT_GT(force.back(), 0.3);
}

TEST(DeviceWithoutReadings, ForLessThanAFaultItComesBackSoftlyByItself) {
  QuietHand rig;
  rig.device->quiet = true;
  for (int i = 0; i < 60; ++i) rig.step();
  rig.device->quiet = false;
  for (int i = 0; i < 40; ++i) rig.step();
  double last = rig.setup.force();
  for (int i = 0; i < 3000; ++i) {
    rig.step();
    ASSERT_LE(rig.setup.force() - last, 0.020 + 0.01) << i;
    last = rig.setup.force();
  }
  EXPECT_GT(last, 1.0);
  EXPECT_EQ(rig.device->arms, 1);
}

// the machine stood still: nothing could be read, and nobody has to press for that
TEST(DeviceWithoutReadings, ACycleOfASecondIsNoFaultOfTheDevice) {
  QuietHand rig;
  rig.device->quiet = true;
  rig.setup.cycle(1.0);
  rig.device->quiet = false;
  for (int i = 0; i < 200; ++i) rig.step();
  EXPECT_EQ(rig.setup.hand.device().fault, DeviceFault::kNone);
}

// a device that paces is early and late; a silent one is waited for
TEST(PacedHand, JitterOfThePaceChangesNoForce) {
  HandAboveFloor setup("sigma7-sim");
  const Vector3 target(0.0, 0.0, -0.01);
  for (int i = 0; i < 3000; ++i) setup.step(target);
  const double steady = setup.force();
  ASSERT_GT(steady, 1.0);
  constexpr std::array kCycles{0.00075, 0.00125, 0.001, 0.003, 0.00076, 0.0012};  // [s]
  for (std::size_t i = 0; i < 3000; ++i) {
    setup.intend(target);
    setup.answer();
    setup.cycle(kCycles[i % kCycles.size()]);
    ASSERT_NEAR(setup.force(), steady, 0.02 * steady) << i;
  }
}

}  // namespace
}  // namespace tenon::haptic
