#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/haptic/answer_age.h"
#include "clients/haptic/bracelet.h"
#include "devices/safety_rules.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/sigma7.h"
#include "devices/simulated/vibrotac.h"
#include "tests/clients/haptic/hand_above_floor.h"

// The rules of docs/safety.md at the loop of a hand, which every force of a station comes from.

namespace tenon::haptic {
namespace {

using devices::DeviceFault;
using devices::SafetyRule;
using test::HandAboveFloor;

std::unique_ptr<devices::SimulatedDevice> opened(const devices::SimulatedModel& model) {
  auto device = std::make_unique<devices::SimulatedDevice>(model, 1);
  EXPECT_TRUE(device->open());
  return device;
}

/// What is called of a device, in order.
class RecordingDevice final : public devices::HapticDevice {
 public:
  explicit RecordingDevice(const devices::DeviceCaps& caps) : caps_(caps) {}
  [[nodiscard]] const devices::DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override {
    calls.emplace_back("arm");
    state.forces_on = true;
    return {};
  }
  void disarm() noexcept override {
    calls.emplace_back("disarm");
    state.forces_on = false;
  }
  [[nodiscard]] Result<void> resetFault() override {
    calls.emplace_back("reset");
    state.fault = DeviceFault::kNone;
    return {};
  }
  void read(devices::DeviceState& out) noexcept override {
    ++state.seq;
    out = state;
  }
  void write(const devices::DeviceCommand& command) noexcept override {
    if (!state.forces_on) return;
    calls.emplace_back(command.brake ? "brake" : "write");
  }

  devices::DeviceState state;
  std::vector<std::string> calls;

 private:
  devices::DeviceCaps caps_;
};

struct RecordedHand {
  explicit RecordedHand(const devices::DeviceCaps& caps) : device(caps), hand(device) {
    hand.begin(test::kHand, ClientId{1}, Vector3::Zero(), true);
    EXPECT_TRUE(hand.armDevice());
    hand.handBack();
    step();
    device.calls.clear();
  }
  void step() { hand.step(++seq, world, kTickSeconds); }

  RecordingDevice device;
  HapticHand hand;
  WorldView world;
  std::uint32_t seq = 0;
};

TEST(HandSafety, AStopBrakesTheDeviceBeforeItSwitchesTheForcesOff) {
  RecordedHand setup(devices::sigma7Model().caps);
  setup.hand.permitForces(false);
  setup.step();
  EXPECT_THAT(setup.device.calls, testing::ElementsAre("brake", "disarm"));
}

TEST(HandSafety, AStationThatIsNotArmedSaysSoAndNoEmergencyStop) {
  RecordingDevice device(devices::sigma7Model().caps);
  HapticHand hand(device);
  WorldView world;
  std::uint32_t seq = 0;
  std::vector<SafetyRule> began;
  const auto step = [&] {
    hand.step(++seq, world, kTickSeconds);
    for (const auto& intervention : hand.events().interventions)
      if (intervention.began) began.push_back(intervention.rule);
    return hand.state().safety_flags;
  };
  hand.begin(test::kHand, ClientId{1}, Vector3::Zero(), false);
  device.state.forces_on = true;
  device.calls.clear();
  EXPECT_TRUE(step() & devices::bit(SafetyRule::kNotArmed));
  EXPECT_THAT(device.calls, testing::ElementsAre("brake", "disarm"));
  EXPECT_FALSE(hand.input().active);
  EXPECT_FALSE(step() & devices::bit(SafetyRule::kEmergencyStop));
  EXPECT_THAT(began, testing::Contains(SafetyRule::kNotArmed));
  EXPECT_THAT(began, testing::Not(testing::Contains(SafetyRule::kEmergencyStop)));
  hand.permitForces(false);
  EXPECT_EQ(step() & (devices::bit(SafetyRule::kNotArmed) | devices::bit(SafetyRule::kEmergencyStop)),
            devices::bit(SafetyRule::kEmergencyStop));
  hand.permitForces(true);
  ASSERT_TRUE(hand.armDevice());
  hand.handBack();
  EXPECT_FALSE(step() & (devices::bit(SafetyRule::kNotArmed) | devices::bit(SafetyRule::kEmergencyStop)));
  EXPECT_TRUE(hand.input().active);
}

TEST(HandSafety, AtTheEndTheForceFallsToZeroAndThenTheDeviceIsDisarmed) {
  test::HandAboveFloor setup("sigma7-sim");
  for (int i = 0; i < 3000; ++i) setup.step(Vector3(0.0, 0.0, 0.005));
  double last = setup.force();
  ASSERT_GT(last, 1.0);
  setup.hand.finish(true);
  for (int i = 0; !setup.hand.finished(); ++i) {
    ASSERT_LT(i, 30) << "no more than 25 ms";
    setup.step(Vector3(0.0, 0.0, 0.005));
    EXPECT_LE(setup.force(), last + 1e-9);
    EXPECT_GE(setup.force(), last - 0.5) << "not at once";
    last = setup.force();
  }
  EXPECT_EQ(last, 0.0);
  devices::DeviceState state;
  setup.device->read(state);
  EXPECT_FALSE(state.forces_on);
  setup.hand.permitForces(true);
  EXPECT_FALSE(setup.hand.wantsArming()) << "the end is the end";
}

TEST(HandSafety, BetweenTwoSeatsTheForceIsZeroAndTheDeviceStaysArmed) {
  RecordedHand setup(devices::sigma7Model().caps);
  setup.hand.finish(false);
  for (int i = 0; i < 30; ++i) setup.step();
  EXPECT_TRUE(setup.hand.finished());
  EXPECT_TRUE(setup.device.state.forces_on);
  EXPECT_THAT(setup.device.calls, testing::Each("write"));
}

TEST(HandSafety, AnOpenClutchBrakesTheDeviceBeforeItSwitchesTheForcesOff) {
  RecordedHand setup(devices::hugArmModel().caps);
  setup.device.state.F_Ho_D_measured.force = {81.0, 0.0, 0.0};
  setup.step();
  EXPECT_THAT(setup.device.calls, testing::ElementsAre("brake", "disarm"));
}

TEST(HandSafety, TheLoopNeitherArmsNorResetsADevice) {
  RecordedHand setup(devices::sigma7Model().caps);
  setup.device.state.fault = DeviceFault::kVelocity;
  setup.device.state.forces_on = false;
  setup.step();
  setup.hand.permitForces(true);  // the person at the device has pressed
  setup.step();
  EXPECT_TRUE(setup.device.calls.empty()) << "left to whoever may block";
  EXPECT_FALSE(setup.hand.input().active);
  ASSERT_TRUE(setup.hand.armDevice());
  setup.hand.handBack();
  EXPECT_THAT(setup.device.calls, testing::ElementsAre("reset", "arm"));
  setup.step();
  EXPECT_TRUE(setup.hand.input().active);
  EXPECT_THAT(setup.device.calls, testing::ElementsAre("reset", "arm", "write"));
}

TEST(HandSafety, OnePressAfterAnOpenClutchIsEnough) {
  RecordedHand setup(devices::hugArmModel().caps);
  setup.device.state.fault = DeviceFault::kClutchOpen;
  setup.device.state.F_Ho_D_measured.force = {81.0, 0.0, 0.0};
  setup.step();
  setup.device.calls.clear();
  setup.hand.permitForces(true);
  setup.step();  // the device, not read meanwhile, was in fault
  setup.device.state.F_Ho_D_measured = {};
  ASSERT_TRUE(setup.hand.armDevice());
  setup.hand.handBack();
  setup.step();
  EXPECT_THAT(setup.device.calls, testing::ElementsAre("reset", "arm", "write"));
}

TEST(HandSafety, AStopBetweenPressAndArmingLeavesTheDeviceUnarmed) {
  RecordedHand setup(devices::sigma7Model().caps);
  setup.device.state.fault = DeviceFault::kVelocity;
  setup.device.state.forces_on = false;
  setup.step();
  setup.hand.permitForces(true);
  setup.hand.permitForces(false);
  ASSERT_TRUE(setup.hand.armDevice());
  EXPECT_TRUE(setup.hand.wantsArming()) << "the loop may not touch it before it is handed back";
  setup.hand.handBack();
  setup.step();
  EXPECT_THAT(setup.device.calls, testing::ElementsAre("reset", "disarm"));
}

TEST(HandSafety, APressWithoutAFaultDoesNotInterruptTheForces) {
  RecordedHand setup(devices::sigma7Model().caps);
  setup.hand.permitForces(true);
  setup.step();
  ASSERT_TRUE(setup.hand.armDevice());
  setup.hand.handBack();
  EXPECT_THAT(setup.device.calls, testing::ElementsAre("write"));
}

TEST(HandSafety, AReleasedDeadManSwitchTakesTheForceAndTheHandAway) {
  devices::SimulatedModel model = devices::sigma7Model();
  model.caps.dead_man = 1U << 2U;
  HandAboveFloor setup(opened(model));
  setup.arm().setButtons(1U << 2U);
  for (int i = 0; i < 3000; ++i) setup.step(Vector3(0.0, 0.0, -0.01));
  ASSERT_GT(setup.force(), 1.0);
  setup.arm().setButtons(1U);  // another one does not count
  setup.step(Vector3(0.0, 0.0, -0.01));
  setup.step(Vector3(0.0, 0.0, -0.01));
  EXPECT_EQ(setup.force(), 0.0);
  EXPECT_FALSE(setup.hand.input().active);
  EXPECT_TRUE(setup.hand.state().safety_flags & devices::bit(SafetyRule::kDeadMan));
}

//   |<- 57 mm wall, armed 2 mm beyond its edge
// an arm whose clutch has opened hangs at the end of its workspace
TEST(HandSafety, WithoutForcesTheWorkspaceStays) {
  RecordedHand recorded(devices::hugArmModel().caps);
  recorded.device.state.X_DH = Pose(Vector3(0.0, 0.0, -0.4));
  recorded.device.state.forces_on = false;
  recorded.device.state.fault = DeviceFault::kClutchOpen;
  recorded.step();
  const Vector3 before = recorded.hand.workspace().centre();
  for (int tick = 0; tick < 5000; ++tick) recorded.step();
  EXPECT_EQ(recorded.hand.workspace().centre(), before);
}

TEST(HandSafety, TheEndOfTheWorkspaceRampsAfterArming) {
  RecordedHand setup(devices::sigma7Model().caps);
  setup.hand.permitForces(false);
  setup.step();
  setup.device.state.X_DH.translation() = {0.059, 0.0, 0.0};
  setup.hand.permitForces(true);
  ASSERT_TRUE(setup.hand.armDevice());
  setup.hand.handBack();
  double last = 0.0;
  for (int i = 0; i < 1000; ++i) {
    setup.step();
    const double now = setup.hand.state().F_Ho_W.force.norm();
    ASSERT_LE(now - last, 0.020 + 1e-9) << i;
    last = now;
  }
  EXPECT_NEAR(last, 2.0, 0.05);
}

TEST(HandSafety, TheAgeOfContactsIsThatOfTheInputTheyAnswerHoweverOftenTheyArrive) {
  HandAboveFloor setup("sigma7-sim");
  for (int i = 0; i < 3000; ++i) setup.step(Vector3(0.0, 0.0, -0.01));
  ASSERT_GT(setup.force(), 1.0);
  HandManifold repeated = setup.server.manifold(setup.tick, setup.hand.pose());
  const double age = setup.hand.contactAge();
  EXPECT_LT(age, 0.003);
  for (int i = 0; i < 150; ++i) {
    repeated.tick = setup.tick + 1;  // a server that runs and does not hear the station
    setup.hand.receive(repeated);
    setup.cycle();
  }
  EXPECT_NEAR(setup.hand.contactAge(), age + 0.150, 0.002);
  EXPECT_EQ(setup.force(), 0.0);
  EXPECT_TRUE(setup.hand.state().safety_flags & devices::bit(SafetyRule::kStale));
  EXPECT_NEAR(setup.hand.state().manifold_age, 150, 4);
}

TEST(HandSafety, TheAgeOfContactsCountsTheTimeThatACycleTook) {
  HandAboveFloor setup("sigma7-sim");
  for (int i = 0; i < 3000; ++i) setup.step(Vector3(0.0, 0.0, -0.01));
  ASSERT_GT(setup.force(), 1.0);
  setup.cycle(0.200);
  EXPECT_NEAR(setup.hand.contactAge(), 0.200, 0.003);
  EXPECT_EQ(setup.force(), 0.0);
}

TEST(AnswerAge, ALinksOwnDelayIsNoGap) {
  AnswerAge age;
  for (std::uint32_t seq = 1; seq <= 3000; ++seq) age.step(seq, seq > 60 ? seq - 60 : 0, 1e-3);
  EXPECT_NEAR(age.age(), 0.060, 1e-9);
  EXPECT_EQ(age.excess(), 0.0);
  for (std::uint32_t seq = 3001; seq <= 3090; ++seq) age.step(seq, 2940, 1e-3);
  EXPECT_NEAR(age.excess(), 0.030, 1e-9) << "150 ms, of which twice the delay is the link's";
  age.step(3091, 77777, 1e-3);
  EXPECT_TRUE(std::isinf(age.age())) << "an answer to what this station never asked";
}

TEST(AnswerAge, JitterThatWasMeasuredIsNoGapUpToItsBound) {
  AnswerAge age;
  for (std::uint32_t seq = 1; seq <= 3000; ++seq) age.step(seq, seq > 5 ? seq - 5 : 0, 1e-3);
  for (std::uint32_t seq = 3001; seq <= 3070; ++seq) age.step(seq, 2995, 1e-3);
  EXPECT_NEAR(age.excess(), 0.065, 1e-9) << "75 ms, of which twice the delay is the link's";
  age.setJitter(0.030);
  EXPECT_NEAR(age.excess(), 0.040, 1e-9);
  age.setJitter(10.0);
  EXPECT_NEAR(age.excess(), 0.020, 1e-9) << "50 ms of it";
  age.setJitter(std::numeric_limits<double>::quiet_NaN());
  EXPECT_NEAR(age.excess(), 0.065, 1e-9);
}

// the delay of the link is that of the last answers, also when they are long ago
TEST(AnswerAge, AfterALongGapOldAnswersAreNotFresh) {
  AnswerAge age;
  std::uint32_t seq = 0;
  while (++seq <= 3000) age.step(seq, seq > 2 ? seq - 2 : 0, 1e-3);
  for (; seq <= 8800; ++seq) age.step(seq, 2998, 1e-3);
  age.step(seq, seq - 300, 1e-3);
  EXPECT_NEAR(age.excess(), 0.296, 1e-9);
}

TEST(AnswerAge, ALinkIsTooLongOnceItsAnswersHaveBeenForASecond) {
  AnswerAge age;
  std::uint32_t seq = 0;
  const auto stepWith = [&](std::uint32_t delay) {
    ++seq;
    age.step(seq, seq > delay ? seq - delay : 0, 1e-3);
  };
  while (seq < 300) stepWith(2);
  while (seq < 320 + 900) stepWith(400);  // answers of 0.9 s, among them those of the last windows
  EXPECT_FALSE(age.isTooLong());
  while (seq < 300 + 4000) stepWith(330);
  EXPECT_FALSE(age.isTooLong()) << "the delay is the smallest age within two windows of 2 s";
  while (seq < 300 + 6000) stepWith(330);
  EXPECT_TRUE(age.isTooLong());
  EXPECT_NEAR(age.delay(), 0.33, 1e-9);
  stepWith(315);
  EXPECT_TRUE(age.isTooLong()) << "hysteresis";
  stepWith(300);
  EXPECT_FALSE(age.isTooLong()) << "150 ms one way";
}

TEST(AnswerAge, ALateAnswerAfterAnInterruptionIsNoLongLink) {
  AnswerAge age;
  std::uint32_t seq = 0;
  while (++seq <= 3000) age.step(seq, seq > 10 ? seq - 10 : 0, 1e-3);
  const std::uint32_t last = seq - 11;
  for (; seq <= 9000; ++seq) age.step(seq, last, 1e-3);
  age.step(seq, seq - 500, 1e-3);  // the only answer for a while
  for (++seq; seq <= 10'500; ++seq) age.step(seq, 8501, 1e-3);
  age.step(seq, seq - 500, 1e-3);
  EXPECT_FALSE(age.isTooLong());
}

TEST(Bracelet, IsSilentAndDisarmedAtTheEnd) {
  RecordingDevice device(devices::Vibrotac().caps());
  Bracelet bracelet(device, {});
  bracelet.begin(test::kHand, true);
  EXPECT_TRUE(bracelet.armDevice());
  bracelet.handBack();
  bracelet.step(1, kTickSeconds);
  bracelet.finish(true);
  bracelet.step(2, kTickSeconds);
  EXPECT_THAT(device.calls, testing::ElementsAre("arm", "write", "write", "disarm"));
  EXPECT_THAT(bracelet.intensities(), testing::Each(0));
  bracelet.permit(false);
  bracelet.permit(true);
  EXPECT_FALSE(bracelet.wantsArming());
}

TEST(Bracelet, VibratesAsLongAsItsContactsAreFreshAndNoStopSilencesIt) {
  devices::Vibrotac device;
  Bracelet bracelet(device, {});
  bracelet.begin(test::kHand, true);
  EXPECT_TRUE(bracelet.armDevice());
  bracelet.handBack();
  HandManifold pressed;
  pressed.hand = test::kHand;
  ManifoldContact contact;
  contact.p_BoP_B = Vector3f(0.0F, 0.0F, 0.04F);
  contact.gap = -0.004F;
  pressed.contacts.push_back(contact);
  std::uint32_t seq = 0;
  const auto run = [&](int ticks, bool answered) {
    for (int i = 0; i < ticks; ++i) {
      pressed.tick = seq;
      pressed.answers_seq = seq;
      if (answered) bracelet.receive(pressed);
      bracelet.step(++seq, kTickSeconds);
    }
    return bracelet.intensities()[0];
  };
  const int fresh = run(200, true);
  EXPECT_GT(fresh, 100);
  EXPECT_GT(device.amplitudes()[0], 0.3);
  const int fading = run(60, false);
  EXPECT_LT(fading, fresh);
  EXPECT_GT(fading, 0);
  EXPECT_EQ(run(60, false), 0) << "aged out";
  EXPECT_GT(run(200, true), 100);
  bracelet.permit(false);
  EXPECT_EQ(run(1, true), 0);
  run(400, true);
  EXPECT_LT(device.amplitudes()[0], 0.01);
  bracelet.permit(true);
  ASSERT_TRUE(bracelet.armDevice());
  bracelet.handBack();
  EXPECT_GT(run(200, true), 100);
}

}  // namespace
}  // namespace tenon::haptic
