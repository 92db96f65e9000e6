#include "clients/observer/timeline.h"

#include <gtest/gtest.h>

#include "tests/clients/observer/memory_file.h"

namespace tenon::observer {
namespace {

constexpr ObjectId kBox{0}, kPeg{1}, kPointer{2};
constexpr HandId kRight{0};

SceneObject sceneObject(ObjectId id, const std::string& title, const std::string& kind) {
  SceneObject object;
  object.object = id;
  object.title = title;
  object.kind = kind;
  return object;
}

StepState stepState(std::uint32_t index, StepPhase phase, Tick started) {
  StepState step;
  step.revision = 2 * index + (phase == StepPhase::kActive ? 1 : 2);
  step.step = index;
  step.steps = 2;
  step.phase = phase;
  step.started = started;
  step.name = index == 0 ? "take_peg" : "insert_peg";
  step.title = {{"en", index == 0 ? "Take the peg" : "Push the peg in"}};
  step.instruction = {{"en", index == 0 ? "Touch it." : "Push it straight down."}};
  step.object = kPeg;
  step.has_target = index == 1;
  return step;
}

EventLog event(Tick tick, const std::string& kind, const std::string& text) {
  EventLog log;
  log.tick = tick;
  log.kind = kind;
  log.text = text;
  return log;
}

RunState run(Tick tick, RunPhase phase, const std::string& reason) {
  RunState state;
  state.tick = tick;
  state.phase = phase;
  state.reason = reason;
  return state;
}

StepProgress progress(Tick tick, double position_error, double angle_error, double contact) {
  StepProgress state;
  state.revision = 3;  // of the second step, while it is active
  state.tick = tick;
  state.position_error = position_error;
  state.angle_error = angle_error;
  state.contact_seconds = contact;
  return state;
}

ContactPairs contact(Tick tick, ObjectId a, ObjectId b, bool colliding) {
  ContactPairs pairs;
  pairs.tick = tick;
  PairContact pair;
  pair.a = a;
  pair.b = b;
  pair.colliding = colliding;
  pairs.pairs.push_back(pair);
  return pairs;
}

class TimelineTest : public testing::Test {
 protected:
  TimelineTest() {
    timeline_.receive(sceneObject(kBox, "Box", "scene"));
    timeline_.receive(sceneObject(kPeg, "Peg", "part"));
    timeline_.receive(sceneObject(kPointer, "Your hand", "pointer"));
    timeline_.receive(Presence{ClientId{1}, "Anna", Role::kTrainee, {kRight}, true});
  }
  std::string printed() {
    timeline_.printAll();
    return output_.text();
  }

  MemoryFile output_;
  Timeline timeline_{output_.file(), "en"};
};

TEST_F(TimelineTest, TellsASessionInOrderOfTimeInWhateverOrderItsTopicsArrive) {
  // as a reader takes them, one topic after the other
  timeline_.receive(GrabState{kPeg, kRight, 1, {}, 5001});
  timeline_.receive(stepState(0, StepPhase::kActive, 0));
  timeline_.receive(stepState(0, StepPhase::kDone, 0));
  timeline_.receive(stepState(1, StepPhase::kActive, 5001));
  timeline_.receive(stepState(1, StepPhase::kDone, 5001));
  timeline_.receive(progress(5001, 0.2, 0.0, 0.0));
  timeline_.receive(progress(7100, 0.0592, 0.01, 0.0));
  timeline_.receive(progress(9050, 0.0008, 0.005, 4.0));
  timeline_.receive(contact(4000, kPointer, kPeg, true));
  timeline_.receive(contact(9000, kPeg, kBox, true));
  timeline_.receive(event(0, "join", "Anna (trainee) is here"));
  timeline_.receive(event(0, "run", "running"));
  timeline_.receive(event(0, "step", "take_peg"));
  timeline_.receive(event(5001, "step done", "take_peg (5.0 s)"));
  timeline_.receive(event(5001, "step", "insert_peg"));
  timeline_.receive(event(5001, "taken", "Peg (right hand)"));
  timeline_.receive(event(5001, "let go", "Your hand (right hand)"));
  timeline_.receive(event(14000, "leave", "Anna (trainee) is gone"));  // because the session is over
  timeline_.receive(event(14000, "run", "everything is mounted"));
  timeline_.receive(event(14000, "mounted", "Peg"));
  timeline_.receive(event(14000, "let go", "Peg (right hand)"));
  timeline_.receive(event(14000, "taken", "Your hand (right hand)"));
  timeline_.receive(run(1, RunPhase::kRunning, "running"));
  timeline_.receive(run(14000, RunPhase::kSucceeded, "everything is mounted"));
  EXPECT_EQ(printed(), R"(   0.00 s  Anna (trainee) is here
   0.00 s  the session is running
   0.00 s  step 1 of 2: Take the peg
   0.00 s    the trainee is told: Touch it.
   4.00 s    Your hand touches Peg
   5.00 s    Peg is taken by Anna (right hand)
   5.00 s  step 1 of 2: done after 5.0 s
   5.00 s  step 2 of 2: Push the peg in
   5.00 s    the trainee is told: Push it straight down.
   7.10 s    Peg is 59.2 mm and 0.6 degrees from its place
   9.00 s    Peg touches Box
  14.00 s    Peg is mounted, with an error of 0.8 mm and 0.3 degrees
  14.00 s  step 2 of 2: done after 9.0 s
  14.00 s  the session has succeeded
)");
}

TEST_F(TimelineTest, TellsAnEventOnceHoweverOftenItIsReceived) {
  for (int i = 0; i < 3; ++i) {
    timeline_.receive(stepState(0, StepPhase::kActive, 0));
    timeline_.receive(run(1, RunPhase::kRunning, "running"));
    timeline_.receive(contact(1000, kPointer, kPeg, true));
    timeline_.receive(contact(1010, kPeg, kPointer, true));
  }
  timeline_.receive(contact(1100, kPointer, kPeg, false));
  timeline_.receive(contact(1200, kPointer, kPeg, true));  // again in the same step
  EXPECT_EQ(printed(), R"(   0.00 s  the session is running
   0.00 s  step 1 of 2: Take the peg
   0.00 s    the trainee is told: Touch it.
   1.00 s    Your hand touches Peg
)");
}

TEST_F(TimelineTest, PrintsWhatWaitedAndAllThatHappenedBeforeIt) {
  timeline_.receive(event(2000, "hand frozen", "hand 'right' is held still"));
  const auto limit = Timeline::Clock::now() + std::chrono::nanoseconds(1);
  while (Timeline::Clock::now() <= limit) {
  }
  timeline_.receive(event(1000, "join", "Ben (observer) is here"));
  timeline_.receive(event(3000, "hand free", "hand 'right' moves again"));
  timeline_.printReceivedBefore(Timeline::Clock::time_point::min());
  EXPECT_EQ(output_.text(), "");
  timeline_.printReceivedBefore(limit);
  const std::string first =
      "   1.00 s  Ben (observer) is here\n"
      "   2.00 s  ! hand 'right' is held still: no movement arrives from the station in time\n";
  EXPECT_EQ(output_.text(), first);
  EXPECT_EQ(printed(), first + "   3.00 s  hand 'right' moves again\n");
}

// Five hands stall every 100 ms for 50 ms, as on a busy machine, and then for two seconds.
TEST_F(TimelineTest, TellsThatHandsStallOnceASecondAndOfAllTogether) {
  timeline_.receive(sceneObject(ObjectId{3}, "Trainee", "head"));
  const std::vector<std::string> hands{"'right'", "'left'", "'forearm'", "'head'", "'instructor'"};
  const auto tellOfAll = [&](Tick tick, const std::string& kind, const std::string& what) {
    for (const std::string& hand : hands) timeline_.receive(event(tick, kind, "hand " + hand + what));
  };
  for (Tick tick = 1000; tick < 3000; tick += 100) {
    tellOfAll(tick, "hand frozen", " is held still (last input 60 ms ago)");
    tellOfAll(tick + 50, "hand free", " moves again");
    timeline_.receive(event(tick + 50, "taken", "Trainee (head hand)"));
  }
  tellOfAll(3000, "hand frozen", " is held still (last input 60 ms ago)");
  tellOfAll(5000, "hand free", " moves again");
  tellOfAll(6000, "hand gone", " is absent: the object it held is parked");
  const std::string all = "hands 'right', 'left', 'forearm', 'head', 'instructor'";
  const std::string still = "  ! " + all + " are held still: no movement arrives from the station in time\n";
  EXPECT_EQ(printed(), "   1.00 s" + still + "   2.00 s" + still + "   3.00 s" + still + "   5.00 s  " + all +
                           " move again\n   6.00 s  ! " + all + " are absent: what they held is parked\n");
}

TEST_F(TimelineTest, TellsProgressEveryTwoSecondsFromTheBeginOfTheStep) {
  timeline_.receive(stepState(1, StepPhase::kActive, 5000));
  StepProgress of_another_step = progress(7000, 0.5, 0.0, 0.0);
  of_another_step.revision = 2;
  timeline_.receive(of_another_step);
  for (Tick tick = 5000; tick < 10000; tick += 100) timeline_.receive(progress(tick, 0.1, 0.0, 1.5));
  EXPECT_EQ(printed(), R"(   5.00 s  step 2 of 2: Push the peg in
   5.00 s    the trainee is told: Push it straight down.
   7.00 s    Peg is 100 mm and 0.0 degrees from its place, was in contact for 1.5 s
   9.00 s    Peg is 100 mm and 0.0 degrees from its place, was in contact for 1.5 s
)");
}

TEST_F(TimelineTest, TellsHowAStepEndedThatWasNotDone) {
  timeline_.receive(stepState(0, StepPhase::kActive, 0));
  timeline_.receive(stepState(0, StepPhase::kSkipped, 0));
  timeline_.receive(stepState(1, StepPhase::kActive, 3000));
  timeline_.receive(stepState(1, StepPhase::kTimedOut, 3000));
  timeline_.receive(run(10000, RunPhase::kFailed, "step 'insert_peg' was not done in time"));
  EXPECT_EQ(printed(), R"(   0.00 s  step 1 of 2: Take the peg
   0.00 s    the trainee is told: Touch it.
   3.00 s  step 1 of 2: skipped after 3.0 s
   3.00 s  step 2 of 2: Push the peg in
   3.00 s    the trainee is told: Push it straight down.
  10.00 s  step 2 of 2: not done in time: 7.0 s
  10.00 s  the session has failed
)");
}

TEST_F(TimelineTest, TheTimeOfAStepHasNoPausesAndNoStops) {
  timeline_.receive(stepState(0, StepPhase::kActive, 0));
  timeline_.receive(run(1, RunPhase::kRunning, "running"));
  timeline_.receive(run(1001, RunPhase::kPaused, "paused"));
  timeline_.receive(run(3001, RunPhase::kRunning, "running"));
  RunState stop = run(4001, RunPhase::kRunning, "emergency stop");
  stop.emergency_stop = true;
  timeline_.receive(stop);
  timeline_.receive(run(9001, RunPhase::kRunning, "running"));
  timeline_.receive(stepState(1, StepPhase::kActive, 10000));
  EXPECT_THAT(printed(), testing::HasSubstr("10.00 s  step 1 of 2: done after 3.0 s\n"));
}

TEST_F(TimelineTest, AStepOfASessionThatIsStoppedOrSetBackIsNotDone) {
  timeline_.receive(stepState(0, StepPhase::kActive, 0));
  timeline_.receive(stepState(1, StepPhase::kActive, 3000));
  timeline_.receive(stepState(0, StepPhase::kActive, 4000));
  timeline_.receive(run(5000, RunPhase::kStopped, "stopped"));
  EXPECT_EQ(printed(), R"(   0.00 s  step 1 of 2: Take the peg
   0.00 s    the trainee is told: Touch it.
   3.00 s  step 1 of 2: done after 3.0 s
   3.00 s  step 2 of 2: Push the peg in
   3.00 s    the trainee is told: Push it straight down.
   4.00 s  the session is set back to step 1
   4.00 s  step 1 of 2: Take the peg
   4.00 s    the trainee is told: Touch it.
   5.00 s  the session was stopped
)");
}

TEST_F(TimelineTest, AStepThatTheInstructorLeftIsNotDone) {
  timeline_.receive(stepState(0, StepPhase::kActive, 0));
  StepState gone_to = stepState(1, StepPhase::kActive, 3000);
  gone_to.revision = 2;  // without the end of the first
  timeline_.receive(gone_to);
  EXPECT_EQ(printed(), R"(   0.00 s  step 1 of 2: Take the peg
   0.00 s    the trainee is told: Touch it.
   3.00 s  step 1 of 2: left after 3.0 s
   3.00 s  step 2 of 2: Push the peg in
   3.00 s    the trainee is told: Push it straight down.
)");
}

TEST_F(TimelineTest, MarksWarningsAndErrorsAndSaysWhatTheyAreAbout) {
  EventLog warning = event(1000, "leave", "trainee (trainee) is gone");
  warning.severity = Severity::kWarning;
  EventLog stop = event(2000, "emergency stop", "engaged by Ben: a test");
  stop.severity = Severity::kError;
  timeline_.receive(stop);
  timeline_.receive(warning);
  EXPECT_EQ(printed(),
            "   1.00 s  ! trainee is gone\n   2.00 s  !! emergency stop: engaged by Ben: a test\n");
}

TEST_F(TimelineTest, APartThatIsLetGoUnmountedIsTold) {
  timeline_.receive(stepState(1, StepPhase::kActive, 0));
  timeline_.receive(GrabState{kPeg, kRight, 1, {}, 1000});
  timeline_.receive(event(1000, "taken", "Peg (right hand)"));
  timeline_.receive(event(2000, "let go", "Peg (right hand)"));
  EXPECT_EQ(printed(), R"(   0.00 s  step 2 of 2: Push the peg in
   0.00 s    the trainee is told: Push it straight down.
   1.00 s    Peg is taken by Anna (right hand)
   2.00 s    Peg is let go by Anna (right hand)
)");
}

}  // namespace
}  // namespace tenon::observer
