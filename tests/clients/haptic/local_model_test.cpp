#include "clients/haptic/local_model.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "clients/haptic/coupling.h"
#include "tests/clients/haptic/plane_server.h"
#include "tests/support/realtime_guard.h"

namespace tenon::haptic {
namespace {

using test::PlaneServer;
constexpr double kStep = 1e-3;

//      o  ball of radius 12 mm, moved by a hand below the floor
//   ~~~~~~~ floor z = 0
struct BallAboveFloor {
  explicit BallAboveFloor(double stiffness = 1000.0, double device_stiffness = 5000.0)
      : server(stiffness), coupling({.max_stiffness = device_stiffness, .damping = 5.0}) {
    world.begin(server.objects(), 0, 0);
  }
  void receive(const Pose& X_WH) {
    ++tick;
    world.receive(server.frame(tick));
    model.receive(server.manifold(tick, X_WH));
  }
  Wrench step(const Pose& X_WH) { return coupling.step(model.step(X_WH, world), X_WH, kStep); }
  static Pose at(double z) { return Pose(Vector3(0.3, 0.2, z)); }

  test::PlaneServer server;
  WorldView world;
  LocalModel model;
  Coupling coupling;
  Tick tick = 0;
};

TEST(LocalModel, RendersAWallOfTheServersStiffness) {
  BallAboveFloor setup(1000.0);
  setup.receive(BallAboveFloor::at(0.02));
  for (const double depth : {0.001, 0.003, 0.008}) {
    Wrench wrench;
    for (int i = 0; i < 15; ++i) {
      setup.receive(
          BallAboveFloor::at(0.02));  // manifolds of an old device pose: the force follows the present one
      for (int k = 0; k < 10; ++k) wrench = setup.step(BallAboveFloor::at(0.012 - depth));
    }
    EXPECT_NEAR(wrench.force.z(), 1000.0 * depth, 0.01 * 1000.0 * depth) << depth;
    EXPECT_NEAR(wrench.force.head<2>().norm(), 0.0, 1e-9);
    EXPECT_TRUE(setup.model.proxy().touching);
    EXPECT_NEAR(setup.model.proxy().X_WO.translation().z(), 0.012, 1e-7);
  }
}

TEST(LocalModel, RendersNoForceInFastFreeMotion) {
  BallAboveFloor setup;
  for (int i = 0; i < 500; ++i) {
    const Pose X_WH = BallAboveFloor::at(0.1 + 0.0005 * (i % 50));
    setup.receive(X_WH);
    const Wrench wrench = setup.step(X_WH);
    EXPECT_LT(wrench.force.norm(), 1e-9);
    EXPECT_LT(wrench.torque.norm(), 1e-9);
  }
}

TEST(LocalModel, MovesContactPlanesWithTheirBodies) {
  BallAboveFloor setup(1000.0);
  setup.receive(BallAboveFloor::at(0.012));
  setup.step(BallAboveFloor::at(0.012));
  setup.server.floor_height = 0.002;
  setup.world.receive(setup.server.frame(2));  // the floor has risen since the manifold
  Wrench wrench;
  for (int i = 0; i < 15; ++i) wrench = setup.step(BallAboveFloor::at(0.012));
  EXPECT_NEAR(wrench.force.z(), 2.0, 0.1);
}

//   the floor was heard at rest height, rising at `speed`; the hand stays where its ball just touches
double proxyHeight(double speed, double ticks_ahead) {
  BallAboveFloor setup(1000.0);
  setup.receive(BallAboveFloor::at(0.012));
  HandManifold manifold = setup.server.manifold(++setup.tick, BallAboveFloor::at(0.012));
  for (ManifoldContact& contact : manifold.contacts)
    contact.velocity_W = Vector3(0.0, 0.0, speed).cast<float>();
  setup.world.receive(setup.server.frame(setup.tick));
  setup.model.receive(manifold);
  setup.model.expectAt(static_cast<double>(setup.tick) + ticks_ahead);
  return setup.model.step(BallAboveFloor::at(0.012), setup.world).X_WO.translation().z();
}

TEST(LocalModel, ExpectsPlanesWhereTheirBodiesAreByNow) {
  EXPECT_NEAR(proxyHeight(0.1, 0.0), 0.012, 1e-8);
  EXPECT_NEAR(proxyHeight(0.1, 10.0), 0.013, 1e-6);
  EXPECT_NEAR(proxyHeight(0.1, -5.0), 0.012, 1e-8) << "a frame that is ahead";
  EXPECT_NEAR(proxyHeight(0.1, 100.0), 0.012 + 0.1 * LocalModel::kLongestExpectation, 1e-6);
  EXPECT_NEAR(proxyHeight(0.009, 10.0), 0.012, 1e-8) << "what gives way is not pushed on";
  EXPECT_NEAR(proxyHeight(0.5, 2.0), 0.013, 1e-6);
  EXPECT_NEAR(proxyHeight(0.5, 20.0), 0.012 + LocalModel::kFarthestExpectation, 1e-6) << "it may stop";
  EXPECT_NEAR(proxyHeight(5.0, 20.0), 0.012, 1e-8) << "a displacement of one tick";
}

TEST(Coupling, AProxyThatIsNoNumberIsForgottenWithTheNext) {
  Coupling coupling({.damping = 5.0});
  LocalProxy proxy;
  proxy.active = true;
  proxy.stiffness = 1000.0;
  proxy.X_WS = Pose(Vector3(0.0, 0.0, 0.002));
  for (const bool first : {true, false}) {
    if (!first) (void)coupling.step(proxy, Pose(), kStep);
    LocalProxy bad = proxy;
    bad.X_WS = Pose(Vector3::Constant(std::numeric_limits<double>::quiet_NaN()));
    EXPECT_FALSE(coupling.step(bad, Pose(), kStep).force.allFinite());
    EXPECT_NEAR(coupling.step(proxy, Pose(), kStep).force.z(), 2.0, 1e-9);
    EXPECT_NEAR(coupling.step(proxy, Pose(), kStep).force.z(), 2.0, 1e-9);
  }
}

//   the floor goes out of reach, and is there again after it has jumped
TEST(LocalModel, ABodyThatComesBackWithANewEpochHasJumped) {
  BallAboveFloor setup;
  setup.receive(BallAboveFloor::at(0.012));
  setup.step(BallAboveFloor::at(0.010));
  HandManifold far = setup.server.manifold(++setup.tick, BallAboveFloor::at(0.012));
  far.contacts.clear();
  setup.model.receive(far);
  setup.step(BallAboveFloor::at(0.010));
  ASSERT_TRUE(setup.model.proxy().active);
  ++setup.server.floor_epoch;
  setup.server.lists_floor = true;
  setup.receive(BallAboveFloor::at(0.012));
  EXPECT_FALSE(setup.model.usable(setup.world));
  setup.step(BallAboveFloor::at(0.010));
  EXPECT_TRUE(setup.model.proxy().discontinuous);
  EXPECT_TRUE(setup.model.usable(setup.world)) << "the planes are those after the jump";
}

TEST(LocalModel, LimitsTheStiffnessToThatOfTheDevice) {
  BallAboveFloor setup(5000.0, 2000.0);
  setup.receive(BallAboveFloor::at(0.012));
  Wrench wrench;
  for (int i = 0; i < 15; ++i) wrench = setup.step(BallAboveFloor::at(0.010));
  EXPECT_NEAR(wrench.force.z(), 4.0, 0.2);
}

TEST(LocalModel, RendersNothingOnceTheObjectsEpochIsNewerThanItsManifold) {
  BallAboveFloor setup(1000.0);
  setup.receive(BallAboveFloor::at(0.012));
  setup.step(BallAboveFloor::at(0.010));
  ASSERT_TRUE(setup.model.usable(setup.world));
  setup.server.epoch = 2;
  setup.world.receive(setup.server.frame(setup.tick + 1));  // a grab: its manifold has not arrived yet
  EXPECT_FALSE(setup.model.usable(setup.world));
  EXPECT_EQ(setup.step(BallAboveFloor::at(0.010)).force.norm(), 0.0);
  setup.receive(BallAboveFloor::at(0.012));
  EXPECT_TRUE(setup.model.jumped());
}

TEST(LocalModel, IgnoresOvertakenManifolds) {
  BallAboveFloor setup;
  setup.model.receive(setup.server.manifold(10, BallAboveFloor::at(0.012)));
  setup.server.radius = 0.1;
  setup.model.receive(setup.server.manifold(9, BallAboveFloor::at(0.012)));
  EXPECT_EQ(setup.model.manifold().tick, 10U);
}

TEST(LocalModel, CountsTicksAheadOfTheContactSet) {
  BallAboveFloor setup;
  setup.server.validity_radius = 0.01;
  setup.receive(BallAboveFloor::at(0.1));
  setup.step(BallAboveFloor::at(0.105));
  EXPECT_EQ(setup.model.beyondValidity(), 0U);
  setup.step(BallAboveFloor::at(0.120));
  setup.step(BallAboveFloor::at(0.120));
  EXPECT_EQ(setup.model.beyondValidity(), 2U);
}

TEST(LocalModel, RendersNoForceWhileTheObjectIsFrozen) {
  BallAboveFloor setup;
  setup.receive(BallAboveFloor::at(0.012));
  setup.step(BallAboveFloor::at(0.012));
  HandManifold frozen = setup.server.manifold(2, BallAboveFloor::at(0.012));
  frozen.frozen = true;
  setup.model.receive(frozen);
  Wrench wrench;
  for (int i = 0; i < 30; ++i) wrench = setup.step(BallAboveFloor::at(0.005));
  EXPECT_EQ(wrench.force.norm(), 0.0);
}

/// Another hand that holds the ball, with a goal that moves at 0.2 m/s along x; manifolds come every 20 ms.
struct BallInTwoHands : BallAboveFloor {
  static constexpr double kSpeed = 0.2;  // [m/s]
  static constexpr int kPeriod = 20;     // [ticks]

  HandManifold manifold(bool is_held_by_both) {
    HandManifold told = server.manifold(tick, at(0.1));
    if (is_held_by_both) {
      HandPull pull{.hand = HandId{7}, .object = told.object, .X_WG = told.X_WO};
      pull.X_WG.translation().x() += kSpeed * kStep * static_cast<double>(tick) + jump;
      pull.V_WG[0] = kSpeed;
      pull.stiffness = 1000.0;
      told.others.push_back(pull);
    }
    return told;
  }
  /// [N] Largest change of the force from one cycle to the next in `ticks`.
  double run(int ticks, bool is_held_by_both) {
    double largest = 0.0;
    for (int i = 0; i < ticks; ++i) {
      world.receive(server.frame(++tick));
      if (tick % kPeriod == 0) model.receive(manifold(is_held_by_both));
      const Vector3 force = step(at(0.1)).force;
      largest = std::max(largest, (force - last).norm());
      last = force;
    }
    return largest;
  }
  Vector3 last = Vector3::Zero();
  double jump = 0.0;  // [m] of the goal
};

//   [ball]--0.2 m--(other)     two springs that are 0.5 m from their goals, across the line between them
TEST(LocalModel, SpringsFarFromTheirGoalsComeToRest) {
  BallInTwoHands setup;
  setup.tick = 1;
  HandManifold held = setup.manifold(true);
  HandPull& pull = held.others[0];
  pull.X_WG = held.X_WO;
  pull.V_WG.setZero();
  pull.p_BoC_B = {0.2, 0.0, 0.0};
  const Pose X_WH = displaced(held.X_WO, {Vector3(0.0, 1.0, 0.0), Vector3::Zero()}, Vector3::Zero());
  setup.world.receive(setup.server.frame(1));
  setup.model.receive(held);
  for (int i = 0; i < 200; ++i) {
    const Vector3 force = setup.step(X_WH).force;
    if (i > 150) {
      ASSERT_LT((force - setup.last).norm(), 1e-3) << i;
    }
    setup.last = force;
  }
}

TEST(LocalModel, AGoalThatIsToldElsewhereChangesTheForceSlowly) {
  BallInTwoHands setup;
  setup.run(100, true);
  setup.jump = 0.01;
  // 0.2 N, and what the goal moves in a cycle
  EXPECT_LT(setup.run(60, true), 0.2 + 1000.0 * BallInTwoHands::kSpeed * kStep);
}

TEST(LocalModel, AHandThatLetsGoWhileItMovesLeavesNoStep) {
  BallInTwoHands setup;
  setup.run(20, true);
  setup.run(60, true);
  const double held = setup.run(40, true);
  ASSERT_GT(setup.last.norm(), 1.0) << "it is felt";
  // its spring of 20 N at most fades within 20 ticks
  EXPECT_LT(setup.run(60, false), held + 1.5);
  EXPECT_LT(setup.last.norm(), 0.1);
}

TEST(LocalModel, GoalsOfOtherHandsAreThoseToldAfterItWasInactive) {
  BallInTwoHands setup;
  setup.run(100, true);
  HandManifold frozen = setup.manifold(true);
  frozen.frozen = true;
  setup.model.receive(frozen);
  for (int i = 0; i < 5; ++i) setup.step(BallAboveFloor::at(0.1));
  setup.tick += 500;  // 0.1 m farther
  HandManifold back = setup.manifold(true);
  back.others[0].V_WG.setZero();
  for (int i = 0; i < 200; ++i) {
    back.tick = ++setup.tick;
    setup.world.receive(setup.server.frame(setup.tick));
    setup.model.receive(back);
    setup.step(BallAboveFloor::at(0.1));
  }
  // two equal springs: the ball is half way between the hands' goals
  const double apart = back.others[0].X_WG.translation().x() - 0.3;
  EXPECT_NEAR(setup.model.proxy().X_WO.translation().x(), 0.3 + apart / 2, 1e-4);
}

TEST(LocalModel, AllocatesNothingAndLocksNothing) {
  BallAboveFloor setup;
  setup.receive(BallAboveFloor::at(0.012));
  setup.step(BallAboveFloor::at(0.010));
  const HandManifold manifold = setup.server.manifold(2, BallAboveFloor::at(0.010));
  const WorldFrame frame = setup.server.frame(2);
  const test::RealtimeGuard guard;
  for (int i = 0; i < 100; ++i) {
    setup.world.receive(frame);
    setup.model.receive(manifold);
    setup.step(BallAboveFloor::at(0.010));
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::haptic
