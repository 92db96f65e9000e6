#include "tests/server/simulation/many_bodies.h"

#include <gtest/gtest.h>

#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

constexpr Tick kTicksOfBodies = 600;

/// State hashes of ten cubes, three of them moved by hands. Independent of the processor, its vector
/// instructions, the number of workers and the optimisation level.
constexpr std::uint64_t kHashAfter1000Ticks = 1901672161154915555U;
constexpr std::uint64_t kHashAfter10000Ticks = 15841411106850169388U;

std::vector<std::uint64_t> hashes(Environment& environment, const test::ManyBodies& bodies, Tick until) {
  std::vector<std::uint64_t> result;
  while (environment.tick() < until) {
    bodies.step(environment);
    result.push_back(environment.hash());
  }
  return result;
}

TEST(ManyBodies, OnlyNearPairsOfTwoHundredBodiesAreQueried) {
  const test::ManyBodies bodies(200, 4);
  Environment environment(bodies.scene, {});
  std::uint32_t queries = 0;
  while (environment.tick() < kTicksOfBodies) {
    bodies.step(environment);
    if (environment.tick() < 100) continue;
    queries = std::max(queries, environment.work().queried_pairs);
    ASSERT_EQ(environment.work().deferred_pairs, 0U);
  }
  EXPECT_EQ(environment.work().active_pairs, 200U * 199U / 2U + 200U);
  EXPECT_LT(environment.work().near_pairs, 2000U);
  EXPECT_LE(queries, 60U) << "four cubes, each with the floor and its neighbours";
  for (std::size_t i = 0; i < bodies.hands.size(); ++i) {
    EXPECT_TRUE(environment.inContact(bodies.cubes[i], bodies.floor));
  }
}

TEST(ManyBodies, AreBitEqualForAnyNumberOfWorkersAndAfterARestore) {
  const test::ManyBodies bodies(50, 10, 0.06);
  Environment one(bodies.scene, {});
  const auto start = hashes(one, bodies, kTicksOfBodies / 2);
  const std::vector<std::uint8_t> bytes = one.save();
  const auto rest = hashes(one, bodies, kTicksOfBodies);
  for (const unsigned workers : {2U, 4U}) {
    EnvironmentOptions options;
    options.workers = workers;
    Environment many(bodies.scene, options);
    EXPECT_EQ(hashes(many, bodies, kTicksOfBodies / 2), start) << workers << " workers";
    EXPECT_EQ(many.save(), bytes);
    Environment restored(bodies.scene, options);
    ASSERT_TRUE(restored.restore(bytes));
    EXPECT_EQ(hashes(restored, bodies, kTicksOfBodies), rest) << workers << " workers";
  }
}

void expectHashForAnyNumberOfWorkers(Tick ticks, std::uint64_t golden) {
  const test::ManyBodies bodies(10, 3);
  for (const unsigned workers : {1U, 2U, 4U}) {
    EnvironmentOptions options;
    options.workers = workers;
    Environment environment(bodies.scene, options);
    while (environment.tick() < ticks) bodies.step(environment);
    EXPECT_EQ(environment.hash(), golden) << workers << " workers";
  }
}

TEST(ManyBodies, ReachTheGoldenHashForAnyNumberOfWorkers) {
  expectHashForAnyNumberOfWorkers(1000, kHashAfter1000Ticks);
}
TEST(ManyBodiesNightly, ReachTheGoldenHashForAnyNumberOfWorkers) {
  expectHashForAnyNumberOfWorkers(10'000, kHashAfter10000Ticks);
}

TEST(ManyBodies, StepAllocatesNothingAndLocksNothing) {
  const test::ManyBodies bodies(50, 10, 0.06);
  EnvironmentOptions options;
  options.workers = 2;
  Environment environment(bodies.scene, options);
  bodies.step(environment);
  const test::RealtimeGuard guard(test::CountedThreads::kAll);
  while (environment.tick() < 200) {
    bodies.step(environment);
    if (environment.tick() == 100) environment.place(bodies.cubes[20], Pose(), ObjectStatus::kHidden);
    if (environment.tick() == 120) environment.setPairEnabled(3, false);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

// The only contact list is used by two overlapping cubes.
TEST(ManyBodies, AnObjectWhosePairHasNoContactListStandsStill) {
  test::SmallScene small;
  const ObjectId one = small.object("one", test::cubeShape(), {1.0, 0.0, 0.0});
  const ObjectId other = small.object("other", test::cubeShape(), {1.03, 0.0, 0.0});
  const ObjectId floor = small.object("floor", test::floorShape(), Vector3::Zero());
  const ObjectId pointer = small.object("pointer", test::pointerShape(), {0.0, 0.0, 0.6});
  const HandId hand = small.hand("hand", pointer);
  small.pair(one, other);
  small.pair(pointer, floor);
  EnvironmentOptions options;
  options.contact_lists = 1;
  Environment environment(small.build(), options);
  test::activateHand(environment, hand, {0.0, 0.0, 0.6});
  test::moveHandTo(environment, hand, {0.0, 0.0, -0.1}, 1500);
  EXPECT_EQ(environment.work().deferred_pairs, 1U);
  const auto height = [&] { return environment.objects()[pointer.value].X_WO.translation().z(); };
  EXPECT_GT(height(), test::kPointerRadius);
  EXPECT_EQ(environment.objects()[pointer.value].V_WO.linear.norm(), 0.0);
  EXPECT_LT(environment.forceOn(pointer).force.z(), 0.0) << "the coupling pulls the hand back";

  environment.place(one, Pose(), ObjectStatus::kHidden);
  test::stepTicks(environment, 1000);
  EXPECT_EQ(environment.work().deferred_pairs, 0U);
  EXPECT_NEAR(height(), test::kPointerRadius, 0.1e-3);
  EXPECT_TRUE(environment.inContact(pointer, floor));
}

}  // namespace
}  // namespace tenon::simulation
