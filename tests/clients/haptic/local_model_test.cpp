#include "clients/haptic/local_model.h"

#include <gtest/gtest.h>

#include "clients/haptic/coupling.h"
#include "tests/clients/haptic/plane_server.h"
#include "tests/support/realtime_guard.h"

namespace tenon {
namespace {

using test::PlaneServer;
constexpr double kStep = 1e-3;

//      o  ball, radius 12 mm, in a hand that dives below the floor
//   ~~~~~~~ floor z = 0
struct Bench {
  explicit Bench(double stiffness = 1000.0, double device_stiffness = 5000.0)
      : server(stiffness), coupling({.max_stiffness = device_stiffness, .damping = 5.0}) {
    world.begin(server.objects(), 0, 0);
  }
  void hear(const Pose& X_WH) {
    ++tick;
    world.receive(server.frame(tick));
    model.receive(server.manifold(tick, X_WH));
  }
  Wrench feel(const Pose& X_WH) { return coupling.step(model.step(X_WH, world), X_WH, kStep); }
  static Pose at(double z) { return Pose(Vector3(0.3, 0.2, z)); }

  PlaneServer server;
  WorldView world;
  LocalModel model;
  Coupling coupling;
  Tick tick = 0;
};

TEST(LocalModel, FeelsAWallOfTheServersStiffness) {
  Bench bench(1000.0);
  bench.hear(Bench::at(0.02));
  for (const double depth : {0.001, 0.003, 0.008}) {
    Wrench felt;
    for (int i = 0; i < 15; ++i) {
      bench.hear(Bench::at(0.02));  // the server still answers an old hand: what is felt is of now
      for (int k = 0; k < 10; ++k) felt = bench.feel(Bench::at(0.012 - depth));
    }
    EXPECT_NEAR(felt.force.z(), 1000.0 * depth, 0.01 * 1000.0 * depth) << depth;
    EXPECT_NEAR(felt.force.head<2>().norm(), 0.0, 1e-9);
    EXPECT_TRUE(bench.model.proxy().touching);
    EXPECT_NEAR(bench.model.proxy().X_WO.translation().z(), 0.012, 1e-7);
  }
}

TEST(LocalModel, FeelsNothingInFreeMotionHoweverQuick) {
  Bench bench;
  for (int i = 0; i < 500; ++i) {
    const Pose X_WH = Bench::at(0.1 + 0.0005 * (i % 50));
    bench.hear(X_WH);
    const Wrench felt = bench.feel(X_WH);
    EXPECT_LT(felt.force.norm(), 1e-9);
    EXPECT_LT(felt.torque.norm(), 1e-9);
  }
}

TEST(LocalModel, CarriesItsPlanesWithTheBodyTheyBelongTo) {
  Bench bench(1000.0);
  bench.hear(Bench::at(0.012));
  bench.feel(Bench::at(0.012));
  bench.server.floor_height = 0.002;
  bench.world.receive(bench.server.frame(2));  // the floor rose; the manifold is of before
  Wrench felt;
  for (int i = 0; i < 15; ++i) felt = bench.feel(Bench::at(0.012));
  EXPECT_NEAR(felt.force.z(), 2.0, 0.1);
}

TEST(LocalModel, IsNeverStifferThanTheDeviceCanBe) {
  Bench bench(5000.0, 2000.0);
  bench.hear(Bench::at(0.012));
  Wrench felt;
  for (int i = 0; i < 15; ++i) felt = bench.feel(Bench::at(0.010));
  EXPECT_NEAR(felt.force.z(), 4.0, 0.2);
}

//   force   ----------.
//                      `.
//   age     0    20      100
TEST(LocalModel, LetsAStaleManifoldDecay) {
  Bench bench(1000.0);
  bench.hear(Bench::at(0.012));
  std::array<double, 121> force{};
  for (std::size_t age = 0; age < force.size(); ++age) force[age] = bench.feel(Bench::at(0.010)).force.z();
  EXPECT_NEAR(force[20], 2.0, 0.1);
  EXPECT_NEAR(force[60], 1.0, 0.1);
  EXPECT_EQ(force[100], 0.0);
  EXPECT_EQ(force[120], 0.0);
  for (std::size_t age = 41; age <= 100; ++age) EXPECT_LE(force[age], force[age - 1]);
}

TEST(LocalModel, FadesWhatWasFeltWhenTheObjectsEpochIsNewerThanItsManifold) {
  Bench bench(1000.0);
  bench.hear(Bench::at(0.012));
  double before = 0.0;
  for (int i = 0; i < 30; ++i) {
    bench.hear(Bench::at(0.012));
    before = bench.feel(Bench::at(0.010)).force.z();
  }
  ASSERT_NEAR(before, 2.0, 0.02);
  bench.server.epoch = 2;
  bench.world.receive(
      bench.server.frame(bench.tick + 1));  // a grab was declared; its manifold is not here yet
  double last = before;
  for (int i = 0; i < 25; ++i) {
    const double now = bench.feel(Bench::at(0.010)).force.z();
    EXPECT_LE(now, last + 1e-12);
    EXPECT_LT(last - now, 0.15);  // a ramp, not a step
    last = now;
  }
  EXPECT_EQ(last, 0.0);
}

TEST(LocalModel, IgnoresManifoldsThatWereOvertaken) {
  Bench bench;
  bench.model.receive(bench.server.manifold(10, Bench::at(0.012)));
  bench.server.radius = 0.1;
  bench.model.receive(bench.server.manifold(9, Bench::at(0.012)));
  EXPECT_EQ(bench.model.manifold().tick, 10U);
}

TEST(LocalModel, CountsTicksBeyondItsValidity) {
  Bench bench;
  bench.server.validity_radius = 0.01;
  bench.hear(Bench::at(0.1));
  bench.feel(Bench::at(0.105));
  EXPECT_EQ(bench.model.beyondValidity(), 0U);
  bench.feel(Bench::at(0.120));
  bench.feel(Bench::at(0.120));
  EXPECT_EQ(bench.model.beyondValidity(), 2U);
}

TEST(LocalModel, IsSilentWhileTheServerHoldsTheObjectFrozen) {
  Bench bench;
  bench.hear(Bench::at(0.012));
  bench.feel(Bench::at(0.012));
  HandManifold frozen = bench.server.manifold(2, Bench::at(0.012));
  frozen.frozen = true;
  bench.model.receive(frozen);
  Wrench felt;
  for (int i = 0; i < 30; ++i) felt = bench.feel(Bench::at(0.005));
  EXPECT_EQ(felt.force.norm(), 0.0);
}

TEST(LocalModel, AllocatesNothingAndLocksNothing) {
  Bench bench;
  bench.hear(Bench::at(0.012));
  bench.feel(Bench::at(0.010));
  const HandManifold manifold = bench.server.manifold(2, Bench::at(0.010));
  const WorldFrame frame = bench.server.frame(2);
  const test::RealtimeGuard guard;
  for (int i = 0; i < 100; ++i) {
    bench.world.receive(frame);
    bench.model.receive(manifold);
    bench.feel(Bench::at(0.010));
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon
