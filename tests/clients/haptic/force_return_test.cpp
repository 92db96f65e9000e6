#include <algorithm>
#include <functional>
#include <ostream>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "devices/safety_rules.h"
#include "devices/simulated/hug.h"
#include "tests/clients/haptic/hand_above_floor.h"

// A hand rests on a floor with 5 N. Then its contacts are interrupted, while its person continues to push:
//
//   force  5 N ----.
//                   `.___________.--~~~    never above max(5 N, 3 N), never growing by more than 20 N/s
//                   gap          return

namespace tenon::haptic {
namespace {

using test::HandAboveFloor;

constexpr double kLeastLimit = 3.0;  // [N]
constexpr double kGrowth = 20.0;     // [N/s]
constexpr int kWindow = 20;          // [ticks] over which the growth is measured

/// Where the person's arm wants its hand.
enum class Target { kInScene, kAtDevice };

std::unique_ptr<devices::HapticDevice> openHand(const std::string& name) {
  if (name != "hug-sim") return std::move(*devices::openDevice(name));
  auto arm = std::make_unique<devices::SimulatedDevice>(devices::hugArmModel(), 1);
  EXPECT_TRUE(arm->open());
  return arm;
}

/// As stiff as its device allows.
struct RestingHand : HandAboveFloor {
  explicit RestingHand(const std::string& name, Target where = Target::kInScene)
      : HandAboveFloor(openHand(name), 0.014, devices::safetyLimits(openHand(name)->caps()).stiffness),
        target(where) {
    arm().setContraction(1.0);
    for (int i = 0; i < 1500; ++i) push(Vector3(0.0, 0.0, 0.015));  // the soft start is over
    for (double depth = 0.0; depth < 0.1 && force() < 5.0; depth += 2e-5)
      push(Vector3(0.0, 0.0, 0.012 - depth));
    for (int i = 0; i < 500; ++i) push(p_WI);
    before = force();
    EXPECT_NEAR(before, 5.0, 1.0);
    p_DI = p_WI - hand.workspace().centre();
  }
  void push(const Vector3& at) {
    p_WI = at;
    step(at);
  }
  /// One cycle with the target where it was; `answered`: the server's answer has arrived.
  void hold(bool answered, double dt = kTickSeconds) {
    if (target == Target::kInScene) intend(p_WI);
    if (target == Target::kAtDevice) arm().setIntent(Pose(p_DI));
    if (answered) answer();
    cycle(dt);
  }
  /// The following second.
  void expectSoftReturn(const std::function<void()>& one_cycle) {
    const double limit = std::max(before, kLeastLimit);
    std::vector<double> forces;
    for (int i = 0; i < 1000; ++i) {
      one_cycle();
      forces.push_back(force());
      ASSERT_LE(forces.back(), limit + 1e-3) << i << " ms after the return";
      if (i < 20 + kWindow) continue;  // the old force leaves within 20 ms
      const double growth = (forces.back() - forces[forces.size() - 1 - kWindow]) / (kWindow * kTickSeconds);
      ASSERT_LE(growth, kGrowth + 0.5) << i << " ms after the return";
    }
  }

  Target target;
  Vector3 p_WI, p_DI;
  double before = 0.0;
};

struct GapCase {
  double seconds;
};
void PrintTo(const GapCase& gap, std::ostream* out) { *out << gap.seconds << " s"; }

class ForceReturn : public testing::TestWithParam<std::tuple<std::string, GapCase, Target>> {};

TEST_P(ForceReturn, AfterAGapIsSoft) {
  const auto& [name, gap, target] = GetParam();
  RestingHand setup(name, target);
  const int ticks = static_cast<int>(gap.seconds / kTickSeconds + 0.5);
  for (int i = 0; i < ticks; ++i) {
    setup.hold(false);
    ASSERT_LE(setup.force(), setup.before + 0.1) << i << " ms into the gap";
  }
  if (gap.seconds > 0.13) {
    EXPECT_EQ(setup.force(), 0.0);
  }
  setup.expectSoftReturn([&] { setup.hold(true); });
  for (int i = 0; i < 3000; ++i) setup.hold(true);
  // who pushes on in the scene feels it again; whose arm stays where it sank to rests on the new place of the
  // floor
  if (target == Target::kInScene) {
    EXPECT_NEAR(setup.force(), setup.before, 1.6) << "dry friction of up to 0.8 N, either way";
  }
}

INSTANTIATE_TEST_SUITE_P(
    Gaps, ForceReturn,
    testing::Combine(testing::Values("hug-sim", "sigma7-sim", "omega3-sim", "falcon-sim"),
                     testing::Values(GapCase{0.05}, GapCase{0.15}, GapCase{0.3}, GapCase{0.8}, GapCase{4.0}),
                     testing::Values(Target::kInScene, Target::kAtDevice)),
    [](const auto& one) {
      const std::string& name = std::get<0>(one.param);
      return name.substr(0, name.find('-')) +
             std::to_string(static_cast<int>(std::get<1>(one.param).seconds * 1e3)) +
             (std::get<2>(one.param) == Target::kInScene ? "msScene" : "msDevice");
    });

// The delay of the link swings about the fresh limit, and the person presses on:
//
//   force  5 N --.   .-.                          .---
//                 `._|  `.______________________.´     one return, then none before the link is calm
TEST(ForceReturnAfterManyGaps, AHandThatPressesDoesNotDriftThroughItsWorkspace) {
  for (const int fresh : {20, 50, 90}) {
    RestingHand setup("hug-sim");
    const Vector3 centre = setup.hand.workspace().centre();
    const auto drifted = [&] { return (setup.hand.workspace().centre() - centre).norm(); };
    double first = 0.0;
    for (int gap = 0; gap < 40; ++gap) {
      for (int i = 0; i < 70; ++i) setup.hold(false);
      for (int i = 0; i < fresh; ++i) {
        setup.hold(true);
        ASSERT_LE(setup.force(), setup.before + 0.1);
      }
      if (gap == 0) first = drifted();
    }
    EXPECT_GT(first, 1e-4);
    EXPECT_LE(drifted(), 0.015)
        << "of 40 gaps the arm, which reaches 14 mm into the floor, drifts in two at most; after " << fresh
        << " fresh ms";
    for (int i = 0; i < 6000; ++i) setup.hold(true);
    EXPECT_NEAR(setup.force(), setup.before, 1.6) << "a calm link gives the force back";
  }
}

std::string nameOf(const testing::TestParamInfo<std::string>& device) {
  return device.param.substr(0, device.param.find('-'));
}

class ForceReturnOf : public testing::TestWithParam<std::string> {};

TEST_P(ForceReturnOf, AFreezeIsSoft) {
  RestingHand setup(GetParam());
  HandManifold frozen = setup.server.manifold(setup.tick, setup.hand.pose());
  frozen.frozen = true;
  for (int i = 0; i < 800; ++i) {
    frozen.tick = setup.tick;
    frozen.answers_seq = static_cast<std::uint32_t>(setup.tick);
    setup.hand.receive(frozen);
    setup.hold(false);
    if (i >= 20) {
      ASSERT_EQ(setup.force(), 0.0);
    }
  }
  const double below = frozen.X_WO.translation().z() - setup.hand.pose().translation().z();
  EXPECT_GT(below, 0.005) << "the arm has sunk in";
  setup.expectSoftReturn([&] { setup.hold(true); });
  EXPECT_GT(setup.hand.workspace().shifted().z(), 0.005);
}

TEST_P(ForceReturnOf, AJumpOfTheHeldObjectIsSoft) {
  RestingHand setup(GetParam());
  ++setup.server.epoch;
  setup.server.floor_height += 0.02;  // as much deeper would mean 20 N
  setup.target = Target::kAtDevice;
  setup.expectSoftReturn([&] { setup.hold(true); });
}

TEST_P(ForceReturnOf, AJumpOfTheBodyItTouchesIsSoft) {
  RestingHand setup(GetParam());
  setup.server.lists_floor = true;
  for (int i = 0; i < 50; ++i) setup.hold(true);
  ASSERT_NEAR(setup.force(), setup.before, 0.1);
  ++setup.server.floor_epoch;
  setup.server.floor_height += 0.02;
  setup.target = Target::kAtDevice;
  setup.expectSoftReturn([&] { setup.hold(true); });
}

// a fifth body, for which the manifold's table has no place; `before`: its frame comes before its manifold
TEST_P(ForceReturnOf, AJumpOfABodyThatIsNotListedIsSoft) {
  for (const bool before : {false, true}) {
    RestingHand setup(GetParam());
    ASSERT_FALSE(setup.server.lists_floor);
    for (int i = 0; i < 50; ++i) setup.hold(true);
    ++setup.server.floor_epoch;
    setup.server.floor_height += 0.02;
    setup.target = Target::kAtDevice;
    if (before) {
      setup.world.receive(setup.server.frame(setup.tick));
      setup.hold(false);
    }
    setup.expectSoftReturn([&] { setup.hold(true); });
  }
}

TEST_P(ForceReturnOf, AJumpWhileContactsAreLateIsSoft) {
  RestingHand setup(GetParam());
  constexpr int kLate = 36;  // [ms]
  for (int i = 0; i < kLate; ++i) setup.hold(false);
  const auto hold_late = [&] {
    HandManifold late = setup.server.manifold(setup.tick, setup.hand.pose());
    late.answers_seq = static_cast<std::uint32_t>(setup.tick - kLate);
    setup.world.receive(setup.server.frame(setup.tick));
    setup.hand.receive(late);
    setup.hold(false);
  };
  for (int i = 0; i < 10; ++i) hold_late();
  ASSERT_GT(setup.force(), 2.0) << "faded, not gone";
  ++setup.server.epoch;
  setup.server.floor_height += 0.02;
  setup.target = Target::kAtDevice;
  setup.expectSoftReturn(hold_late);
}

TEST_P(ForceReturnOf, AStopIsSoftOnceThePersonHasPressed) {
  RestingHand setup(GetParam());
  setup.hand.permitForces(false);
  for (int i = 0; i < 500; ++i) {
    setup.hold(true);
    ASSERT_EQ(setup.force(), 0.0);
  }
  setup.hand.permitForces(true);
  for (int i = 0; i < 5; ++i) {
    setup.hold(true);
    ASSERT_FALSE(setup.hand.input().active) << "the device is not armed by the servo thread";
  }
  ASSERT_TRUE(setup.hand.armDevice());
  setup.hand.handBack();
  setup.expectSoftReturn([&] { setup.hold(true); });
  EXPECT_GT(setup.force(), 1.0);
}

TEST_P(ForceReturnOf, AStationThatItselfStoodStillIsSoft) {
  RestingHand setup(GetParam());
  constexpr int slept = 300;  // [ms] in which the arm sinks in
  devices::DeviceState state;
  for (int i = 0; i < slept; ++i) {
    setup.device->read(state);
    setup.device->write({});
  }
  setup.answer();
  setup.hold(false, slept * kTickSeconds);
  setup.expectSoftReturn([&] { setup.hold(true); });
}

//   after a gap the server's answers catch up within 60 cycles, and each fifth cycle of the station is late;
//   the person presses on meanwhile
TEST_P(ForceReturnOf, ABusyMachineIsSoftForASecondOfTheStationsOwnTime) {
  constexpr std::uint32_t kGap = 500, kCatchUp = 60;  // [cycles]
  RestingHand setup(GetParam());
  setup.hand.setLinkJitter(AnswerAge::kLongestJitter);
  const auto acts = [&](devices::SafetyRule rule) {
    return (setup.hand.state().safety_flags & devices::bit(rule)) != 0;
  };
  const auto press = [&](std::uint32_t cycle) {
    const bool is_late = cycle % 5 == 4;
    devices::DeviceState state;
    for (int i = 0; is_late && i < 2; ++i) {
      setup.device->read(state);
      setup.device->write({});
    }
    setup.p_WI.z() -= 2e-6;
    const double dt = is_late ? 3.0 * kTickSeconds : kTickSeconds;
    setup.hold(false, dt);
    return dt;
  };
  for (std::uint32_t i = 0; i < kGap; ++i) {
    static_cast<void>(press(i));
    if (!acts(devices::SafetyRule::kAgeFading)) setup.before = std::max(setup.before, setup.force());
  }
  const double limit = std::max(setup.before, kLeastLimit);
  double since_start = 0.0;  // [s]
  std::uint32_t cycles = 0;
  for (double last = setup.force(); since_start < 1.0; ++cycles) {
    HandManifold answer = setup.server.manifold(setup.tick, setup.hand.pose());
    if (cycles < kCatchUp) answer.answers_seq -= kGap * (kCatchUp - cycles) / kCatchUp;
    setup.world.receive(setup.server.frame(setup.tick));
    setup.hand.receive(answer);
    const double dt = press(cycles);
    const bool starts = acts(devices::SafetyRule::kSoftStart) && !acts(devices::SafetyRule::kAgeFading);
    since_start = starts ? since_start + dt : 0.0;
    if (since_start >= 1.0) break;
    ASSERT_LE(setup.force(), limit + 1e-3) << since_start << " s after the return";
    ASSERT_LE(setup.force() - last, kGrowth * dt + 1e-3 + 2.0 * setup.hand.caps().force_quantum)
        << since_start << " s after the return";
    last = setup.force();
  }
  EXPECT_LT(cycles, 900U) << "fewer cycles than milliseconds";
}

INSTANTIATE_TEST_SUITE_P(Devices, ForceReturnOf,
                         testing::Values("hug-sim", "sigma7-sim", "omega3-sim", "falcon-sim"), nameOf);

// the person presses, brings the device 20 mm up and releases: the hand in the scene has not moved
class ForceReturnOfDesktop : public testing::TestWithParam<std::string> {};

TEST_P(ForceReturnOfDesktop, ADeclutchedDeviceMovesAloneAndItsReturnIsSoft) {
  RestingHand setup(GetParam());
  const std::uint32_t button = setup.hand.caps().declutch;
  ASSERT_NE(button, 0U);
  const Vector3 held = setup.hand.pose().translation();
  const double centre = setup.hand.workspace().centre().z();
  const double device = setup.hand.device().X_DH.translation().z();
  setup.target = Target::kAtDevice;
  setup.arm().setButtons(button);
  for (int i = 0; i < 800; ++i) {
    if (i < 400) setup.p_DI.z() += 5e-5;
    setup.hold(true);
    ASSERT_TRUE(setup.hand.input().active) << "the part is held where it is";
    ASSERT_LT((setup.hand.pose().translation() - held).norm(), 1e-12) << i;
    ASSERT_EQ(setup.hand.input().sample.V_WH.linear, Vector3::Zero());
    ASSERT_LE(setup.force(), setup.before + 0.1) << i;
    if (i > 20) {
      ASSERT_LT(setup.force(), 0.05) << i << ": a little damping at most";
    }
  }
  const double moved = setup.hand.device().X_DH.translation().z() - device;
  EXPECT_GT(moved, 0.005);
  EXPECT_NEAR(setup.hand.workspace().centre().z(), centre - moved, 1e-12);
  setup.arm().setButtons(0);
  setup.expectSoftReturn([&] { setup.hold(true); });
  EXPECT_NEAR(setup.hand.workspace().centre().z(), centre - moved, 0.01)
      << "but for the stretch of the coupling, by which it is re-anchored";
  for (int i = 0; i < 1000; ++i) {
    if (i < 500) setup.p_DI.z() -= 1e-5;
    setup.hold(true);
  }
  EXPECT_GT(setup.force(), 0.5) << "it pushes on from there";
}

INSTANTIATE_TEST_SUITE_P(Devices, ForceReturnOfDesktop,
                         testing::Values("sigma7-sim", "omega3-sim", "falcon-sim"), nameOf);

TEST(ForceReturnOffset, IsSentAndDecaysOutOfContactAlone) {
  RestingHand setup("sigma7-sim", Target::kAtDevice);
  const Vector3 centre = setup.hand.workspace().centre() - setup.hand.workspace().shifted();
  for (int i = 0; i < 300; ++i) setup.hold(false);
  for (int i = 0; i < 1000; ++i) setup.hold(true);
  const Vector3 offset = setup.hand.workspace().shifted();
  EXPECT_GT(offset.z(), 0.002);
  const DeviceInput& input = setup.hand.input();
  const Vector3& p_WC = setup.hand.state().p_WC;
  EXPECT_EQ(p_WC, setup.hand.workspace().centre());
  EXPECT_NEAR((p_WC - centre - offset).norm(), 0.0, 1e-9);
  EXPECT_NEAR((input.sample.X_WH.translation() - p_WC - setup.hand.device().X_DH.translation()).norm(), 0.0,
              1e-12);
  EXPECT_LT(input.sample.V_WH.linear.norm(), 0.01);

  ASSERT_TRUE(setup.hand.inContact());
  double last = offset.norm();
  for (int i = 0; i < 8000; ++i) {
    if (i < 500) setup.p_DI.z() += 1e-4;  // away from the floor
    setup.hold(true);
    const double now = setup.hand.workspace().shifted().norm();
    ASSERT_LE(last - now, 0.05 * kTickSeconds + 1e-9);
    last = now;
  }
  EXPECT_LT(last, 1e-3);
}

TEST(ForceReturnOffset, StaysInContact) {
  RestingHand setup("sigma7-sim");
  for (int i = 0; i < 300; ++i) setup.hold(false);
  for (int i = 0; i < 1500; ++i) setup.hold(true);
  const Vector3 offset = setup.hand.workspace().shifted();
  EXPECT_GT(offset.z(), 0.002);
  for (int i = 0; i < 1000; ++i) {
    setup.hold(true);
    ASSERT_TRUE(setup.hand.inContact());
    ASSERT_EQ(setup.hand.workspace().shifted(), offset);
  }
}

TEST(ForceReturnOffset, IsNotFeltInFreeMotion) {
  HandAboveFloor setup("sigma7-sim");
  for (int i = 0; i < 500; ++i) setup.step(Vector3(0.0, 0.0, 0.03));
  for (int i = 0; i < 300; ++i) {
    setup.intend(Vector3(0.01, 0.0, 0.03));
    setup.cycle();
  }
  for (int i = 0; i < 4000; ++i) {
    setup.step(Vector3(0.01, 0.0, 0.03));
    ASSERT_LT(setup.force(), 0.01);
  }
  EXPECT_NEAR(setup.hand.pose().translation().x(), 0.01, 2e-3);
}

}  // namespace
}  // namespace tenon::haptic
