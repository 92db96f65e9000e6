#include "server/session/publisher.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

using test::playInput;
using test::SessionRig;

constexpr std::uint32_t kPublisherEpoch = 77;

TEST(Publisher, EachRateTierHasItsPeriod) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, Vector3(0.2, 0, 0.3));
  Publisher publisher(rig.loaded().scenario, kPublisherEpoch, false);
  std::map<std::string, int> sent;
  for (int tick = 0; tick < 990; ++tick) {
    const OutgoingMessages& outgoing = publisher.prepare(rig.tick());
    sent["1k"] += !outgoing.frames.empty();
    sent["100"] += !outgoing.frames_100.empty();
    sent["30"] += !outgoing.frames_30.empty();
    sent["stats"] += outgoing.stats.has_value();
    sent["progress"] += outgoing.progress.has_value();
    if (outgoing.progress) {
      EXPECT_EQ(outgoing.progress->tick, outgoing.frames_30[0].tick);
    }
    sent["manifolds"] += static_cast<int>(outgoing.manifolds.size());
    sent["manifolds 50"] += static_cast<int>(outgoing.manifolds_50.size());
    if (!outgoing.manifolds_50.empty()) {
      EXPECT_EQ(outgoing.manifolds_50[0]->tick, outgoing.frames_100[0].tick) << "a copy compares both";
      EXPECT_EQ(outgoing.manifolds_50[0]->hand, test::kRightHand);
    }
  }
  EXPECT_EQ(sent, (std::map<std::string, int>{{"1k", 990},
                                              {"100", 99},

                                              {"30", 30},
                                              {"stats", 99},
                                              {"progress", 30},
                                              {"manifolds", 990},
                                              {"manifolds 50", 49}}));
}

/// What is sent slowly of a neighbour's goal, by tick: it goes along x by `x` [m] of a time [s], its velocity
/// told by each.
std::vector<Tick> toldOfNeighbour(const std::function<double(double)>& x, Tick ticks) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, Vector3(0.2, 0, 0.3));
  Publisher publisher(rig.loaded().scenario, kPublisherEpoch, false);
  TickOutput output = rig.tick();
  const Tick begin = 1000;
  std::vector<Tick> told;
  for (Tick tick = 0; tick < ticks; ++tick) {
    output.tick = begin + tick;
    HandManifold& manifold = output.manifolds[test::kRightHand.value];
    manifold.tick = output.tick;
    const double now = static_cast<double>(tick) * kTickSeconds;
    HandPull pull{.hand = test::kLeftHand, .object = ObjectId{99}};
    pull.X_WG = Pose(Vector3(x(now), 0.0, 0.0));
    pull.V_WG[0] = static_cast<float>((x(now) - x(now - kTickSeconds)) / kTickSeconds);
    manifold.others.clear();
    manifold.others.push_back(pull);
    if (!publisher.prepare(output).manifolds_50.empty()) told.push_back(tick);
  }
  return told;
}

TEST(Publisher, ANeighbourThatMovesSteadilyIsToldFiftyTimesASecond) {
  EXPECT_EQ(toldOfNeighbour([](double t) { return 0.2 * t; }, 200).size(), 10U);
  EXPECT_EQ(toldOfNeighbour([](double) { return 0.0; }, 200).size(), 10U);
}

TEST(Publisher, ANeighbourThatTurnsIsToldAtOnce) {
  const auto told = toldOfNeighbour([](double t) { return t < 0.105 ? 0.2 * t : 0.2 * (0.21 - t); }, 200);
  EXPECT_NE(std::find(told.begin(), told.end(), Tick{106}), told.end()) << "it turned after tick 105";
  EXPECT_EQ(told.size(), 11U) << "once: from then on it moves as told";
}

TEST(Publisher, ANeighbourThatTurnsAllTheTimeIsToldEightyTimesASecond) {
  const auto told = toldOfNeighbour([](double t) { return 1e-3 * std::sin(200.0 * t); }, 10'000);
  EXPECT_GT(told.size(), 700U);
  EXPECT_LE(told.size(), 500U + 300U + 30U);
}

TEST(Publisher, WhatMovedInATickThatIsNotSentIsInTheNextFrame) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, Vector3(0.2, 0, 0.3));
  Publisher publisher(rig.loaded().scenario, kPublisherEpoch, false);
  TickOutput output = rig.tick(10);
  for (int tick = 0; tick < 10; ++tick) (void)publisher.prepare(output);
  for (ObjectState& moved : output.objects) {
    moved.X_WO.translation().x() += 0.01;
    const OutgoingMessages& unsent = publisher.prepare(output, /*is_newest=*/false);
    EXPECT_TRUE(unsent.frames.empty());
    EXPECT_TRUE(unsent.manifolds.empty());
    const OutgoingMessages& sent = publisher.prepare(output);
    ASSERT_EQ(sent.frames.size(), 1U);
    EXPECT_EQ(sent.frames[0].states[0].object, moved.object);
    EXPECT_EQ(sent.manifolds.size(), 1U);
  }
}

TEST(Publisher, SetsHandAndServerEpochOfEachManifold) {
  test::SessionRig rig;
  rig.attach(test::kInstructorHand, Vector3(-0.3, 0, 0.3));
  Publisher publisher(rig.loaded().scenario, kPublisherEpoch, false);
  const OutgoingMessages& outgoing = publisher.prepare(rig.tick(3));
  ASSERT_EQ(outgoing.manifolds.size(), 1U) << "only of hands that are present";
  EXPECT_EQ(outgoing.manifolds[0]->hand, test::kInstructorHand);
  EXPECT_EQ(outgoing.manifolds[0]->server_epoch, kPublisherEpoch);
  EXPECT_EQ(outgoing.manifolds[0]->answers_seq, 3U);
  EXPECT_EQ(outgoing.manifolds[0]->tick, 3U);
}

//      ^ force       a peak between two samples of a
//      |   /\        slower tier must be in the next
//   ---+--'--`---+--> ticks
//      s         s
TEST(Publisher, ASlowerTierCarriesThePeaksSinceItsLastSample) {
  test::SessionRig rig;
  Publisher publisher(rig.loaded().scenario, kPublisherEpoch, false);
  (void)publisher.prepare(rig.tick(10));
  for (int tick = 11; tick <= 30; ++tick) {
    TickOutput output = rig.tick();
    const bool peak = tick == 14;
    PairState pair{2, {}};
    pair.contact.colliding = peak;
    pair.contact.peak_force = peak ? 9.0 : 0.5;
    pair.contact.peak_depth = peak ? 0.002 : 0.0;
    if (tick <= 16) output.pairs.push_back(pair);
    output.round_robin_pairs.clear();
    output.stats.load_percent = peak ? 80.0 : 1.0;
    output.stats.compute_seconds = peak ? 0.0007 : 0.0001;
    output.stats.input_age_seconds = peak ? 0.020 : 0.001;
    const OutgoingMessages& outgoing = publisher.prepare(output);
    if (tick == 20) {
      ASSERT_EQ(outgoing.pairs.size(), 1U);
      ASSERT_EQ(outgoing.pairs[0].pairs.size(), 1U) << "a pair that touched since the last sample";
      EXPECT_FALSE(outgoing.pairs[0].pairs[0].colliding);
      EXPECT_EQ(outgoing.pairs[0].pairs[0].peak_force, 9.0);
      EXPECT_EQ(outgoing.pairs[0].pairs[0].peak_depth, 0.002);
      EXPECT_EQ(outgoing.stats->load_percent, 80.0);
      EXPECT_EQ(outgoing.stats->compute_seconds, 0.0001);
      EXPECT_EQ(outgoing.stats->compute_seconds_max, 0.0007);
      EXPECT_EQ(outgoing.stats->input_age_seconds, 0.020);
      EXPECT_EQ(outgoing.stats->server_epoch, kPublisherEpoch);
    } else if (tick == 30) {
      EXPECT_TRUE(outgoing.pairs.empty());
      EXPECT_EQ(outgoing.stats->load_percent, 1.0) << "each peak is published once";
      EXPECT_EQ(outgoing.stats->compute_seconds_max, 0.0001);
    } else {
      EXPECT_TRUE(outgoing.pairs.empty());
    }
  }
}

TEST(Publisher, EveryCollisionPairIsPublishedWithinASecond) {
  test::SessionRig rig;
  Publisher publisher(rig.loaded().scenario, kPublisherEpoch, false);
  std::set<std::pair<std::uint32_t, std::uint32_t>> published;
  for (int tick = 0; tick < 1000; ++tick) {
    const OutgoingMessages& outgoing = publisher.prepare(rig.tick());
    for (const ContactPairs& sample : outgoing.pairs)
      for (const PairContact& pair : sample.pairs) published.emplace(pair.a.value, pair.b.value);
  }
  EXPECT_EQ(published.size(), rig.loaded().scene->pairs.size());
}

TEST(Publisher, ManyPairsArePublishedInNumberedParts) {
  test::SessionRig rig;
  Publisher publisher(rig.loaded().scenario, kPublisherEpoch, false);
  TickOutput output = rig.tick(10);
  output.pairs.clear();
  for (std::uint32_t i = 0; i < 20; ++i) {
    output.pairs.push_back({i, {.a = ObjectId{i}, .b = ObjectId{50}, .colliding = true}});
  }
  const OutgoingMessages& outgoing = publisher.prepare(output);
  ASSERT_EQ(outgoing.pairs.size(), 4U);
  std::uint32_t next = 0;
  for (std::uint32_t part = 0; part < 4; ++part) {
    EXPECT_EQ(outgoing.pairs[part].part, part);
    EXPECT_EQ(outgoing.pairs[part].parts, 4U);
    for (const PairContact& pair : outgoing.pairs[part].pairs) EXPECT_EQ(pair.a.value, next++);
  }
  EXPECT_EQ(next, 20U);
}

TEST(Publisher, InLockstepEachTickCarriesAllObjectsAndManifolds) {
  const LoadedScene loaded = test::smallSession();
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded);
  TickOutput output = simulation.makeOutput();
  Publisher publisher(loaded.scenario, kPublisherEpoch, true);
  for (Tick tick = 1; tick <= 25; ++tick) {
    simulation.tick(test::playInput(tick));
    simulation.fill(output);
    const OutgoingMessages& outgoing = publisher.prepare(output);
    ASSERT_EQ(outgoing.frames.size(), 1U);
    ASSERT_EQ(outgoing.frames[0].states.size(), loaded.scene->objects.size());
    ASSERT_EQ(outgoing.manifolds.size(), 3U);
  }
}

}  // namespace
}  // namespace tenon::session
