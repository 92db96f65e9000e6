#include <algorithm>
#include <array>
#include <memory>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/busy_scene.h"
#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

constexpr Tick kTicksOfScene = 3000;  // until all inputs of the busy scene have been made

EnvironmentOptions withWorkers(unsigned workers) {
  EnvironmentOptions options;
  options.workers = workers;
  return options;
}

std::vector<std::uint64_t> hashes(Environment& environment, const test::BusyScene& busy, Tick until) {
  std::vector<std::uint64_t> result;
  while (environment.tick() < until) {
    busy.play(environment, environment.tick() + 1);
    result.push_back(environment.hash());
  }
  return result;
}

void expectBitEqualForAnyNumberOfWorkers(Tick ticks) {
  const test::BusyScene busy;
  Environment one(busy.scene, withWorkers(1));
  const auto expected = hashes(one, busy, ticks);
  ASSERT_EQ(expected.size(), ticks);
  for (const unsigned workers : {2U, 4U}) {
    Environment many(busy.scene, withWorkers(workers));
    EXPECT_EQ(hashes(many, busy, ticks), expected) << workers << " workers";
  }
}

TEST(EnvironmentDeterminism, IsBitEqualForOneTwoAndFourWorkers) {
  expectBitEqualForAnyNumberOfWorkers(kTicksOfScene);
}
TEST(EnvironmentDeterminismNightly, IsBitEqualForOneTwoAndFourWorkers) {
  expectBitEqualForAnyNumberOfWorkers(10'000);
}

TEST(EnvironmentDeterminism, TheSceneHasContactsAndSkippedPairs) {
  const test::BusyScene busy;
  Environment environment(busy.scene, withWorkers(1));
  int contact_ticks = 0;
  int skipped = 0;
  bool capped_load = true;
  while (environment.tick() < kTicksOfScene) {
    busy.play(environment, environment.tick() + 1);
    contact_ticks += environment.objects()[busy.parts[0].value].in_contact ? 1 : 0;
    skipped += static_cast<int>(environment.work().active_pairs - environment.work().queried_pairs);
    capped_load = capped_load && environment.work().load_percent <= 100.0;
    for (const ObjectMotion& object : environment.objects()) ASSERT_TRUE(object.X_WO.isFinite());
  }
  EXPECT_GT(contact_ticks, 200);
  EXPECT_GT(skipped, 20 * static_cast<int>(kTicksOfScene)) << "most pairs are far apart most of the time";
  EXPECT_TRUE(capped_load);
}

// So that restores and numbers of workers are tried with contacts of features, those that hold nothing too.
TEST(EnvironmentDeterminism, TheSceneHasCrossingsOfEdgesBeforeAndAfterTheCheckpoint) {
  const test::BusyScene busy;
  Environment environment(busy.scene, withWorkers(1));
  const auto& bar = *busy.heldBarShape();
  const auto& beam = *busy.beamShape();
  const collision::PairFeatures features{&bar.features, &beam.features, &bar.field, 0.0};
  const auto scratch = std::make_unique<collision::FeatureScratch>();
  const auto found = std::make_unique<collision::PairQueryResult>();
  std::array<int, 2> active{}, dormant{};  // ticks: before and after the checkpoint
  while (environment.tick() < kTicksOfScene) {
    busy.play(environment, environment.tick() + 1);
    const ObjectMotion& motion = environment.objects()[busy.bar.value];
    if (!motion.in_contact) continue;
    const collision::PairQuery query{&bar.shell, &beam.field, motion.X_WO,
                                     environment.objects()[busy.beam.value].X_WO, 0.0005};
    collision::queryPair(query, *found);
    collision::queryFeatures(query, features, *scratch, *found);
    const std::size_t part = environment.tick() <= 1000 ? 0 : 1;
    const auto isTouching = [](const collision::Contact& one) {
      return one.kind == collision::ContactKind::kCrossing && one.gap <= collision::kTouchGap;
    };
    const auto isDormant = [](const collision::Contact& one) { return one.dormant(); };
    active[part] += std::ranges::any_of(found->contacts, isTouching) ? 1 : 0;
    dormant[part] += std::ranges::any_of(found->contacts, isDormant) ? 1 : 0;
  }
  for (const std::size_t part : {0U, 1U}) {
    EXPECT_GT(active[part], 50);
    EXPECT_GT(dormant[part], 10);
  }
}

TEST(EnvironmentDeterminism, CoherenceNeverMissesAContact) {
  const test::BusyScene busy;
  EnvironmentOptions every_pair;
  every_pair.coherence = false;
  Environment skipping(busy.scene, {});
  Environment querying(busy.scene, every_pair);
  while (skipping.tick() < kTicksOfScene) {
    busy.play(skipping, skipping.tick() + 1);
    busy.play(querying, querying.tick() + 1);
    for (std::size_t i = 0; i < skipping.objects().size(); ++i) {
      const ObjectMotion& one = skipping.objects()[i];
      const ObjectMotion& other = querying.objects()[i];
      ASSERT_EQ(one.X_WO, other.X_WO) << "object " << i << ", tick " << skipping.tick();
      ASSERT_EQ(one.in_contact, other.in_contact) << "object " << i << ", tick " << skipping.tick();
    }
  }
}

TEST(EnvironmentDeterminism, ContinuesBitEqualAfterARestore) {
  const test::BusyScene busy;
  Environment original(busy.scene, withWorkers(1));
  busy.play(original, 1000);
  const std::vector<std::uint8_t> bytes = original.save();
  const std::uint64_t hash = original.hash();
  const auto expected = hashes(original, busy, 3000);

  Environment fresh(busy.scene, withWorkers(2));
  ASSERT_TRUE(fresh.restore(bytes));
  EXPECT_EQ(fresh.tick(), 1000U);
  EXPECT_EQ(fresh.hash(), hash);
  EXPECT_EQ(fresh.save(), bytes);
  EXPECT_EQ(hashes(fresh, busy, 3000), expected);

  // and an environment that is already ahead of the checkpoint
  ASSERT_TRUE(original.restore(bytes));
  EXPECT_EQ(hashes(original, busy, 3000), expected);
}

TEST(EnvironmentDeterminism, StepAllocatesNothingAndLocksNothing) {
  const test::BusyScene busy;
  for (const unsigned workers : {1U, 2U}) {
    Environment environment(busy.scene, withWorkers(workers));
    busy.play(environment, 10);
    HandManifold manifold;
    PairContact contact;
    bool crossed = false;
    const test::RealtimeGuard guard(test::CountedThreads::kAll);
    std::uint64_t hash = 0;
    while (environment.tick() < 1300) {
      busy.play(environment, environment.tick() + 1);
      hash ^= environment.hash();
      environment.manifold(busy.right, manifold);
      environment.manifold(busy.crossing, manifold);
      crossed = crossed || environment.objects()[busy.bar.value].in_contact;
      environment.pairContact(0, contact);
    }
    EXPECT_NE(hash, 0U);
    EXPECT_TRUE(crossed);
    EXPECT_EQ(guard.allocations(), 0);
    EXPECT_EQ(guard.locks(), 0);
  }
}

}  // namespace
}  // namespace tenon::simulation
