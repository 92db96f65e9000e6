#include "server/session/chronicle.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/small_session.h"

namespace tenon {
namespace {

using test::kRightHand;
using test::kTeacherHand;
using test::play;
using test::Stage;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

constexpr std::uint32_t kEpoch = 77;

/// All that a chronicle said in the play.
struct Told {
  std::vector<EventLog> events;
  std::vector<StepState> steps;
  std::vector<RunState> runs;
  std::vector<GrabState> grabs;
  std::vector<ObjectSnapshot> snapshots;

  void add(const News& news) {
    events.insert(events.end(), news.events.begin(), news.events.end());
    if (news.step) steps.push_back(*news.step);
    if (news.run) runs.push_back(*news.run);
    grabs.insert(grabs.end(), news.grabs.begin(), news.grabs.end());
    snapshots.insert(snapshots.end(), news.snapshots.begin(), news.snapshots.end());
  }
  [[nodiscard]] std::vector<std::string> texts(const std::string& kind) const {
    std::vector<std::string> all;
    for (const EventLog& event : events)
      if (event.kind == kind) all.push_back(event.text);
    return all;
  }
};

Told toldOfThePlay() {
  const LoadedScene loaded = test::smallSession();
  Exercise exercise = Stage::makeExercise(loaded, 1, {kRightHand});
  Chronicle chronicle(loaded.scenario, kEpoch);
  TickOutput output = exercise.makeOutput();
  Told told;
  for (Tick tick = 1; tick <= test::kPlayTicks; ++tick) {
    exercise.tick(play(tick));
    exercise.fill(output);
    told.add(chronicle.read(output));
  }
  EXPECT_EQ(exercise.phase(), RunPhase::kSucceeded);
  return told;
}

TEST(Chronicle, TellsEachChangeOfAnExerciseOnce) {
  const Told told = toldOfThePlay();
  EXPECT_THAT(told.texts("step"), ElementsAre("take", "mount"));
  EXPECT_THAT(told.texts("step done"), ElementsAre(HasSubstr("take (0.")));
  EXPECT_THAT(told.texts("mounted"), ElementsAre("part"));
  EXPECT_THAT(told.texts("run"), ElementsAre("running", "everything is mounted"));
  EXPECT_THAT(told.texts("taken"), ElementsAre("part (right hand)", "pointer (right hand)"));
  EXPECT_THAT(told.texts("let go"), UnorderedElementsAre("pointer (right hand)", "part (right hand)"));

  std::vector<std::uint32_t> revisions;
  for (const StepState& step : told.steps) revisions.push_back(step.revision);
  EXPECT_TRUE(std::adjacent_find(revisions.begin(), revisions.end()) == revisions.end());
  EXPECT_EQ(told.steps.back().phase, StepPhase::kDone);
  ASSERT_EQ(told.runs.size(), 2U);
  EXPECT_EQ(told.runs[0].final_hash, 0U);
  EXPECT_NE(told.runs[1].final_hash, 0U);
  for (std::size_t i = 0; i < told.events.size(); ++i) EXPECT_EQ(told.events[i].seq, i + 1) << "no gap";
}

TEST(Chronicle, EveryGrabSaysWhereTheObjectIsInTheHand) {
  const Told told = toldOfThePlay();
  std::vector<ObjectId> first;
  for (const GrabState& grab : told.grabs)
    if (grab.tick == 1) first.push_back(grab.object);
  EXPECT_THAT(first, UnorderedElementsAre(ObjectId{2}, ObjectId{3}, ObjectId{4}))
      << "what is held from the first tick on is told too";
  const auto part = std::find_if(told.grabs.begin(), told.grabs.end(), [](const GrabState& grab) {
    return grab.object == ObjectId{1} && grab.hand == kRightHand;
  });
  ASSERT_NE(part, told.grabs.end());
  EXPECT_NEAR(part->X_HO.translation().z(), -0.029, 1e-3);
}

TEST(Chronicle, SnapshotsReachEveryObjectWithinASecond) {
  Stage stage;
  Chronicle chronicle(stage.loaded().scenario, kEpoch);
  EXPECT_EQ(chronicle.read(stage.tick(3)).snapshots.size(), 5U) << "all of them, for the first tick";
  std::multiset<std::uint32_t> heard;
  for (int tick = 0; tick < 1000; ++tick)
    for (const ObjectSnapshot& snapshot : chronicle.read(stage.tick()).snapshots)
      heard.insert(snapshot.state.object.value);
  EXPECT_EQ(heard, (std::multiset<std::uint32_t>{0, 1, 2, 3, 4}));
}

TEST(Chronicle, AHandThatFreezesAndGoesIsToldOnceEach) {
  Stage stage;
  Chronicle chronicle(stage.loaded().scenario, kEpoch);
  Told told;
  const auto go = [&](int ticks) {
    for (int tick = 0; tick < ticks; ++tick) told.add(chronicle.read(stage.tick()));
  };
  stage.attach(kRightHand, Vector3(0.2, 0, 0.3));
  go(10);
  stage.silence(kRightHand);
  go(100);
  stage.reading(kRightHand).X_WH = Pose(Vector3(0.2, 0, 0.3));
  go(10);
  stage.silence(kRightHand);
  go(2000);
  EXPECT_THAT(told.texts("hand frozen"), ElementsAre(HasSubstr("51 ms"), HasSubstr("'right'")));
  EXPECT_THAT(told.texts("hand free"), ElementsAre(HasSubstr("'right'")));
  EXPECT_THAT(told.texts("hand gone"), ElementsAre(HasSubstr("'right'")));
}

TEST(Chronicle, AnEmergencyStopIsAnErrorAndItsEndIsTold) {
  Stage stage;
  Chronicle chronicle(stage.loaded().scenario, kEpoch);
  Told told;
  told.add(chronicle.read(stage.tick()));
  stage.change({.kind = ChangeKind::kHalt, .value = 1.0});
  for (int i = 0; i < 5; ++i) told.add(chronicle.read(stage.tick()));
  stage.change({.kind = ChangeKind::kHalt, .value = 0.0});
  for (int i = 0; i < 5; ++i) told.add(chronicle.read(stage.tick()));
  EXPECT_THAT(told.texts("run"), ElementsAre("running", "emergency stop", "running"));
  EXPECT_EQ(told.runs[1].server_epoch, kEpoch);
  const auto stop = std::find_if(told.events.begin(), told.events.end(),
                                 [](const EventLog& event) { return event.text == "emergency stop"; });
  EXPECT_EQ(stop->severity, Severity::kError);
}

class FramePackerTest : public ::testing::Test {
 protected:
  explicit FramePackerTest(std::uint32_t objects = 30) {
    output_.objects.resize(objects);
    for (std::uint32_t i = 0; i < objects; ++i)
      output_.objects[i] = {.object = ObjectId{i}, .epoch = 1, .X_WO = Pose(Vector3(i, 0, 0))};
  }
  /// The objects of the next tick, in order, after `movers` have moved.
  std::vector<std::uint32_t> next(std::uint32_t movers, bool all = false) {
    ++output_.tick;
    for (std::uint32_t i = 0; i < movers; ++i)
      output_.objects[i].X_WO.translation().z() = static_cast<double>(output_.tick);
    packer_.pack(output_, all, frames_);
    std::vector<std::uint32_t> listed;
    for (std::size_t part = 0; part < frames_.size(); ++part) {
      EXPECT_EQ(frames_[part].part, part);
      EXPECT_EQ(frames_[part].parts, frames_.size());
      EXPECT_EQ(frames_[part].tick, output_.tick);
      EXPECT_EQ(frames_[part].server_epoch, kEpoch);
      EXPECT_FALSE(frames_[part].states.empty());
      for (const ObjectState& state : frames_[part].states) listed.push_back(state.object.value);
    }
    return listed;
  }
  static std::size_t different(const std::vector<std::uint32_t>& list) {
    return std::set<std::uint32_t>(list.begin(), list.end()).size();
  }

  TickOutput output_;
  FramePacker packer_{kEpoch};
  std::vector<WorldFrame> frames_;
};

TEST_F(FramePackerTest, TheFirstTickListsEveryObjectOnce) {
  const auto listed = next(0);
  EXPECT_EQ(frames_.size(), 3U);
  EXPECT_EQ(listed.size(), 30U);
  EXPECT_EQ(different(listed), 30U);
}

TEST_F(FramePackerTest, WhatMovedComesFirstAndTheRestInTurn) {
  (void)next(0);
  for (const std::uint32_t movers : {1U, 5U, 11U, 12U, 13U, 24U, 29U}) {
    std::set<std::uint32_t> refreshed;
    for (int tick = 0; tick < 30; ++tick) {
      const auto listed = next(movers);
      ASSERT_EQ(different(listed), listed.size()) << "none twice in a tick";
      for (std::uint32_t i = 0; i < movers; ++i) ASSERT_EQ(listed[i], i);
      refreshed.insert(listed.begin() + movers, listed.end());
    }
    EXPECT_EQ(refreshed.size(), 30 - movers) << "everybody has everything after a while, with " << movers;
  }
}

TEST_F(FramePackerTest, AQuietSceneIsOneStateATick) {
  (void)next(0);
  std::set<std::uint32_t> refreshed;
  for (int tick = 0; tick < 30; ++tick) {
    const auto listed = next(0);
    ASSERT_EQ(listed.size(), 1U);
    refreshed.insert(listed[0]);
  }
  EXPECT_EQ(refreshed.size(), 30U);
}

TEST_F(FramePackerTest, ADeclaredJumpIsAMoveEvenToTheSamePlace) {
  (void)next(0);
  ++output_.objects[17].epoch;
  EXPECT_EQ(next(0).front(), 17U);
}

TEST_F(FramePackerTest, AllMeansAll) {
  for (int tick = 0; tick < 3; ++tick) EXPECT_EQ(different(next(2, true)), 30U);
}

}  // namespace
}  // namespace tenon
