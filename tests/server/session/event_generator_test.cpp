#include "server/session/event_generator.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/session/step_blocker.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

using test::kInstructorHand;
using test::kRightHand;
using test::playInput;
using test::SessionRig;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr std::uint32_t kEpoch = 77;

/// All events that were generated.
struct GeneratedEvents {
  std::vector<EventLog> events;
  std::vector<StepState> steps;
  std::vector<RunState> runs;
  std::vector<GrabState> grabs;
  std::vector<ObjectSnapshot> snapshots;

  void add(const TickEvents& tick) {
    events.insert(events.end(), tick.log.begin(), tick.log.end());
    if (tick.step) steps.push_back(*tick.step);
    if (tick.run) runs.push_back(*tick.run);
    grabs.insert(grabs.end(), tick.grabs.begin(), tick.grabs.end());
    snapshots.insert(snapshots.end(), tick.snapshots.begin(), tick.snapshots.end());
  }
  [[nodiscard]] std::vector<std::string> texts(const std::string& kind) const {
    std::vector<std::string> all;
    for (const EventLog& event : events)
      if (event.kind == kind) all.push_back(event.text);
    return all;
  }
};

GeneratedEvents eventsOfThePlay() {
  const LoadedScene loaded = test::smallSession();
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded, 1, {test::kRightHand});
  EventGenerator generator(loaded.scenario, kEpoch);
  TickOutput output = simulation.makeOutput();
  GeneratedEvents generated;
  for (Tick tick = 1; tick <= test::kPlayTicks; ++tick) {
    simulation.tick(test::playInput(tick));
    simulation.fill(output);
    generated.add(generator.generate(output));
  }
  EXPECT_EQ(simulation.phase(), RunPhase::kSucceeded);
  return generated;
}

TEST(EventGenerator, ReportsEachChangeOnce) {
  const GeneratedEvents generated = eventsOfThePlay();
  EXPECT_THAT(generated.texts("step"), ElementsAre("take", "mount"));
  EXPECT_THAT(generated.texts("step done"), ElementsAre(HasSubstr("take (0."), HasSubstr("mount (")));
  EXPECT_THAT(generated.texts("mounted"), ElementsAre("part"));
  EXPECT_THAT(generated.texts("run"), ElementsAre("running", "everything is mounted"));
  EXPECT_THAT(generated.texts("taken"), ElementsAre("part (right hand)", "pointer (right hand)"));
  EXPECT_THAT(generated.texts("let go"), UnorderedElementsAre("pointer (right hand)", "part (right hand)"));

  std::vector<std::uint32_t> revisions;
  for (const StepState& step : generated.steps) revisions.push_back(step.revision);
  EXPECT_TRUE(std::adjacent_find(revisions.begin(), revisions.end()) == revisions.end());
  EXPECT_EQ(generated.steps.back().phase, StepPhase::kDone);
  ASSERT_EQ(generated.runs.size(), 2U);
  EXPECT_EQ(generated.runs[0].final_hash, 0U);
  EXPECT_NE(generated.runs[1].final_hash, 0U);
  for (std::size_t i = 0; i < generated.events.size(); ++i)
    EXPECT_EQ(generated.events[i].seq, i + 1) << "no gap";
}

TEST(EventGenerator, WhatASkipPutsInPlaceIsNotMounted) {
  test::SessionRig rig;
  EventGenerator generator(rig.loaded().scenario, kEpoch);
  GeneratedEvents generated;
  generated.add(generator.generate(rig.tick()));
  for (int tick = 0; tick < 6; ++tick) {
    rig.change({.kind = ChangeKind::kGameCommand, .game = {.kind = CommandKind::kSkipStep}});
    generated.add(generator.generate(rig.tick()));
  }
  EXPECT_THAT(generated.texts("step skipped"), ElementsAre(HasSubstr("take"), HasSubstr("mount")));
  EXPECT_THAT(generated.texts("put in place"), ElementsAre("part"));
  EXPECT_THAT(generated.texts("mounted"), IsEmpty());
}

TEST(EventGenerator, EveryGrabHasThePoseOfTheObjectInTheHand) {
  const GeneratedEvents generated = eventsOfThePlay();
  std::vector<ObjectId> first;
  for (const GrabState& grab : generated.grabs)
    if (grab.tick == 1) first.push_back(grab.object);
  EXPECT_THAT(first, UnorderedElementsAre(ObjectId{2}, ObjectId{3}, ObjectId{4}))
      << "objects held from the first tick on are included";
  const auto part = std::find_if(generated.grabs.begin(), generated.grabs.end(), [](const GrabState& grab) {
    return grab.object == ObjectId{1} && grab.hand == test::kRightHand;
  });
  ASSERT_NE(part, generated.grabs.end());
  EXPECT_NEAR(part->X_HO.translation().z(), -0.029, 1e-3);
}

//     ___
//    |   |  the part, 8 mm beside the socket, is pressed on its upper side: 40 mm above its place and 8 mm
//    beside it
//   _|___|___
//    |    |
TEST(EventGenerator, AStepThatTimesOutSaysWhatHoldsItsObjectAndWhere) {
  test::SessionRig rig;
  EventGenerator generator(rig.loaded().scenario, kEpoch);
  GeneratedEvents generated;
  Vector3 p_WH(0.2, 0, 0.2);
  const auto moveTo = [&](const Vector3& to, int ticks) {
    const Vector3 from = p_WH;
    for (int tick = 1; tick <= ticks; ++tick) {
      p_WH = from + (to - from) * (static_cast<double>(tick) / ticks);
      rig.move(kRightHand, p_WH);
      generated.add(generator.generate(rig.tick()));
    }
  };
  rig.attach(kRightHand, p_WH);
  moveTo({0.2, 0, 0.129}, 240);
  moveTo({0.2, 0, 0.129}, 460);  // it is taken
  moveTo({0.2, 0, 0.18}, 200);
  moveTo({0.008, 0, 0.08}, 700);
  moveTo({0.008, 0, 0.035}, 300);  // 14 mm deeper than it can go
  moveTo({0.008, 0, 0.035}, 1500);
  ASSERT_EQ(generated.runs.back().phase, RunPhase::kFailed);
  const std::string& reason = generated.runs.back().reason;
  EXPECT_EQ(generator.runReason(), reason);
  double distance = 0.0, x = 0.0, y = 0.0, z = 0.0;
  ASSERT_EQ(std::sscanf(reason.c_str(),
                        "step 'mount' was not done in time: part is held %lf mm from its place by bay, at "
                        "(%lf, %lf, %lf) mm",
                        &distance, &x, &y, &z),
            4)
      << reason;
  EXPECT_NEAR(distance, std::hypot(40.0, 8.0), 0.5);
  EXPECT_NEAR(z, 0.0, 0.5);
  EXPECT_THAT(generated.texts("not in time"), ElementsAre(HasSubstr("part is held ")));
}

TEST(EventGenerator, AStepThatTimesOutWithoutATouchSaysSo) {
  test::SessionRig rig;
  EventGenerator generator(rig.loaded().scenario, kEpoch);
  TickOutput output = rig.tick();
  output.step.step = 1;
  output.step.position_error = 0.1;
  output.step.angle_error = 0.2;
  // also when it lies on something
  output.pairs.push_back({0, {.a = ObjectId{1}, .b = ObjectId{0}, .colliding = true}});
  EXPECT_EQ(whatBlocks(*rig.loaded().scenario, output),
            "part is 100 mm and turned by 11.5 deg from its place, in no hand");
  output.pairs.clear();
  output.objects[1].holder = kRightHand;
  EXPECT_EQ(whatBlocks(*rig.loaded().scenario, output),
            "part is 100 mm and turned by 11.5 deg from its place, and touches nothing");
  output.step.position_error = 0.001;
  EXPECT_EQ(whatBlocks(*rig.loaded().scenario, output),
            "part is turned by 11.5 deg from its place, and touches nothing");
  output.step.step = 0;
  EXPECT_EQ(whatBlocks(*rig.loaded().scenario, output), "part was not touched");
}

TEST(EventGenerator, AConditionOfAGroupThatIsMetBlocksNothing) {
  const std::string conditions =
      "    show: [part]\n    conditions:\n      - any:\n          - {signal: bell}\n          - {signal: "
      "whistle}\n"
      "      - {signal: horn}\n";
  test::SessionRig rig(1, {},
                       test::with(test::smallScenario(), "    touch: part\n    for: 0.1 s\n", conditions));
  TickOutput output = rig.tick();
  enum : std::size_t { kRoot, kAny, kBell, kWhistle, kHorn, kNodes };
  ASSERT_EQ(output.step.conditions.size(), std::size_t{kNodes});
  EXPECT_EQ(whatBlocks(*rig.loaded().scenario, output), "not met: signal bell");
  output.step.conditions[kWhistle].met = output.step.conditions[kAny].met = true;
  EXPECT_EQ(whatBlocks(*rig.loaded().scenario, output), "not met: signal horn");
}

TEST(EventGenerator, EveryObjectHasASnapshotWithinASecond) {
  test::SessionRig rig;
  EventGenerator generator(rig.loaded().scenario, kEpoch);
  EXPECT_EQ(generator.generate(rig.tick(3)).snapshots.size(), 5U) << "all objects in the first tick";
  std::multiset<std::uint32_t> sampled;
  for (int tick = 0; tick < 1000; ++tick)
    for (const ObjectSnapshot& snapshot : generator.generate(rig.tick()).snapshots)
      sampled.insert(snapshot.state.object.value);
  EXPECT_EQ(sampled, (std::multiset<std::uint32_t>{0, 1, 2, 3, 4}));
}

TEST(EventGenerator, AFrozenAndAnAbsentHandAreReportedOnceEach) {
  test::SessionRig rig;
  EventGenerator generator(rig.loaded().scenario, kEpoch);
  GeneratedEvents generated;
  const auto run = [&](int ticks) {
    for (int tick = 0; tick < ticks; ++tick) generated.add(generator.generate(rig.tick()));
  };
  rig.attach(test::kRightHand, Vector3(0.2, 0, 0.3));
  run(10);
  rig.loseLink(test::kRightHand);
  run(100);
  rig.reading(test::kRightHand).X_WH = Pose(Vector3(0.2, 0, 0.3));
  run(10);
  rig.loseLink(test::kRightHand);
  run(2000);
  EXPECT_THAT(generated.texts("hand frozen"), ElementsAre(HasSubstr("51 ms"), HasSubstr("'right'")));
  EXPECT_THAT(generated.texts("hand free"), ElementsAre(HasSubstr("'right'")));
  EXPECT_THAT(generated.texts("hand gone"), ElementsAre(HasSubstr("'right'")));
}

TEST(EventGenerator, AnEmergencyStopIsLoggedAsErrorAndItsEndIsLogged) {
  test::SessionRig rig;
  EventGenerator generator(rig.loaded().scenario, kEpoch);
  GeneratedEvents generated;
  generated.add(generator.generate(rig.tick()));
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 1.0});
  for (int i = 0; i < 5; ++i) generated.add(generator.generate(rig.tick()));
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 0.0});
  for (int i = 0; i < 5; ++i) generated.add(generator.generate(rig.tick()));
  EXPECT_THAT(generated.texts("run"), ElementsAre("running", "emergency stop", "running"));
  EXPECT_EQ(generated.runs[1].server_epoch, kEpoch);
  EXPECT_TRUE(generated.runs[1].emergency_stop);
  EXPECT_EQ(generated.runs[1].open_commands & bitOf(CommandKind::kSkipStep), 0U);
  EXPECT_FALSE(generated.runs[2].emergency_stop);
  EXPECT_NE(generated.runs[2].open_commands & bitOf(CommandKind::kSkipStep), 0U);
  const auto stop = std::find_if(generated.events.begin(), generated.events.end(),
                                 [](const EventLog& event) { return event.text == "emergency stop"; });
  EXPECT_EQ(stop->severity, Severity::kError);
}

TEST(EventGenerator, APauseWithinAnEmergencyStopIsNotASecondStop) {
  test::SessionRig rig;
  EventGenerator generator(rig.loaded().scenario, kEpoch);
  GeneratedEvents generated;
  generated.add(generator.generate(rig.tick()));
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 1.0});
  generated.add(generator.generate(rig.tick()));
  rig.change({.kind = ChangeKind::kPause});
  generated.add(generator.generate(rig.tick()));
  EXPECT_EQ(generated.runs.back().phase, RunPhase::kPaused);
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 0.0});
  generated.add(generator.generate(rig.tick()));
  EXPECT_THAT(generated.texts("run"), ElementsAre("running", "emergency stop", "paused"));
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
  static std::size_t countDistinct(const std::vector<std::uint32_t>& list) {
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
  EXPECT_EQ(countDistinct(listed), 30U);
}

TEST_F(FramePackerTest, MovedObjectsComeFirstAndOthersRoundRobin) {
  (void)next(0);
  for (const std::uint32_t movers : {1U, 5U, 11U, 12U, 13U, 24U, 29U}) {
    std::set<std::uint32_t> refreshed;
    for (int tick = 0; tick < 30; ++tick) {
      const auto listed = next(movers);
      ASSERT_EQ(countDistinct(listed), listed.size()) << "none twice in a tick";
      for (std::uint32_t i = 0; i < movers; ++i) ASSERT_EQ(listed[i], i);
      refreshed.insert(listed.begin() + movers, listed.end());
    }
    EXPECT_EQ(refreshed.size(), 30 - movers) << "every object at rest is refreshed, with movers: " << movers;
  }
}

TEST_F(FramePackerTest, ASceneAtRestIsOneStatePerTick) {
  (void)next(0);
  std::set<std::uint32_t> refreshed;
  for (int tick = 0; tick < 30; ++tick) {
    const auto listed = next(0);
    ASSERT_EQ(listed.size(), 1U);
    refreshed.insert(listed[0]);
  }
  EXPECT_EQ(refreshed.size(), 30U);
}

TEST_F(FramePackerTest, ANewEpochCountsAsMovedEvenAtTheSamePose) {
  (void)next(0);
  ++output_.objects[17].epoch;
  EXPECT_EQ(next(0).front(), 17U);
}

//   its pose is that of the frame before, which said that it moves
TEST_F(FramePackerTest, AnObjectThatStopsIsToldToStand) {
  (void)next(0);
  output_.objects[17].X_WO.translation().z() = 1.0;
  output_.objects[17].V_WO[2] = 0.1F;
  EXPECT_EQ(next(0).front(), 17U);
  output_.objects[17].V_WO.setZero();
  EXPECT_EQ(next(0).front(), 17U);
  EXPECT_TRUE(frames_[0].states[0].V_WO.isZero(0.0F));
  EXPECT_EQ(next(0).size(), 1U) << "once";
}

TEST_F(FramePackerTest, AllPacksEveryObjectInEachTick) {
  for (int tick = 0; tick < 3; ++tick) EXPECT_EQ(countDistinct(next(2, true)), 30U);
}

}  // namespace
}  // namespace tenon::session
