#include "server/session/broadcast.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "tests/server/session/small_session.h"

namespace tenon {
namespace {

using test::play;
using test::Stage;

constexpr std::uint32_t kEpoch = 77;

TEST(Broadcast, EveryTierHasItsTurn) {
  Stage stage;
  stage.attach(test::kRightHand, Vector3(0.2, 0, 0.3));
  Broadcast broadcast(stage.loaded().scenario, kEpoch, false);
  std::map<std::string, int> sent;
  for (int tick = 0; tick < 990; ++tick) {
    const Outgoing& outgoing = broadcast.read(stage.tick());
    sent["1k"] += !outgoing.frames.empty();
    sent["100"] += !outgoing.frames_100.empty();
    sent["30"] += !outgoing.frames_30.empty();
    sent["stats"] += outgoing.stats.has_value();
    sent["progress"] += outgoing.progress.has_value();
    sent["manifolds"] += static_cast<int>(outgoing.manifolds.size());
  }
  EXPECT_EQ(sent,
            (std::map<std::string, int>{
                {"1k", 990}, {"100", 99}, {"30", 30}, {"stats", 99}, {"progress", 30}, {"manifolds", 990}}));
}

TEST(Broadcast, NamesTheHandAndTheRunOfEachManifold) {
  Stage stage;
  stage.attach(test::kTeacherHand, Vector3(-0.3, 0, 0.3));
  Broadcast broadcast(stage.loaded().scenario, kEpoch, false);
  const Outgoing& outgoing = broadcast.read(stage.tick(3));
  ASSERT_EQ(outgoing.manifolds.size(), 1U) << "only of hands that are there";
  EXPECT_EQ(outgoing.manifolds[0]->hand, test::kTeacherHand);
  EXPECT_EQ(outgoing.manifolds[0]->server_epoch, kEpoch);
  EXPECT_EQ(outgoing.manifolds[0]->answers_seq, 3U);
  EXPECT_EQ(outgoing.manifolds[0]->tick, 3U);
}

//      ^ force       a peak between two samples of the slow tier
//      |   /\        must not be lost
//   ---+--'--`---+--> ticks
//      s         s
TEST(Broadcast, ASlowerTierCarriesTheLargestSinceItsLastSample) {
  Stage stage;
  Broadcast broadcast(stage.loaded().scenario, kEpoch, false);
  (void)broadcast.read(stage.tick(10));
  for (int tick = 11; tick <= 30; ++tick) {
    TickOutput output = stage.tick();
    const bool peak = tick == 14;
    PairState pair{2, {}};
    pair.contact.colliding = peak;
    pair.contact.peak_force = peak ? 9.0 : 0.5;
    pair.contact.peak_depth = peak ? 0.002 : 0.0;
    if (tick <= 16) output.pairs.push_back(pair);
    output.pairs_in_turn.clear();
    output.stats.load_percent = peak ? 80.0 : 1.0;
    output.stats.compute_seconds = peak ? 0.0007 : 0.0001;
    output.stats.input_age_seconds = peak ? 0.020 : 0.001;
    const Outgoing& outgoing = broadcast.read(output);
    if (tick == 20) {
      ASSERT_EQ(outgoing.pairs.size(), 1U);
      ASSERT_EQ(outgoing.pairs[0].pairs.size(), 1U) << "one that touched, though it does no more";
      EXPECT_FALSE(outgoing.pairs[0].pairs[0].colliding);
      EXPECT_EQ(outgoing.pairs[0].pairs[0].peak_force, 9.0);
      EXPECT_EQ(outgoing.pairs[0].pairs[0].peak_depth, 0.002);
      EXPECT_EQ(outgoing.stats->load_percent, 80.0);
      EXPECT_EQ(outgoing.stats->compute_seconds, 0.0001);
      EXPECT_EQ(outgoing.stats->compute_seconds_max, 0.0007);
      EXPECT_EQ(outgoing.stats->input_age_seconds, 0.020);
      EXPECT_EQ(outgoing.stats->server_epoch, kEpoch);
    } else if (tick == 30) {
      EXPECT_TRUE(outgoing.pairs.empty());
      EXPECT_EQ(outgoing.stats->load_percent, 1.0) << "each peak is told once";
      EXPECT_EQ(outgoing.stats->compute_seconds_max, 0.0001);
    } else {
      EXPECT_TRUE(outgoing.pairs.empty());
    }
  }
}

TEST(Broadcast, EveryPairOfTheMatrixIsToldWithinASecond) {
  Stage stage;
  Broadcast broadcast(stage.loaded().scenario, kEpoch, false);
  std::set<std::pair<std::uint32_t, std::uint32_t>> told;
  for (int tick = 0; tick < 1000; ++tick) {
    const Outgoing& outgoing = broadcast.read(stage.tick());
    for (const ContactPairs& sample : outgoing.pairs)
      for (const PairContact& pair : sample.pairs) told.emplace(pair.a.value, pair.b.value);
  }
  EXPECT_EQ(told.size(), stage.loaded().scene->pairs.size());
}

TEST(Broadcast, ManyPairsComeInNumberedParts) {
  Stage stage;
  Broadcast broadcast(stage.loaded().scenario, kEpoch, false);
  TickOutput output = stage.tick(10);
  output.pairs.clear();
  for (std::uint32_t i = 0; i < 20; ++i) {
    output.pairs.push_back({i, {.a = ObjectId{i}, .b = ObjectId{50}, .colliding = true}});
  }
  const Outgoing& outgoing = broadcast.read(output);
  ASSERT_EQ(outgoing.pairs.size(), 4U);
  std::uint32_t next = 0;
  for (std::uint32_t part = 0; part < 4; ++part) {
    EXPECT_EQ(outgoing.pairs[part].part, part);
    EXPECT_EQ(outgoing.pairs[part].parts, 4U);
    for (const PairContact& pair : outgoing.pairs[part].pairs) EXPECT_EQ(pair.a.value, next++);
  }
  EXPECT_EQ(next, 20U);
}

TEST(Broadcast, InLockstepEachTickSendsAllObjectsAndManifolds) {
  const LoadedScene loaded = test::smallSession();
  Exercise exercise = Stage::makeExercise(loaded);
  TickOutput output = exercise.makeOutput();
  Broadcast broadcast(loaded.scenario, kEpoch, true);
  for (Tick tick = 1; tick <= 25; ++tick) {
    exercise.tick(play(tick));
    exercise.fill(output);
    const Outgoing& outgoing = broadcast.read(output);
    ASSERT_EQ(outgoing.frames.size(), 1U);
    ASSERT_EQ(outgoing.frames[0].states.size(), loaded.scene->objects.size());
    ASSERT_EQ(outgoing.manifolds.size(), 3U);
  }
}

}  // namespace
}  // namespace tenon
