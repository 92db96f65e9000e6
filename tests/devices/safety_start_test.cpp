#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "tests/devices/settled_safety.h"

// Forces that begin: after arming, a gap, a stop or a jump.

namespace tenon::devices {
namespace {

TEST(Safety, AForceThatWasLateStartsSoftly) {
  Safety safety = settled(kSigma, {4.0, 0.0, 0.0});
  (void)safety.step(requestForce({4.0, 0.0, 0.0}, 0.021), armed(), kTick);
  double last = 4.0;
  for (int tick = 0; tick < 20; ++tick) {
    const double now = safety.step(requestForce({4.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x();
    EXPECT_LT(now, last);
    last = now;
  }
  EXPECT_LT(last, 0.1);
  EXPECT_TRUE(safety.acts(SafetyRule::kSoftStart));
}

// after a server that stood still, answers to older and older inputs arrive within milliseconds
TEST(Safety, ABurstOfAnswersAfterAGapDoesNotBringTheForceBack) {
  Safety safety = settled(kSigma, {4.0, 0.0, 0.0});
  double last = 4.0;
  for (const double age : {0.03, 0.06, 0.2, 0.5, 0.09, 0.06, 0.04, 0.025, 0.021}) {
    for (int tick = 0; tick < 5; ++tick) {
      const double now = safety.step(requestForce({4.0, 0.0, 0.0}, age), armed(), kTick).F_Ho_D.force.x();
      EXPECT_LE(now, last) << age;
      last = now;
    }
  }
  EXPECT_EQ(last, 0.0);
  for (int tick = 0; tick < 100; ++tick) {
    const double now = safety.step(requestForce({4.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.x();
    EXPECT_LE(now - last, 0.020 + 1e-9) << tick;
    last = now;
  }
}

TEST(Safety, ForcesThatComeOnWhileContactsAreLateWaitUntilTheyAreFresh) {
  Safety safety(kSigma);
  double last = 0.0;
  for (int tick = 0; tick < 2000; ++tick) {
    const double age = tick < 1500 ? 0.05 : 0.0;
    last = safety.step(requestForce({4.0, 0.0, 0.0}, age), armed(), kTick).F_Ho_D.force.x();
    if (tick < 1500) {
      ASSERT_EQ(last, 0.0) << tick;
    }
  }
  EXPECT_GT(last, 1.0);
}

//  |F| ---.                   the old force leaves within 20 ms,
//          `.                 the new one grows by at most 20 N/s
//            `.___.---~~~
TEST(Safety, ARestartedForceGrowsByTwentyNewtonASecondUntilItIsTheRequestedOne) {
  Safety safety = settled(kHug, {40.0, 0.0, 0.0});
  SafetyRequest request = requestForce({0.0, 40.0, 0.0});
  request.restart = true;
  for (int tick = 0; tick < 25; ++tick) {
    const Vector3 force = safety.step(request, armed(), kTick).F_Ho_D.force;
    EXPECT_NEAR(force.x(), tick < 20 ? 40.0 - 2.0 * (tick + 1) : 0.0, 1e-9) << tick;
    EXPECT_EQ(force.y(), 0.0);
  }
  request.restart = false;
  double last = 0.0;
  for (int tick = 0; tick < 2000; ++tick) {
    const double now = safety.step(request, armed(), kTick).F_Ho_D.force.y();
    EXPECT_LE(now - last, 0.020 + 1e-9) << tick;
    last = now;
  }
  EXPECT_NEAR(last, 40.0, 0.1);
  (void)safety.step(request, armed(), 0.3);
  EXPECT_LE(safety.step(request, armed(), kTick).F_Ho_D.force.y(), 40.0);
}

TEST(Safety, AForceThatStartsFromNothingIsAtMostThreeNewtonForASecond) {
  Safety safety(kHug);
  DeviceCommand output;
  for (int tick = 0; tick < 999; ++tick) output = safety.step(requestForce({40.0, 0.0, 0.0}), armed(), kTick);
  EXPECT_NEAR(output.F_Ho_D.force.norm(), 3.0, 1e-9);
  for (int tick = 0; tick < 100; ++tick) output = safety.step(requestForce({40.0, 0.0, 0.0}), armed(), kTick);
  EXPECT_NEAR(output.F_Ho_D.force.norm(), 5.0, 0.1) << "20 N/s until it is the requested one";
}

SafetyRequest requestTorque(double torque) {
  SafetyRequest request;
  request.requested.F_Ho_D.torque = {0.0, torque, 0.0};
  return request;
}

struct TorqueStart {
  DeviceCaps caps;
  double most;    // [Nm]
  double growth;  // [Nm/s]
};

//  |M|                  after a second the torque goes on to the requested one
//        .-----------/
//      .'
TEST(Safety, ATorqueThatStartsFromNothingIsSmallForASecond) {
  for (const TorqueStart& start : {TorqueStart{kHug, 0.3, 2.0}, TorqueStart{kSigma, 0.06, 0.4}}) {
    Safety safety(start.caps);
    double last = 0.0;
    for (int tick = 0; tick < 8000; ++tick) {
      const double now = safety.step(requestTorque(35.0), armed(), kTick).F_Ho_D.torque.norm();
      ASSERT_LE(now - last, start.growth * kTick + 1e-9) << tick;
      if (tick < 1000) {
        ASSERT_LE(now, start.most + 1e-9) << tick;
      }
      if (tick == 999) {
        EXPECT_NEAR(now, start.most, 1e-9);
      }
      last = now;
    }
    EXPECT_NEAR(last, start.caps.torque, 1e-9);
  }
}

TEST(Safety, ATorqueComesBackUpToWhatItWasBefore) {
  Safety safety(kHug);
  for (int tick = 0; tick < 4000; ++tick) (void)safety.step(requestTorque(2.0), armed(), kTick);
  SafetyRequest request = requestTorque(2.0);
  request.restart = true;
  for (int tick = 0; tick < 25; ++tick) (void)safety.step(request, armed(), kTick);
  double last = 0.0;
  for (int tick = 0; tick < 975; ++tick) {
    last = safety.step(requestTorque(9.0), armed(), kTick).F_Ho_D.torque.norm();
    ASSERT_LE(last, 2.0 + 1e-9) << tick;
  }
  EXPECT_GT(last, 1.5);
}

//  |F| --.                  .--    a torque that still grows after the first gap keeps no force of before it:
//        '._____free_____._'      after the second one the force starts as one that was free
//  |M| --.        .----------
//        '.___.-'         '.__
TEST(Safety, AForceThatIsFreeWhileATorqueStillGrowsStartsFromNothingAfterTheNextGap) {
  Safety safety = settled(kHug, {0.0, 0.0, 8.0});
  const auto push = [&](double force, double torque, double age) {
    SafetyRequest request = requestForce({0.0, 0.0, force}, age);
    request.requested.F_Ho_D.torque = {0.0, torque, 0.0};
    return safety.step(request, armed(), kTick).F_Ho_D;
  };
  for (int tick = 0; tick < 800; ++tick) (void)push(8.0, 9.0, 0.2);
  Wrench free;
  for (int tick = 0; tick < 1400; ++tick) free = push(0.25, 9.0, 0.0);
  EXPECT_NEAR(free.force.norm(), 0.25, 1e-9);
  EXPECT_LT(free.torque.norm(), 2.0) << "it still grows";
  for (int tick = 0; tick < 800; ++tick) (void)push(8.0, 9.0, 0.2);
  double last = 0.0;
  for (int tick = 0; tick < 999; ++tick) {
    last = push(8.0, 9.0, 0.0).force.norm();
    ASSERT_LE(last, 3.0 + 1e-9) << tick;
  }
  EXPECT_NEAR(last, 3.0, 1e-9);
}

TEST(Safety, ATorqueThatIsFreeWhileAForceStillGrowsStartsFromNothingAfterTheNextGap) {
  Safety safety(kHug);
  const auto push = [&](double force, double torque, double age) {
    SafetyRequest request = requestForce({0.0, 0.0, force}, age);
    request.requested.F_Ho_D.torque = {0.0, torque, 0.0};
    return safety.step(request, armed(), kTick).F_Ho_D;
  };
  for (int tick = 0; tick < 4000; ++tick) (void)push(0.0, 2.0, 0.0);
  for (int tick = 0; tick < 800; ++tick) (void)push(0.0, 2.0, 0.2);
  for (int tick = 0; tick < 1400; ++tick) (void)push(40.0, 0.1, 0.0);
  for (int tick = 0; tick < 800; ++tick) (void)push(40.0, 2.0, 0.2);
  for (int tick = 0; tick < 999; ++tick) ASSERT_LE(push(40.0, 2.0, 0.0).torque.norm(), 0.3 + 1e-9) << tick;
}

TEST(Safety, AfterARequestThatWasNoNumberTheForceStartsSoftly) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const bool of_stiffness : {false, true}) {
    Safety safety = settled(kHug, {40.0, 0.0, 0.0});
    SafetyRequest bad = requestForce({of_stiffness ? 40.0 : kNan, 0.0, 0.0});
    if (of_stiffness) bad.stiffness = kNan;
    EXPECT_EQ(safety.step(bad, armed(), kTick).F_Ho_D.force.norm(), 0.0);
    double last = 0.0;
    for (int tick = 0; tick < 999; ++tick) {
      const double now = safety.step(requestForce({40.0, 0.0, 0.0}), armed(), kTick).F_Ho_D.force.norm();
      ASSERT_LE(now - last, 0.020 + 1e-9) << tick;
      ASSERT_LE(now, 3.0 + 1e-9) << tick;
      last = now;
    }
    EXPECT_NEAR(last, 3.0, 1e-9);
  }
}

TEST(Safety, ALongStepLetsAForceGrowAsTwoMilliseconds) {
  Safety safety = settled(kSigma, {2.0, 0.0, 0.0});
  EXPECT_NEAR(safety.step(requestForce({10.0, 0.0, 0.0}), armed(), 0.3).F_Ho_D.force.x(), 3.0, 1e-9)
      << "500 N/s";
}

TEST(Safety, AForceThatLeavesIsGoneAfterALongStep) {
  Safety safety = settled(kSigma, {4.0, 0.0, 0.0});
  SafetyRequest request = requestForce({4.0, 0.0, 0.0});
  request.restart = true;
  (void)safety.step(request, armed(), 0.1);
  EXPECT_EQ(safety.step(request, armed(), kTick).F_Ho_D.force.norm(), 0.0);
}

TEST(Safety, MotorsThatCoolInAGapLetNoMoreForceStartThanWasDisplayedBefore) {
  Safety safety = settled(kSigma, {20.0, 0.0, 0.0});
  const auto pushAt = [&](double age) {
    return safety.step(requestForce({20.0, 0.0, 0.0}, age), armed(), kTick).F_Ho_D.force.norm();
  };
  double before = 0.0;
  for (int tick = 0; tick < 120000; ++tick) before = pushAt(0.0);
  for (int tick = 0; tick < 4000; ++tick) (void)pushAt(1.0);
  double most = 0.0;
  for (int tick = 0; tick < 999; ++tick) most = std::max(most, pushAt(0.0));
  EXPECT_LE(most, before + 1e-9);
  EXPECT_GT(most, 0.9 * before);
  for (int tick = 0; tick < 500; ++tick) most = std::max(most, pushAt(0.0));
  EXPECT_GT(most, before + 1.0) << "the motors have cooled";
}

TEST(Safety, RampsTheForceOverASecondAfterArming) {
  Safety safety(kHug);
  const SafetyRequest request = requestForce({2.0, 0.0, 0.0});
  (void)safety.step(request, DeviceState{}, kTick);
  EXPECT_TRUE(safety.acts(SafetyRule::kForcesOff));
  double last = 0.0;
  for (int tick = 0; tick <= 1001; ++tick) {
    const double now = safety.step(request, armed(), kTick).F_Ho_D.force.x();
    EXPECT_NEAR(now, std::min(2.0, 2.0 * tick / 1000.0), 1e-6);
    EXPECT_GE(now, last);
    EXPECT_EQ(safety.acts(SafetyRule::kSoftStart),
              tick < 1000 || (tick == 1000 && safety.acts(SafetyRule::kSoftStart)))
        << tick;
    last = now;
  }
}

TEST(Safety, TheEndOfTheWorkspaceRampsAfterArming) {
  Safety safety(kHug);
  DeviceState state = armed();
  state.X_DH.translation() = {0.0, 0.0, 0.95 * 0.40 + 0.01};  // armed 10 mm beyond the edge
  const double whole = 0.01 * safety.limits().wall_stiffness;
  double last = 0.0;
  int tick = 0;
  for (; last < whole && tick < 10000; ++tick) {
    const double now = safety.step({}, state, kTick).F_Ho_D.force.norm();
    EXPECT_LE(now - last, 0.020 + 1e-9) << tick;
    if (tick < 1000) {
      EXPECT_LE(now, 3.0 + 1e-9) << tick;
    }
    last = now;
  }
  EXPECT_NEAR(last, whole, 1e-9);
  // from then on it follows the hand as its spring does
  state.X_DH.translation().z() += 1e-4;
  EXPECT_NEAR(safety.step({}, state, kTick).F_Ho_D.force.norm(),
              whole + 1e-4 * safety.limits().wall_stiffness, 1e-9);
}

//        o  the contact that holds the hand beyond its workspace ends after a gap
//   _____|_____
TEST(Safety, TheEndOfTheWorkspaceGrowsSoftlyWhenAContactEndsAfterAGap) {
  for (const int lifts_off : {1000, 1400, 1500, 2000, 4000}) {
    Safety safety = settled(kHug, {0.0, 0.0, 7.0});
    DeviceState state = armed();
    double last = 7.0;
    for (int tick = 0; tick < 6000; ++tick) {
      SafetyRequest request =
          requestForce({0.0, 0.0, tick < lifts_off ? 7.0 : 0.0}, tick < 300 ? 0.02 + 1e-3 * tick : 0.0);
      request.restart = tick >= 300 && tick < 310;
      // it falls 20 mm beyond the edge
      state.X_DH.translation() = {0.0, 0.0, -0.36 - 4e-4 * std::clamp(tick - 200, 0, 100)};
      const double now = safety.step(request, state, kTick).F_Ho_D.force.norm();
      EXPECT_LE(now - last, 0.020 + 1e-9) << tick << ", lifts off at " << lifts_off;
      last = now;
    }
    EXPECT_NEAR(last, 0.02 * safety.limits().wall_stiffness, 1e-6);
  }
}

//        o  hand, pressed against the scene: the force goes in a gap, and it falls to the end of its
//        workspace
//        |
//   _____v_____
TEST(Safety, AHandThatFallsToTheEndOfItsWorkspaceInAGapIsMetSoftly) {
  Safety safety = settled(kHug, {0.0, 0.0, 2.0});
  DeviceState state = armed();
  double last = 2.0;
  for (int tick = 0; tick < 1500; ++tick) {
    SafetyRequest request =
        requestForce({0.0, 0.0, tick < 300 ? 2.0 : 6.0}, tick < 300 ? 0.02 + 1e-3 * tick : 0.0);
    request.restart = tick >= 300 && tick < 310;
    state.X_DH.translation() = {0.0, 0.0, -0.36 - 0.7 * std::min(0.1, 1e-3 * std::max(0, tick - 280))};
    const double now = safety.step(request, state, kTick).F_Ho_D.force.norm();
    EXPECT_LE(now - last, 0.020 + 1e-9) << tick;
    if (tick < 1300) {
      EXPECT_LE(now, 3.0 + 1e-9) << tick;
    }
    last = now;
  }
  EXPECT_GT(last, 3.5);
}

}  // namespace
}  // namespace tenon::devices
