#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/devices/settled_safety.h"
#include "tests/support/realtime_guard.h"

namespace tenon::devices {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(Safety, PassesASmallFreshForceUnchanged) {
  Safety safety = settled(kSigma, {1.0, 2.0, 3.0});
  const DeviceCommand output = safety.step(requestForce({1.0, 2.0, 3.0}), armed(), kTick);
  EXPECT_EQ(output.F_Ho_D.force, Vector3(1.0, 2.0, 3.0));
  EXPECT_FALSE(output.brake);
  EXPECT_EQ(safety.flags(), 0U);
}

TEST(Safety, OutputsNoForceForANonFiniteRequest) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  for (const double bad : {kNan, std::numeric_limits<double>::infinity()}) {
    const DeviceCommand output = safety.step(requestForce({1.0, bad, 0.0}), armed(), kTick);
    EXPECT_EQ(output.F_Ho_D.force, Vector3(Vector3::Zero()));
    EXPECT_TRUE(safety.acts(SafetyRule::kNonFinite));
  }
  SafetyRequest nan_stiffness = requestForce({1.0, 0.0, 0.0});
  nan_stiffness.stiffness = kNan;
  EXPECT_EQ(safety.step(nan_stiffness, armed(), kTick).F_Ho_D.force, Vector3(Vector3::Zero()));
}

// fraction of the force
//   1 |-------.
//     |        '.
//   0 |__________'.____ age
//     0     20   100 ms
TEST(Safety, FadesAForceOlderThanTwentyMillisecondsToNothingAtAHundred) {
  Safety safety = settled(kSigma, {4.0, 0.0, 0.0});
  const auto outputAt = [&](double age) {
    return safety.step(requestForce({4.0, 0.0, 0.0}, age), armed(), kTick).F_Ho_D.force.x();
  };
  EXPECT_DOUBLE_EQ(outputAt(0.020), 4.0);
  EXPECT_FALSE(safety.acts(SafetyRule::kAgeFading));
  EXPECT_NEAR(outputAt(0.060), 2.0, 1e-12);
  EXPECT_TRUE(safety.acts(SafetyRule::kAgeFading));
  EXPECT_FALSE(safety.acts(SafetyRule::kStale));
  EXPECT_DOUBLE_EQ(outputAt(0.100), 0.0);
  EXPECT_TRUE(safety.acts(SafetyRule::kStale));
  EXPECT_FALSE(safety.wantsDisarm()) << "the person does not have to arm after each gap";
  EXPECT_DOUBLE_EQ(outputAt(kNan), 0.0);
}

TEST(Safety, TactorsFadeWithTheAgeOfTheirContacts) {
  Safety safety(kSigma);
  const auto intensityAt = [&](double age) {
    SafetyRequest request;
    request.requested.tactors.fill(200);
    request.age = age;
    return safety.step(request, armed(), kTick).tactors[3];
  };
  EXPECT_EQ(intensityAt(0.0), 200);
  EXPECT_EQ(intensityAt(0.060), 100);
  EXPECT_EQ(intensityAt(0.100), 0);
}

TEST(Safety, LimitsAForceWithoutChangingItsDirection) {
  Safety safety = settled(kHug, {300.0, 400.0, 0.0});
  const Vector3 output = safety.step(requestForce({300.0, 400.0, 0.0}), armed(), kTick).F_Ho_D.force;
  EXPECT_NEAR(output.norm(), 50.0, 1e-9) << "peak force of a HUG arm 150 N, command limit 50 N";
  EXPECT_NEAR(output.y() / output.x(), 400.0 / 300.0, 1e-12);
  EXPECT_TRUE(safety.acts(SafetyRule::kForceLimited));
}

TEST(Safety, LimitsTorque) {
  Safety safety(kSigma);
  SafetyRequest request;
  request.requested.F_Ho_D.torque = {0.0, 3.0, 0.0};
  DeviceCommand output;
  for (int tick = 0; tick < 2000; ++tick) output = safety.step(request, armed(), kTick);
  EXPECT_NEAR(output.F_Ho_D.torque.y(), 0.4, 1e-12);
  EXPECT_TRUE(safety.acts(SafetyRule::kForceLimited));
}

TEST(Safety, LimitsTheForceFromPeakToContinuousAsTheMotorsWarm) {
  Safety safety = settled(kSigma, {20.0, 0.0, 0.0});
  const auto push = [&] {
    return safety.step(requestForce({20.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x();
  };
  EXPECT_DOUBLE_EQ(push(), 20.0) << "peak force is permitted for a second";
  double last = 20.0;
  double largest_drop = 0.0;
  for (int tick = 0; tick < 120000; ++tick) {
    const double now = push();
    largest_drop = std::max(largest_drop, last - now);
    last = now;
  }
  EXPECT_LT(last, 13.0);
  EXPECT_GE(last, 12.0 - 1e-9);
  EXPECT_LT(largest_drop, 0.05) << "the limit falls without steps";
  EXPECT_TRUE(safety.acts(SafetyRule::kThermal));
  // one minute without force cools the motors
  for (int tick = 0; tick < 60000; ++tick) (void)safety.step(requestForce({0.0, 0.0, 0.0}), armed(), kTick);
  for (int tick = 0; tick < 100; ++tick) last = push();
  EXPECT_DOUBLE_EQ(last, 20.0);
}

TEST(Safety, LimitsTheIncreaseOfAForceButNotItsDecrease) {
  Safety safety = settled(kSigma, {2.0, 0.0, 0.0});
  const auto outputFor = [&](double x) {
    return safety.step(requestForce({x, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x();
  };
  EXPECT_NEAR(outputFor(10.0), 2.5, 1e-9) << "500 N/s";
  EXPECT_TRUE(safety.acts(SafetyRule::kSlewLimited));
  EXPECT_NEAR(outputFor(10.0), 3.0, 1e-9);
  EXPECT_NEAR(outputFor(0.5), 0.5, 1e-9) << "decreases at once";
  EXPECT_FALSE(safety.acts(SafetyRule::kSlewLimited));
  EXPECT_NEAR(outputFor(-10.0), -0.5, 1e-9) << "the old direction drops at once, the new one grows";
}

TEST(Safety, ScalesAForceToThePassiveStiffnessOfTheDevice) {
  // sigma.7: b = 1 Ns/m at 1 kHz permits 2b/T = 2000 N/m; the requested spring has 8000 N/m
  EXPECT_DOUBLE_EQ(safetyLimits(kSigma).stiffness, 2000.0);
  Safety safety = settled(kSigma, {8.0, 0.0, 0.0});
  SafetyRequest request = requestForce({8.0, 0.0, 0.0});
  request.stiffness = 8000.0;
  EXPECT_NEAR(safety.step(request, armed(), kTick).F_Ho_D.force.x(), 2.0, 1e-9);
  EXPECT_TRUE(safety.acts(SafetyRule::kStiffnessLimited));
  request.stiffness = 2000.0;
  for (int tick = 0; tick < 20; ++tick) (void)safety.step(request, armed(), kTick);
  EXPECT_NEAR(safety.step(request, armed(), kTick).F_Ho_D.force.x(), 8.0, 1e-9);
  EXPECT_FALSE(safety.acts(SafetyRule::kStiffnessLimited));
}

TEST(Safety, ADelayLowersThePassiveStiffness) {
  DeviceCaps slow = kSigma;
  slow.delay = 1e-3;
  EXPECT_NEAR(safetyLimits(slow).stiffness, 1.0 / (0.5e-3 + 1e-3), 1e-9);
}

TEST(Safety, InjectsDampingWhenThePortHasDeliveredMoreEnergyThanItTook) {
  // a force along the velocity: negative damping, as in an unstable loop
  Safety safety = settled(kHug, {20.0, 0.0, 0.0});
  DeviceState state = armed();
  state.V_DH.linear = {0.3, 0.0, 0.0};
  DeviceCommand output;
  for (int tick = 0; tick < 50; ++tick) {
    state.X_DH.translation() += kTick * state.V_DH.linear;
    output = safety.step(requestForce({20.0, 0.0, 0.0}), state, kTick);
  }
  EXPECT_LT(safety.energy(), 0.0);
  EXPECT_TRUE(safety.acts(SafetyRule::kPassivity));
  EXPECT_NEAR(output.F_Ho_D.force.x(), 20.0 - kHug.injected_damping * 0.3, 1e-9)
      << "injected damping is limited";
}

TEST(Safety, InjectsNoDampingIntoALosslessSpring) {
  Safety safety(kHug);
  DeviceState state = armed();
  for (int tick = 0; tick < 1000; ++tick) (void)safety.step(requestForce({0, 0, 0}), state, kTick);
  double x = 0.0;
  for (int tick = 0; tick < 400; ++tick) {
    x += tick < 200 ? 5e-5 : -5e-5;
    state.X_DH.translation().x() = x;
    state.V_DH.linear.x() = tick < 200 ? 0.05 : -0.05;
    // force at the midpoint of the step, so that the work equals that of a continuous spring
    const double middle = x + (tick < 200 ? 2.5e-5 : -2.5e-5);
    (void)safety.step(requestForce({-1000.0 * middle, 0.0, 0.0}), state, kTick);
    EXPECT_FALSE(safety.acts(SafetyRule::kPassivity)) << tick;
  }
}

// as of an instructor's hand that leads: the force acts along the motion, whose measured velocity is noisy
TEST(Safety, TheDampingOfAHandThatIsLedDoesNotChatter) {
  const double power = safetyLimits(kSigma).active_power;  // [W]
  // the balance stays about zero with the second one
  for (const double force : {3.0, 10.0 * power + 0.1}) {
    Safety safety = settled(kSigma, {force, 0.0, 0.0});
    DeviceState state = armed();
    state.X_DH.translation().x() = -0.03;
    double last = force, delivered = 0.0;
    for (int tick = 0; tick < 600; ++tick) {
      state.V_DH.linear.x() = tick % 2 == 0 ? 0.11 : 0.09;  // [m/s]
      state.X_DH.translation().x() += kTick * 0.1;
      const double output = safety.step(requestForce({force, 0.0, 0.0}), state, kTick).F_Ho_D.force.x();
      EXPECT_LE(std::abs(output - last), kSigma.injected_damping * 0.02) << "the noise alone, at " << tick;
      last = output;
      if (tick >= 400) delivered += 0.1 * output * kTick;
    }
    EXPECT_LE(delivered, 0.2 * (power + 0.05)) << force;
    EXPECT_TRUE(safety.acts(SafetyRule::kPassivity)) << force;
  }
}

// A mass in a spring that is ten times too stiff for its delay of 2 ms: without damping its oscillation grows
// e-fold each 150 ms.
TEST(Safety, AnUnstableLoopIsDampedToABoundedOscillation) {
  constexpr double kStiffness = 1000.0, kMass = 0.3, kPush = 0.1;  // [N/m], [kg], [m/s]
  Safety safety = settled(kSigma, Vector3::Zero());
  DeviceState state = armed();
  double x = 0.0, v = kPush, largest = 0.0, grown = 0.0;
  std::array<double, 2> earlier{};
  for (int tick = 0; tick < 3000; ++tick) {
    state.X_DH.translation().x() = x;
    state.V_DH.linear.x() = v;
    const double asked = -kStiffness * std::exchange(earlier[tick % 2], x);
    const double force = safety.step(requestForce({asked, 0.0, 0.0}), state, kTick).F_Ho_D.force.x();
    v += kTick * force / kMass;
    x += kTick * v;
    (tick < 1500 ? largest : grown) = std::max(tick < 1500 ? largest : grown, std::abs(x));
  }
  EXPECT_LT(largest, 0.01);
  EXPECT_LT(grown, 1.05 * largest);
}

TEST(Safety, AVelocityThatIsNoNumberBrakesAndIsForgotten) {
  Safety safety = settled(kSigma, {3.0, 0.0, 0.0});
  DeviceState state = armed();
  state.V_DH.angular.z() = kNan;
  const DeviceCommand output = safety.step(requestForce({3.0, 0.0, 0.0}), state, kTick);
  EXPECT_TRUE(output.brake);
  EXPECT_TRUE(isFinite(output.F_Ho_D));
  state.V_DH.angular.z() = 0.0;
  for (int tick = 0; tick < 2000; ++tick) (void)safety.step(requestForce({3.0, 0.0, 0.0}), state, kTick);
  EXPECT_TRUE(std::isfinite(safety.energy()));
  EXPECT_EQ(safety.step(requestForce({3.0, 0.0, 0.0}), state, kTick).F_Ho_D.force.x(), 3.0);
}

// led on while its force starts: at the end of the start the damping is counted once
TEST(Safety, AtTheEndOfASoftStartTheDampingHasNoStep) {
  Safety safety(kSigma);
  DeviceState state = armed();
  state.X_DH.translation().x() = -0.03;
  double last = 0.0;
  for (int tick = 0; tick < 1200; ++tick) {
    state.V_DH.linear.x() = std::clamp(0.001 * (tick - 600), 0.0, 0.1);  // [m/s]
    state.X_DH.translation() += kTick * state.V_DH.linear;
    const double force = safety.step(requestForce({3.0, 0.0, 0.0}), state, kTick).F_Ho_D.force.x();
    EXPECT_LE(std::abs(force - last), safetyLimits(kSigma).start_force_slew * kTick + 2e-3) << tick;
    last = force;
  }
  EXPECT_FALSE(safety.acts(SafetyRule::kSoftStart));
  EXPECT_TRUE(safety.acts(SafetyRule::kPassivity));
}

TEST(Safety, TheForceOfAHandThatIsLedLeavesWithItsDamping) {
  Safety safety = settled(kSigma, {3.0, 0.0, 0.0});
  DeviceState state = armed();
  state.X_DH.translation().x() = -0.03;
  state.V_DH.linear.x() = 0.1;  // [m/s]
  double last = 3.0;
  for (int tick = 0; tick < 630; ++tick) {
    state.X_DH.translation().x() += kTick * 0.1;
    SafetyRequest request = requestForce({3.0, 0.0, 0.0});
    request.restart = tick >= 600;
    const double force = safety.step(request, state, kTick).F_Ho_D.force.x();
    EXPECT_LE(std::abs(force - last), 3.0 / 20.0 + 1e-9) << "within 20 ms, at " << tick;
    if (tick == 599) {
      EXPECT_LT(force, 2.5) << "damped";
    }
    last = force;
  }
  EXPECT_EQ(last, 0.0);
}

TEST(Safety, BrakesAboveTheSpeedLimitWithHysteresis) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  DeviceState state = armed();
  const auto brakesAt = [&](double speed) {
    state.V_DH.linear = {0.0, speed, 0.0};
    return safety.step(requestForce({1.0, 0.0, 0.0}), state, kTick).brake;
  };
  EXPECT_FALSE(brakesAt(0.5));
  EXPECT_TRUE(brakesAt(0.51));
  EXPECT_TRUE(safety.acts(SafetyRule::kOverspeed));
  EXPECT_TRUE(brakesAt(0.4)) << "hysteresis";
  EXPECT_FALSE(brakesAt(0.2));
  EXPECT_TRUE(safety.acts(SafetyRule::kSoftStart)) << "soft start after braking";
  EXPECT_TRUE(brakesAt(kNan));
}

// |F|        /
//    |      /    a spring acts in the outer 5 % of the radius
//    |_____/___ r
//       .95 R  R
TEST(Safety, PushesBackAtTheEndOfTheWorkspace) {
  Safety safety = settled(kSigma, {0.0, 0.0, 0.0});
  DeviceState state = armed();
  state.X_DH.translation() = {0.0, 0.0, 0.95 * 0.060 + 1e-3};
  EXPECT_NEAR(safety.step({}, state, kTick).F_Ho_D.force.z(), -0.5, 1e-9) << "it grows by 500 N/s too";
  EXPECT_NEAR(safety.step({}, state, kTick).F_Ho_D.force.z(), -1000.0 * 1e-3, 1e-9);
  EXPECT_TRUE(safety.acts(SafetyRule::kWorkspaceWall));
}

TEST(Safety, WarnsAtSixtyNewtonAndStopsBothArmsAboveEightyUntilReset) {
  ClutchLatch clutch;
  Safety right = settled(kHug, {1.0, 0.0, 0.0}, &clutch);
  Safety left = settled(kHug, {1.0, 0.0, 0.0}, &clutch);
  DeviceState state = armed();

  state.F_Ho_D_measured.force = {0.0, -61.0, 0.0};
  EXPECT_FALSE(right.step(requestForce({1.0, 0.0, 0.0}), state, kTick).brake);
  EXPECT_TRUE(right.acts(SafetyRule::kClutchWarning));

  state.F_Ho_D_measured.force = {50.0, -50.0, 50.0};  // 87 N in a direction off the axes
  EXPECT_TRUE(right.step(requestForce({1.0, 0.0, 0.0}), state, kTick).brake);
  EXPECT_TRUE(right.acts(SafetyRule::kClutchOpen));

  const DeviceCommand other = left.step(requestForce({1.0, 0.0, 0.0}), armed(), kTick);
  EXPECT_TRUE(other.brake);
  EXPECT_EQ(other.F_Ho_D.force, Vector3(Vector3::Zero()));
  EXPECT_TRUE(left.wantsDisarm());

  for (int tick = 0; tick < 5000; ++tick) {
    EXPECT_TRUE(right.step(requestForce({1.0, 0.0, 0.0}), armed(), kTick).brake) << "latched";
  }
  right.reset();
  left.reset();
  EXPECT_FALSE(right.step(requestForce({1.0, 0.0, 0.0}), armed(), kTick).brake);
  EXPECT_FALSE(left.step(requestForce({1.0, 0.0, 0.0}), armed(), kTick).brake);
  EXPECT_TRUE(left.acts(SafetyRule::kSoftStart));
}

TEST(Safety, ANonFiniteMeasuredForceOpensTheClutch) {
  Safety safety = settled(kHug, {1.0, 0.0, 0.0});
  DeviceState state = armed();
  state.F_Ho_D_measured.force = {kNan, 0.0, 0.0};
  EXPECT_TRUE(safety.step(requestForce({1.0, 0.0, 0.0}), state, kTick).brake);
  EXPECT_TRUE(safety.step(requestForce({1.0, 0.0, 0.0}), armed(), kTick).brake)
      << "latched without a shared latch, too";
}

TEST(Safety, AnEmergencyStopIsLatchedUntilReset) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  SafetyRequest request = requestForce({1.0, 0.0, 0.0});
  request.requested.tactors = {255, 0, 0, 0, 0, 0};
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

TEST(Safety, ADeviceThatIsNotArmedIsBrakedWithoutAnEmergencyStop) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  SafetyRequest request = requestForce({1.0, 0.0, 0.0});
  int begins = 0;
  for (int i = 0; i < 3; ++i) {
    request.armed = false;
    const DeviceCommand command = safety.step(request, armed(), kTick);
    EXPECT_TRUE(command.brake);
    EXPECT_EQ(command.F_Ho_D.force, Vector3(Vector3::Zero()));
    EXPECT_TRUE(safety.acts(SafetyRule::kNotArmed));
    EXPECT_FALSE(safety.acts(SafetyRule::kEmergencyStop));
    EXPECT_TRUE(safety.wantsDisarm());
    request.armed = true;
    EXPECT_FALSE(safety.step(request, armed(), kTick).brake) << "it is not latched";
    for (int tick = 0; tick < 600; ++tick) (void)safety.step(request, armed(), kTick);
    Intervention intervention;
    while (safety.takeIntervention(intervention))
      if (intervention.rule == SafetyRule::kNotArmed && intervention.began) ++begins;
  }
  EXPECT_EQ(begins, 1) << "a routine rule";
}

TEST(Safety, OutputsNoForceWhileTheDeadManSwitchIsReleased) {
  Safety safety = settled(kSigma, {1.0, 0.0, 0.0});
  SafetyRequest request = requestForce({1.0, 0.0, 0.0});
  request.dead_man_held = false;
  EXPECT_EQ(safety.step(request, armed(), kTick).F_Ho_D.force, Vector3(Vector3::Zero()));
  EXPECT_TRUE(safety.acts(SafetyRule::kDeadMan));
  request.dead_man_held = true;
  EXPECT_LT(safety.step(request, armed(), kTick).F_Ho_D.force.x(), 0.01)
      << "soft start when it is held again";
}

TEST(Safety, QuantisesToMotorCountsAndSaturatesAtTheirRange) {
  const double quantum = kFalcon.force_quantum;
  Safety safety = settled(kFalcon, {3.0, 0.0, 0.0});
  const double output = safety.step(requestForce({3.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x();
  EXPECT_NEAR(output, 3.0, quantum);
  EXPECT_DOUBLE_EQ(output, std::floor(3.0 / quantum) * quantum) << "rounded towards zero";

  DeviceCaps weak = kFalcon;
  weak.force_quantum /= 2.0;  // 4096 counts are half the peak force
  Safety saturating = settled(weak, {5.0, 0.0, 0.0});
  EXPECT_DOUBLE_EQ(saturating.step(requestForce({5.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x(), 4.0);
  EXPECT_TRUE(saturating.acts(SafetyRule::kMotorSaturated));
}

TEST(Safety, CommandsOnlyAxesTheDeviceHas) {
  Safety safety(kFalcon);
  SafetyRequest request = requestForce({1.0, 0.0, 0.0});
  request.requested.F_Ho_D.torque = {1.0, 1.0, 1.0};
  for (int tick = 0; tick < 1100; ++tick) {
    EXPECT_EQ(safety.step(request, armed(), kTick).F_Ho_D.torque, Vector3(Vector3::Zero()));
  }
  EXPECT_EQ(safety.flags(), 0U);
}

TEST(Safety, ReportsEachInterventionOnceWithItsForces) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  Intervention intervention;
  while (safety.takeIntervention(intervention)) {
  }
  for (int tick = 0; tick < 100; ++tick) (void)safety.step(requestForce({60.0, 0.0, 0.0}), armed(), kTick);
  std::vector<SafetyRule> rules;
  while (safety.takeIntervention(intervention)) {
    if (!intervention.began) continue;
    rules.push_back(intervention.rule);
    EXPECT_NEAR(intervention.requested_force, 60.0, 1e-9);
    EXPECT_LE(intervention.output_force, 50.0 + 1e-9);
    EXPECT_GT(intervention.tick, 1000U);
  }
  // the slew limit paused for less than 0.5 s since settled(), so it continues; the force limit begins
  EXPECT_THAT(rules, testing::Contains(SafetyRule::kForceLimited));
  EXPECT_EQ(safety.lost(), 0U);
}

//  force limited   ####  ## #          pause          ##
//  reported        begin      end (active 7 ticks)    begin with 1 unreported, more than 10 s after the first
TEST(Safety, JoinsInterventionsAcrossShortPausesAndReportsARoutineRuleOncePerTenSeconds) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  std::vector<Intervention> reported;
  const auto run = [&](double force, int ticks) {
    Intervention intervention;
    for (int i = 0; i < ticks; ++i) {
      (void)safety.step(requestForce({force, 0.0, 0.0}), armed(), kTick);
      while (safety.takeIntervention(intervention))
        if (intervention.rule == SafetyRule::kForceLimited) reported.push_back(intervention);
    }
  };
  run(60.0, 300);
  run(10.0, 100);
  run(60.0, 300);
  ASSERT_EQ(reported.size(), 1U) << "a short pause does not end it";
  EXPECT_TRUE(reported[0].began);
  EXPECT_NEAR(reported[0].requested_force, 60.0, 1e-9);
  run(10.0, 600);
  ASSERT_EQ(reported.size(), 2U);
  EXPECT_FALSE(reported[1].began);
  EXPECT_GT(reported[1].active_ticks, 300U);
  EXPECT_LE(reported[1].active_ticks, 600U) << "the pause does not count";

  run(60.0, 300);
  run(10.0, 600);
  EXPECT_EQ(reported.size(), 2U) << "a routine rule within 10 s";
  run(10.0, 10'000);
  run(60.0, 300);
  ASSERT_EQ(reported.size(), 3U);
  EXPECT_TRUE(reported[2].began);
  EXPECT_EQ(reported[2].unreported, 1U);
}

TEST(Safety, ReportsEachInterventionOfANonRoutineRule) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  int begins = 0;
  for (int i = 0; i < 3; ++i) {
    SafetyRequest released = requestForce({10.0, 0.0, 0.0});
    released.dead_man_held = false;
    (void)safety.step(released, armed(), kTick);
    for (int tick = 0; tick < 600; ++tick) (void)safety.step(requestForce({10.0, 0.0, 0.0}), armed(), kTick);
    Intervention intervention;
    while (safety.takeIntervention(intervention))
      if (intervention.rule == SafetyRule::kDeadMan && intervention.began) ++begins;
  }
  EXPECT_EQ(begins, 3);
}

TEST(Safety, EveryRuleHasAText) {
  for (unsigned i = 0; i < kSafetyRules; ++i)
    EXPECT_STRNE(toString(static_cast<SafetyRule>(1U << i)), "unknown rule") << i;
}

TEST(Safety, StepsWithoutAllocatingOrLocking) {
  Safety safety = settled(kHug, {10.0, 0.0, 0.0});
  DeviceState state = armed();
  const test::RealtimeGuard guard;
  for (int tick = 0; tick < 1000; ++tick) {
    state.V_DH.linear.x() = tick % 200 == 0 ? 2.0 : 0.0;
    (void)safety.step(requestForce({0.1 * tick, 0.0, 0.0}, 1e-4 * (tick % 300)), state, kTick);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::devices
