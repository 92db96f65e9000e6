#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/busy_scene.h"
#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

constexpr Tick kTicks = 3000;  // until all inputs of the busy scene have been made

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
  expectBitEqualForAnyNumberOfWorkers(kTicks);
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
  while (environment.tick() < kTicks) {
    busy.play(environment, environment.tick() + 1);
    contact_ticks += environment.objects()[busy.parts[0].value].in_contact ? 1 : 0;
    skipped += static_cast<int>(environment.work().active_pairs - environment.work().queried_pairs);
    capped_load = capped_load && environment.work().load_percent <= 100.0;
    for (const ObjectMotion& object : environment.objects()) ASSERT_TRUE(object.X_WO.isFinite());
  }
  EXPECT_GT(contact_ticks, 200);
  EXPECT_GT(skipped, 20 * static_cast<int>(kTicks)) << "most pairs are far apart most of the time";
  EXPECT_TRUE(capped_load);
}

TEST(EnvironmentDeterminism, CoherenceNeverMissesAContact) {
  const test::BusyScene busy;
  EnvironmentOptions every_pair;
  every_pair.coherence = false;
  Environment skipping(busy.scene, {});
  Environment querying(busy.scene, every_pair);
  while (skipping.tick() < kTicks) {
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

TEST(EnvironmentDeterminism, AnInvalidCheckpointIsRejectedAndChangesNothing) {
  const test::BusyScene busy;
  Environment environment(busy.scene, withWorkers(1));
  busy.play(environment, 400);
  const std::vector<std::uint8_t> good = environment.save();
  const std::uint64_t hash = environment.hash();
  for (std::size_t size = 0; size < good.size(); size += 1 + size / 8) {
    EXPECT_FALSE(environment.restore(std::span(good).first(size)));
  }
  std::vector<std::uint8_t> bad = good;
  bad.push_back(0);
  EXPECT_FALSE(environment.restore(bad));
  bad = good;
  bad[0] ^= 0xFF;
  const Result<void> version = environment.restore(bad);
  ASSERT_FALSE(version);
  EXPECT_NE(version.error().what.find("version"), std::string::npos);
  EXPECT_EQ(environment.hash(), hash);

  test::SmallScene other;
  other.object("alone", nullptr, Vector3::Zero());
  Environment elsewhere(other.build(), {});
  EXPECT_FALSE(elsewhere.restore(good));
}

TEST(EnvironmentDeterminism, RestoreSurvivesCorruptedBytes) {
  const test::BusyScene busy;
  Environment environment(busy.scene, withWorkers(1));
  busy.play(environment, 320);
  const std::vector<std::uint8_t> good = environment.save();
  const std::uint64_t hash = environment.hash();
  std::uint64_t seed = 42;
  int restored = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<std::uint8_t> bad = good;
    for (int flip = 0; flip < 4; ++flip) {
      seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
      bad[(seed >> 20U) % bad.size()] ^= static_cast<std::uint8_t>(seed >> 56U);
    }
    if (environment.restore(bad)) {
      environment.step();
      ++restored;
    }
  }
  EXPECT_GT(restored, 0) << "no damage was in a number: nothing was tried";
  EXPECT_LT(restored, 200) << "no damage was noticed";
  ASSERT_TRUE(environment.restore(good));
  EXPECT_EQ(environment.hash(), hash);
}

TEST(EnvironmentDeterminism, ACheckpointWithANumberThatIsNotFiniteIsRejected) {
  const test::BusyScene busy;
  Environment environment(busy.scene, withWorkers(1));
  busy.play(environment, 320);
  // a tick with contacts and with all kinds of force cells
  while (environment.nearPairs().empty() || !environment.objects()[busy.parts[0].value].in_contact) {
    ASSERT_LT(environment.tick(), kTicks);
    busy.play(environment, environment.tick() + 1);
  }
  environment.contribute(busy.parts[0], 1, {Vector3(1, 2, 3), Vector3::Zero()}, 100);
  const std::vector<std::uint8_t> good = environment.save();
  const std::uint64_t hash = environment.hash();
  const std::vector<std::size_t> doubles = environment.savedDoubles();
  ASSERT_GT(doubles.size(), 300U);
  ASSERT_LE(doubles.back() + sizeof(double), good.size());
  for (const double number : {std::nan(""), -std::numeric_limits<double>::infinity()}) {
    for (const std::size_t at : doubles) {
      std::vector<std::uint8_t> bad = good;
      std::memcpy(bad.data() + at, &number, sizeof number);
      const Result<void> restored = environment.restore(bad);
      ASSERT_FALSE(restored) << number << " at byte " << at;
      ASSERT_EQ(restored.error().what, "checkpoint: contains a number that is not finite") << at;
    }
  }
  EXPECT_EQ(environment.hash(), hash);
  ASSERT_TRUE(environment.restore(good));
}

TEST(EnvironmentDeterminism, SavedDoublesAreWhereTheNumbersAre) {
  test::SmallScene small;
  const ObjectId object = small.object("alone", nullptr, Vector3(0.25, -3.0, 1e-9));
  Environment environment(small.build(), {});
  const std::vector<std::uint8_t> bytes = environment.save();
  std::vector<double> numbers;
  for (const std::size_t at : environment.savedDoubles()) {
    double number = 0.0;
    std::memcpy(&number, bytes.data() + at, sizeof number);
    numbers.push_back(number);
  }
  const Vector3& p_WO = environment.objects()[object.value].X_WO.translation();
  const auto found = std::search(numbers.begin(), numbers.end(), p_WO.data(), p_WO.data() + 3);
  EXPECT_NE(found, numbers.end());
}

TEST(EnvironmentDeterminism, StepAllocatesNothingAndLocksNothing) {
  const test::BusyScene busy;
  for (const unsigned workers : {1U, 2U}) {
    Environment environment(busy.scene, withWorkers(workers));
    busy.play(environment, 10);
    HandManifold manifold;
    PairContact contact;
    const test::RealtimeGuard guard(test::CountedThreads::kAll);
    std::uint64_t hash = 0;
    while (environment.tick() < 1300) {
      busy.play(environment, environment.tick() + 1);
      hash ^= environment.hash();
      environment.manifold(busy.right, manifold);
      environment.pairContact(0, contact);
    }
    EXPECT_NE(hash, 0U);
    EXPECT_EQ(guard.allocations(), 0);
    EXPECT_EQ(guard.locks(), 0);
  }
}

}  // namespace
}  // namespace tenon::simulation
