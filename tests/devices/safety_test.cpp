#include "devices/safety.h"

#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/sigma7.h"
#include "idl/types/messages.h"
#include "tests/support/realtime_guard.h"

namespace tenon {
namespace {

constexpr double kTick = 1e-3;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

DeviceState armed() {
  DeviceState state;
  state.forces_on = true;
  return state;
}

SafetyRequest wantForce(const Vector3& force, double age = 0.0) {
  SafetyRequest request;
  request.wanted.F_Ho_D.force = force;
  request.age = age;
  return request;
}

/// A layer that has shown `force` long enough for soft start and slew to be over.
Safety settled(const DeviceCaps& caps, const Vector3& force, ClutchLatch* clutch = nullptr) {
  Safety safety(caps, clutch);
  for (int tick = 0; tick < 1000; ++tick) (void)safety.step(wantForce(force), armed(), kTick);
  return safety;
}

const DeviceCaps kSigma = sigma7Model().caps;
const DeviceCaps kHug = hugArmModel().caps;
const DeviceCaps kFalcon = falconModel().caps;

TEST(Safety, LetsAModestFreshForceThroughUnchanged) {
  Safety safety = settled(kSigma, {1.0, 2.0, 3.0});
  const DeviceCommand shown = safety.step(wantForce({1.0, 2.0, 3.0}), armed(), kTick);
  EXPECT_EQ(shown.F_Ho_D.force, Vector3(1.0, 2.0, 3.0));
  EXPECT_FALSE(shown.brake);
  EXPECT_EQ(safety.flags(), 0U);
}

TEST(Safety, ShowsNothingForAForceThatIsNoNumber) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  for (const double bad : {kNan, std::numeric_limits<double>::infinity()}) {
    const DeviceCommand shown = safety.step(wantForce({1.0, bad, 0.0}), armed(), kTick);
    EXPECT_EQ(shown.F_Ho_D.force, Vector3(Vector3::Zero()));
    EXPECT_TRUE(safety.acts(SafetyRule::kNotFinite));
  }
  SafetyRequest odd = wantForce({1.0, 0.0, 0.0});
  odd.stiffness = kNan;
  EXPECT_EQ(safety.step(odd, armed(), kTick).F_Ho_D.force, Vector3(Vector3::Zero()));
}

// share of the force
//   1 |-------.
//     |        '.
//   0 |__________'.____ age
//     0     10   30 ms
TEST(Safety, FadesAForceOlderThanTenMillisecondsAndDisarmsAtThirty) {
  Safety safety = settled(kSigma, {4.0, 0.0, 0.0});
  const auto shownAt = [&](double age) {
    return safety.step(wantForce({4.0, 0.0, 0.0}, age), armed(), kTick).F_Ho_D.force.x();
  };
  EXPECT_DOUBLE_EQ(shownAt(0.010), 4.0);
  EXPECT_FALSE(safety.acts(SafetyRule::kAged));
  EXPECT_NEAR(shownAt(0.020), 2.0, 1e-12);
  EXPECT_TRUE(safety.acts(SafetyRule::kAged));
  EXPECT_FALSE(safety.wantsDisarm());
  EXPECT_DOUBLE_EQ(shownAt(0.030), 0.0);
  EXPECT_TRUE(safety.acts(SafetyRule::kStale));
  EXPECT_TRUE(safety.wantsDisarm());
  EXPECT_DOUBLE_EQ(shownAt(kNan), 0.0);
}

TEST(Safety, LimitsAForceWithoutTurningIt) {
  Safety safety = settled(kHug, {300.0, 400.0, 0.0});
  const Vector3 shown = safety.step(wantForce({300.0, 400.0, 0.0}), armed(), kTick).F_Ho_D.force;
  EXPECT_NEAR(shown.norm(), 50.0, 1e-9) << "HUG's arms could do 150 N, the command ceiling is 50";
  EXPECT_NEAR(shown.y() / shown.x(), 400.0 / 300.0, 1e-12);
  EXPECT_TRUE(safety.acts(SafetyRule::kForceLimited));
}

TEST(Safety, LimitsTorqueToo) {
  Safety safety(kSigma);
  SafetyRequest request;
  request.wanted.F_Ho_D.torque = {0.0, 3.0, 0.0};
  DeviceCommand shown;
  for (int tick = 0; tick < 1000; ++tick) shown = safety.step(request, armed(), kTick);
  EXPECT_NEAR(shown.F_Ho_D.torque.y(), 0.4, 1e-12);
  EXPECT_TRUE(safety.acts(SafetyRule::kForceLimited));
}

TEST(Safety, GivesPeakForceForAWhileAndThenWhatTheMotorsBearForEver) {
  Safety safety = settled(kSigma, {20.0, 0.0, 0.0});
  const auto push = [&] { return safety.step(wantForce({20.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x(); };
  EXPECT_DOUBLE_EQ(push(), 20.0) << "a second at peak is fine";
  double last = 20.0;
  double largest_drop = 0.0;
  for (int tick = 0; tick < 120000; ++tick) {
    const double now = push();
    largest_drop = std::max(largest_drop, last - now);
    last = now;
  }
  EXPECT_LT(last, 13.0);
  EXPECT_GE(last, 12.0 - 1e-9);
  EXPECT_LT(largest_drop, 0.05) << "the limit sinks, it does not jump";
  EXPECT_TRUE(safety.acts(SafetyRule::kThermal));
  // a rest of a minute cools the motors
  for (int tick = 0; tick < 60000; ++tick) (void)safety.step(wantForce({0.0, 0.0, 0.0}), armed(), kTick);
  for (int tick = 0; tick < 100; ++tick) last = push();
  EXPECT_DOUBLE_EQ(last, 20.0);
}

TEST(Safety, LimitsTheGrowthOfAForceButNeverItsFall) {
  Safety safety = settled(kSigma, {2.0, 0.0, 0.0});
  const auto shownFor = [&](double x) {
    return safety.step(wantForce({x, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x();
  };
  EXPECT_NEAR(shownFor(10.0), 2.5, 1e-9) << "500 N/s";
  EXPECT_TRUE(safety.acts(SafetyRule::kSlewed));
  EXPECT_NEAR(shownFor(10.0), 3.0, 1e-9);
  EXPECT_NEAR(shownFor(0.5), 0.5, 1e-9) << "falls at once";
  EXPECT_FALSE(safety.acts(SafetyRule::kSlewed));
  EXPECT_NEAR(shownFor(-10.0), -0.5, 1e-9) << "the old direction falls at once, the new one grows";
}

TEST(Safety, StartsSoftlyInHalfASecondAfterArming) {
  Safety safety(kHug);
  const SafetyRequest request = wantForce({10.0, 0.0, 0.0});
  (void)safety.step(request, DeviceState{}, kTick);
  EXPECT_TRUE(safety.acts(SafetyRule::kForcesOff));
  double last = 0.0;
  for (int tick = 1; tick <= 500; ++tick) {
    const double now = safety.step(request, armed(), kTick).F_Ho_D.force.x();
    EXPECT_NEAR(now, 10.0 * tick / 500.0, 1e-6);
    EXPECT_GT(now, last);
    EXPECT_EQ(safety.acts(SafetyRule::kSoftStart), tick < 500);
    last = now;
  }
}

TEST(Safety, LowersAStiffnessTheDeviceCannotShowPassively) {
  // sigma.7: b = 1 Ns/m at 1 kHz bears 2b/T = 2000 N/m; the spring was made with 8000 N/m
  EXPECT_DOUBLE_EQ(safetyLimits(kSigma).stiffness, 2000.0);
  Safety safety = settled(kSigma, {8.0, 0.0, 0.0});
  SafetyRequest request = wantForce({8.0, 0.0, 0.0});
  request.stiffness = 8000.0;
  EXPECT_NEAR(safety.step(request, armed(), kTick).F_Ho_D.force.x(), 2.0, 1e-9);
  EXPECT_TRUE(safety.acts(SafetyRule::kStiffnessLowered));
  request.stiffness = 2000.0;
  for (int tick = 0; tick < 20; ++tick) (void)safety.step(request, armed(), kTick);
  EXPECT_NEAR(safety.step(request, armed(), kTick).F_Ho_D.force.x(), 8.0, 1e-9);
  EXPECT_FALSE(safety.acts(SafetyRule::kStiffnessLowered));
}

TEST(Safety, ADelayLowersTheStiffnessItAllows) {
  DeviceCaps slow = kSigma;
  slow.delay = 1e-3;
  EXPECT_NEAR(safetyLimits(slow).stiffness, 1.0 / (0.5e-3 + 1e-3), 1e-9);
}

TEST(Safety, DampsWhenThePortGaveMoreEnergyThanItTook) {
  // a source that pushes along with the motion: negative damping, the mark of an unstable loop
  Safety safety = settled(kHug, {20.0, 0.0, 0.0});
  DeviceState state = armed();
  state.V_DH.linear = {0.3, 0.0, 0.0};
  DeviceCommand shown;
  for (int tick = 0; tick < 50; ++tick) {
    state.X_DH.translation() += kTick * state.V_DH.linear;
    shown = safety.step(wantForce({20.0, 0.0, 0.0}), state, kTick);
  }
  EXPECT_LT(safety.energy(), 0.0);
  EXPECT_TRUE(safety.acts(SafetyRule::kPassivity));
  EXPECT_NEAR(shown.F_Ho_D.force.x(), 20.0 - kHug.injected_damping * 0.3, 1e-9)
      << "no more damping than the velocity's lag allows";
}

TEST(Safety, ASpringThatGivesBackWhatItTookIsLeftAlone) {
  Safety safety(kHug);
  DeviceState state = armed();
  for (int tick = 0; tick < 1000; ++tick) (void)safety.step(wantForce({0, 0, 0}), state, kTick);
  double x = 0.0;
  for (int tick = 0; tick < 400; ++tick) {
    x += tick < 200 ? 5e-5 : -5e-5;
    state.X_DH.translation().x() = x;
    state.V_DH.linear.x() = tick < 200 ? 0.05 : -0.05;
    // the force of the middle of the last and the next millisecond, as continuous contact would have it
    const double middle = x + (tick < 200 ? 2.5e-5 : -2.5e-5);
    (void)safety.step(wantForce({-1000.0 * middle, 0.0, 0.0}), state, kTick);
    EXPECT_FALSE(safety.acts(SafetyRule::kPassivity)) << tick;
  }
}

TEST(Safety, BrakesAHandThatIsTooFastUntilItIsSlowAgain) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  DeviceState state = armed();
  const auto brakesAt = [&](double speed) {
    state.V_DH.linear = {0.0, speed, 0.0};
    return safety.step(wantForce({1.0, 0.0, 0.0}), state, kTick).brake;
  };
  EXPECT_FALSE(brakesAt(0.5));
  EXPECT_TRUE(brakesAt(0.51));
  EXPECT_TRUE(safety.acts(SafetyRule::kOverspeed));
  EXPECT_TRUE(brakesAt(0.4)) << "no chatter about the limit";
  EXPECT_FALSE(brakesAt(0.2));
  EXPECT_TRUE(safety.acts(SafetyRule::kSoftStart)) << "and starts softly";
  EXPECT_TRUE(brakesAt(kNan));
}

// |F|        /
//    |      /    the last twentieth of the radius pushes back
//    |_____/___ r
//       .95 R  R
TEST(Safety, PushesBackAtTheEndOfTheWorkspace) {
  Safety safety = settled(kSigma, {0.0, 0.0, 0.0});
  DeviceState state = armed();
  state.X_DH.translation() = {0.0, 0.0, 0.95 * 0.060 + 1e-3};
  const DeviceCommand shown = safety.step(wantForce({0.0, 0.0, 0.0}), state, kTick);
  EXPECT_NEAR(shown.F_Ho_D.force.z(), -1000.0 * 1e-3, 1e-9);
  EXPECT_TRUE(safety.acts(SafetyRule::kWorkspaceWall));
}

TEST(Safety, WarnsAtSixtyNewtonAndStopsBothArmsAtEightyUntilReset) {
  ClutchLatch clutch;
  Safety right = settled(kHug, {1.0, 0.0, 0.0}, &clutch);
  Safety left = settled(kHug, {1.0, 0.0, 0.0}, &clutch);
  DeviceState state = armed();

  state.F_Ho_D_measured.force = {0.0, -61.0, 0.0};
  EXPECT_FALSE(right.step(wantForce({1.0, 0.0, 0.0}), state, kTick).brake);
  EXPECT_TRUE(right.acts(SafetyRule::kClutchWarning));

  state.F_Ho_D_measured.force = {50.0, -50.0, 50.0};  // 87 N in a direction that is no axis
  EXPECT_TRUE(right.step(wantForce({1.0, 0.0, 0.0}), state, kTick).brake);
  EXPECT_TRUE(right.acts(SafetyRule::kClutchOpen));

  const DeviceCommand other = left.step(wantForce({1.0, 0.0, 0.0}), armed(), kTick);
  EXPECT_TRUE(other.brake);
  EXPECT_EQ(other.F_Ho_D.force, Vector3(Vector3::Zero()));
  EXPECT_TRUE(left.wantsDisarm());

  for (int tick = 0; tick < 5000; ++tick) {
    EXPECT_TRUE(right.step(wantForce({1.0, 0.0, 0.0}), armed(), kTick).brake) << "latched";
  }
  right.reset();
  left.reset();
  EXPECT_FALSE(right.step(wantForce({1.0, 0.0, 0.0}), armed(), kTick).brake);
  EXPECT_FALSE(left.step(wantForce({1.0, 0.0, 0.0}), armed(), kTick).brake);
  EXPECT_TRUE(left.acts(SafetyRule::kSoftStart));
}

TEST(Safety, AMeasuredForceThatIsNoNumberOpensTheClutch) {
  Safety safety = settled(kHug, {1.0, 0.0, 0.0});
  DeviceState state = armed();
  state.F_Ho_D_measured.force = {kNan, 0.0, 0.0};
  EXPECT_TRUE(safety.step(wantForce({1.0, 0.0, 0.0}), state, kTick).brake);
  EXPECT_TRUE(safety.step(wantForce({1.0, 0.0, 0.0}), armed(), kTick).brake)
      << "latched without a partner, too";
}

TEST(Safety, AnEmergencyStopHoldsUntilAnOperatorResets) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  SafetyRequest request = wantForce({1.0, 0.0, 0.0});
  request.wanted.tactors = {255, 0, 0, 0, 0, 0};
  request.emergency_stop = true;
  const DeviceCommand stop = safety.step(request, armed(), kTick);
  EXPECT_TRUE(stop.brake);
  EXPECT_EQ(stop.F_Ho_D.force, Vector3(Vector3::Zero()));
  EXPECT_EQ(stop.tactors[0], 0);
  request.emergency_stop = false;
  EXPECT_TRUE(safety.step(request, armed(), kTick).brake);
  EXPECT_TRUE(safety.acts(SafetyRule::kEmergencyStop));
  safety.reset();
  EXPECT_FALSE(safety.step(request, armed(), kTick).brake);
}

TEST(Safety, ShowsNoForceToAHandThatLetGo) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  SafetyRequest request = wantForce({1.0, 0.0, 0.0});
  request.dead_man = false;
  EXPECT_EQ(safety.step(request, armed(), kTick).F_Ho_D.force, Vector3(Vector3::Zero()));
  EXPECT_TRUE(safety.acts(SafetyRule::kDeadMan));
  request.dead_man = true;
  EXPECT_LT(safety.step(request, armed(), kTick).F_Ho_D.force.x(), 0.01) << "soft start when it is back";
}

TEST(Safety, ShowsWholeMotorWordsAndNeverMoreThanAWordCanSay) {
  const double quantum = kFalcon.force_quantum;
  Safety safety = settled(kFalcon, {3.0, 0.0, 0.0});
  const double shown = safety.step(wantForce({3.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x();
  EXPECT_NEAR(shown, 3.0, quantum);
  EXPECT_DOUBLE_EQ(shown, std::floor(3.0 / quantum) * quantum) << "rounded towards zero";

  DeviceCaps weak = kFalcon;
  weak.force_quantum /= 2.0;  // now 4096 words are only half the peak
  Safety clamping = settled(weak, {5.0, 0.0, 0.0});
  EXPECT_DOUBLE_EQ(clamping.step(wantForce({5.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x(), 4.0);
  EXPECT_TRUE(clamping.acts(SafetyRule::kWordClamped));
}

TEST(Safety, AsksOnlyForAxesTheDeviceHas) {
  Safety safety(kFalcon);
  SafetyRequest request = wantForce({1.0, 0.0, 0.0});
  request.wanted.F_Ho_D.torque = {1.0, 1.0, 1.0};
  for (int tick = 0; tick < 600; ++tick) {
    EXPECT_EQ(safety.step(request, armed(), kTick).F_Ho_D.torque, Vector3(Vector3::Zero()));
  }
  EXPECT_EQ(safety.flags(), 0U);
}

TEST(Safety, TellsEachInterventionOnceWithWhatItDid) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  Intervention told;
  while (safety.next(told)) {
  }
  for (int tick = 0; tick < 100; ++tick) (void)safety.step(wantForce({60.0, 0.0, 0.0}), armed(), kTick);
  std::vector<SafetyRule> rules;
  while (safety.next(told)) {
    if (!told.began) continue;
    rules.push_back(told.rule);
    EXPECT_NEAR(told.before, 60.0, 1e-9);
    EXPECT_LE(told.after, 50.0 + 1e-9);
    EXPECT_GT(told.tick, 1000U);
  }
  // slewing rested since the settling only briefly, so it is not told anew; the limit is
  EXPECT_THAT(rules, testing::Contains(SafetyRule::kForceLimited));
  EXPECT_EQ(safety.lost(), 0U);
}

//  force limited   ####  ## #          rest           ##
//  told            begin      end (acted 7)           one of an untold begin, ten seconds after the first
TEST(Safety, AFlickeringRuleIsOneBeginningAndOneEndAndRoutineIsToldOnceInTenSeconds) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  std::vector<Intervention> heard;
  const auto run = [&](double force, int ticks) {
    Intervention told;
    for (int i = 0; i < ticks; ++i) {
      (void)safety.step(wantForce({force, 0.0, 0.0}), armed(), kTick);
      while (safety.next(told))
        if (told.rule == SafetyRule::kForceLimited) heard.push_back(told);
    }
  };
  run(60.0, 300);
  run(10.0, 100);
  run(60.0, 300);
  ASSERT_EQ(heard.size(), 1U) << "a short rest ends nothing";
  EXPECT_TRUE(heard[0].began);
  EXPECT_NEAR(heard[0].before, 60.0, 1e-9);
  run(10.0, 600);
  ASSERT_EQ(heard.size(), 2U);
  EXPECT_FALSE(heard[1].began);
  EXPECT_GT(heard[1].acted, 300U);
  EXPECT_LE(heard[1].acted, 600U) << "without the rest in between";

  run(60.0, 300);
  run(10.0, 600);
  EXPECT_EQ(heard.size(), 2U) << "routine again, so soon";
  run(10.0, 10'000);
  run(60.0, 300);
  ASSERT_EQ(heard.size(), 3U);
  EXPECT_TRUE(heard[2].began);
  EXPECT_EQ(heard[2].untold, 1U);
}

TEST(Safety, WhatIsNoRoutineIsToldEachTime) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  int begins = 0;
  for (int time = 0; time < 3; ++time) {
    SafetyRequest let_go = wantForce({10.0, 0.0, 0.0});
    let_go.dead_man = false;
    (void)safety.step(let_go, armed(), kTick);
    for (int tick = 0; tick < 600; ++tick) (void)safety.step(wantForce({10.0, 0.0, 0.0}), armed(), kTick);
    Intervention told;
    while (safety.next(told))
      if (told.rule == SafetyRule::kDeadMan && told.began) ++begins;
  }
  EXPECT_EQ(begins, 3);
}

TEST(Safety, EveryRuleHasAName) {
  for (unsigned i = 0; i < kSafetyRules; ++i)
    EXPECT_STRNE(toString(static_cast<SafetyRule>(1U << i)), "unknown rule") << i;
}

TEST(Safety, StepsWithoutAllocatingOrLocking) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  DeviceState state = armed();
  const test::RealtimeGuard guard;
  for (int tick = 0; tick < 1000; ++tick) {
    state.V_DH.linear.x() = tick % 200 == 0 ? 2.0 : 0.0;
    (void)safety.step(wantForce({0.1 * tick, 0.0, 0.0}, 1e-4 * (tick % 300)), state, kTick);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon
