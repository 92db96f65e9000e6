#include <cmath>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/small_scene.h"
#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

using test::activateHand;
using test::moveHandTo;
using test::stepTicks;

constexpr double kG = 9.81;
constexpr double kMass = 0.4;
const Vector3 kSize(0.06, 0.05, 0.04);
constexpr std::uint32_t kLifetime = 100;
/// [-] Weight of a contribution when applied: it is one tick old.
constexpr double kWeight = 1.0 - 1.0 / kLifetime;

Vector3 velocityOf(const Environment& environment, ObjectId object) {
  return environment.objects()[object.value].V_WO.linear;
}
Vector3 positionOf(const Environment& environment, ObjectId object) {
  return environment.objects()[object.value].X_WO.translation();
}

// Semi-implicit Euler: after n ticks v = n g dt and z = n (n + 1) / 2 g dt^2.
TEST(FreeBody, FallsWithConstantAcceleration) {
  test::SmallScene small;
  const ObjectId box = small.freeBox("box", kSize, kMass, {0.0, 0.0, 1.0});
  Environment environment(small.build(), {});
  constexpr int kTicks = 250;
  test::stepTicks(environment, kTicks);
  const double t = kTicks * kTickSeconds;
  EXPECT_NEAR(velocityOf(environment, box).z(), -kG * t, 1e-9);
  EXPECT_NEAR(positionOf(environment, box).z(), 1.0 - 0.5 * kG * t * (t + kTickSeconds), 1e-9);
  EXPECT_NEAR(environment.forceOn(box).force.z(), -kMass * kG, 1e-12) << "gravity is the only force";
}

TEST(FreeBody, ABodyWhoseOriginIsNotItsCentreOfMassFallsWithoutRotation) {
  test::SmallScene small;
  const ObjectId box = small.freeBox("box", kSize, kMass, {0.0, 0.0, 1.0});
  small.spec(box).body->p_OC_O = {0.02, 0.01, -0.01};
  Environment environment(small.build(), {});
  test::stepTicks(environment, 200);
  const ObjectMotion& motion = environment.objects()[box.value];
  EXPECT_LE(motion.V_WO.angular.norm(), 1e-12);
  EXPECT_NEAR(motion.V_WO.linear.z(), -kG * 0.2, 1e-9);
}

TEST(FreeBody, AForceGivesForceOverMass) {
  test::SmallScene small;
  const ObjectId box = small.freeBox("box", kSize, kMass, Vector3::Zero(), true);
  Environment environment(small.build(), {});
  const Vector3 force(0.3, -0.1, 0.05);
  constexpr int kTicks = 500;
  for (int tick = 0; tick < kTicks; ++tick) {
    environment.contribute(box, 1, {force, Vector3::Zero()}, kLifetime);
    environment.step();
  }
  const double t = kTicks * kTickSeconds;
  const Vector3 v = kWeight * force / kMass * t;
  EXPECT_LE((velocityOf(environment, box) - v).norm(), 1e-6 * v.norm());
  EXPECT_LE((positionOf(environment, box) - 0.5 * v * (t + kTickSeconds)).norm(), 1e-6);
}

TEST(FreeBody, ATorqueGivesTorqueOverMomentOfInertia) {
  for (int axis = 0; axis < 3; ++axis) {
    test::SmallScene small;
    const ObjectId box = small.freeBox("box", kSize, kMass, Vector3::Zero(), true);
    Environment environment(small.build(), {});
    const Vector3 moment = 1e-3 * Vector3::Unit(axis);
    for (int tick = 0; tick < 500; ++tick) {
      environment.contribute(box, 1, {Vector3::Zero(), moment}, kLifetime);
      environment.step();
    }
    const double inertia = small.spec(box).body->inertia_C_O(axis, axis);
    const double expected = kWeight * 1e-3 / inertia * 0.5;
    EXPECT_NEAR(environment.objects()[box.value].V_WO.angular[axis], expected, 1e-3 * expected);
  }
}

//   F ->[   box   ]        a force above the centre of mass
TEST(FreeBody, AnEccentricForceGivesLinearAndAngularAcceleration) {
  test::SmallScene small;
  const ObjectId box = small.freeBox("box", kSize, kMass, Vector3::Zero(), true);
  Environment environment(small.build(), {});
  const Vector3 force(0.2, 0.0, 0.0);
  const double lever = 0.01;
  for (int tick = 0; tick < 50; ++tick) {
    environment.contribute(box, 1, {force, Vector3(0.0, 0.0, lever).cross(force)}, kLifetime);
    environment.step();
  }
  const double inertia = small.spec(box).body->inertia_C_O(1, 1);
  const ObjectMotion& motion = environment.objects()[box.value];
  EXPECT_NEAR(motion.V_WO.linear.x(), kWeight * 0.2 / kMass * 0.05, 1e-6);
  EXPECT_NEAR(motion.V_WO.angular.y(), kWeight * 0.2 * lever / inertia * 0.05, 1e-3);
}

TEST(FreeBody, ATumblingBodyConservesAngularMomentumAndGainsNoEnergy) {
  test::SmallScene small;
  const Vector3 size(0.02, 0.06, 0.12);
  const ObjectId box = small.freeBox("box", size, kMass, Vector3::Zero(), true);
  Environment environment(small.build(), {});
  // rotation about the axis of the middle moment of inertia is unstable: the body tumbles
  for (int tick = 0; tick < 20; ++tick) {
    environment.contribute(box, 1, {Vector3::Zero(), Vector3(0.001, 0.1, 0.001)}, kLifetime);
    environment.step();
  }
  test::stepTicks(environment, 200);
  const Matrix3& inertia = small.spec(box).body->inertia_C_O;
  const auto momentum = [&] {
    const ObjectMotion& motion = environment.objects()[box.value];
    const Matrix3 R = motion.X_WO.matrix();
    return Vector3(R * inertia * R.transpose() * motion.V_WO.angular);
  };
  const auto energy = [&] { return 0.5 * momentum().dot(environment.objects()[box.value].V_WO.angular); };
  const Vector3 before = momentum();
  const double first = energy();
  for (int tick = 0; tick < 1000; ++tick) {
    environment.step();
    ASSERT_LE(energy(), first * (1.0 + 1e-3)) << tick;
  }
  EXPECT_LE((momentum() - before).norm(), 0.05 * before.norm()) << "over four revolutions in a second";
}

//   [a]->   <-[b]      two boxes without gravity collide centrally and off centre
TEST(FreeBody, ACollisionConservesMomentumAndGainsNoEnergy) {
  for (const double off : {0.0, 0.015}) {
    test::SmallScene small;
    const ObjectId a = small.freeBox("a", kSize, 0.3, {-0.09, 0.0, 0.0}, true);
    const ObjectId b = small.freeBox("b", kSize, 0.5, {0.09, off, 0.0}, true);
    small.pair(a, b);
    Environment environment(small.build(), {});
    for (int tick = 0; tick < 100; ++tick) {
      environment.contribute(a, 1, {Vector3(0.3, 0.0, 0.0), Vector3::Zero()}, kLifetime);
      environment.contribute(b, 1, {Vector3(-0.2, 0.0, 0.0), Vector3::Zero()}, kLifetime);
      environment.step();
    }
    test::stepTicks(environment, 201);  // contributions fade
    const auto momentum = [&] {
      return Vector3(0.3 * velocityOf(environment, a) + 0.5 * velocityOf(environment, b));
    };
    const auto angular = [&] {
      Vector3 sum = Vector3::Zero();
      for (const auto& [box, mass] : {std::pair(a, 0.3), std::pair(b, 0.5)}) {
        const ObjectMotion& motion = environment.objects()[box.value];
        const Matrix3 R = motion.X_WO.matrix();
        sum += mass * motion.X_WO.translation().cross(motion.V_WO.linear) +
               R * small.spec(box).body->inertia_C_O * R.transpose() * motion.V_WO.angular;
      }
      return sum;
    };
    const auto energy = [&] {
      double sum = 0.0;
      for (const auto& [box, mass] : {std::pair(a, 0.3), std::pair(b, 0.5)}) {
        const Twist& V_WO = environment.objects()[box.value].V_WO;
        const Matrix3 R = environment.objects()[box.value].X_WO.matrix();
        sum += 0.5 * mass * V_WO.linear.squaredNorm() +
               0.5 * V_WO.angular.dot(R * small.spec(box).body->inertia_C_O * R.transpose() * V_WO.angular);
      }
      return sum;
    };
    bool met = false;
    const Vector3 before = momentum();
    const Vector3 spin_before = angular();
    const double energy_before = energy();
    ASSERT_GT(energy_before, 1e-4);
    for (int tick = 0; tick < 800; ++tick) {
      environment.step();
      met |= environment.inContact(a, b);
      ASSERT_LE((momentum() - before).norm(), 5e-6) << tick;
      ASSERT_LE((angular() - spin_before).norm(), 1e-6) << tick;
      ASSERT_LE(energy(), energy_before * (1.0 + 1e-6)) << tick;
    }
    EXPECT_TRUE(met) << off;
    EXPECT_LT(energy(), 0.9 * energy_before) << "impacts are inelastic";
  }
}

TEST(FreeBody, AFallingBoxStopsOnTheFloorWithoutBouncing) {
  test::SmallScene small;
  const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
  const ObjectId box = small.freeBox("box", kSize, kMass, {0.0, 0.0, 0.3});
  small.pair(box, ground);
  Environment environment(small.build(), {});
  double lowest = 1.0;
  for (int tick = 0; tick < 1000; ++tick) {
    environment.step();
    lowest = std::min(lowest, positionOf(environment, box).z());
    if (environment.inContact(box, ground)) {
      ASSERT_LE(velocityOf(environment, box).z(), 0.01) << tick;
    }
  }
  EXPECT_GE(lowest, 0.5 * kSize.z() - 5e-5);
  EXPECT_NEAR(positionOf(environment, box).z(), 0.5 * kSize.z(), 5e-5);
  EXPECT_TRUE(environment.objects()[box.value].asleep);
}

}  // namespace
}  // namespace tenon::simulation
