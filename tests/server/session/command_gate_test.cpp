#include "server/session/command_gate.h"

#include <functional>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::session {
namespace {

Refusal refusalOf(const CommandGate& gate, CommandKind kind) {
  const auto possible = gate.check(kind);
  return possible ? Refusal::kNone : possible.error().why;
}

CommandGate gateIn(RunPhase phase) {
  CommandGate gate;
  gate.update(phase);
  return gate;
}

TEST(CommandGateTest, ACommandIsPossibleByThePhaseOfTheRun) {
  struct Row {
    CommandKind kind;
    Refusal waiting, running, paused, stopped;
  };
  using enum Refusal;
  const std::vector<Row> rows{
      {CommandKind::kFulfilled, kWaiting, kNone, kNone, kOver},
      {CommandKind::kSkipStep, kWaiting, kNone, kNone, kOver},
      {CommandKind::kPause, kWaiting, kNone, kAlready, kOver},
      {CommandKind::kResume, kWaiting, kAlready, kNone, kOver},
      {CommandKind::kRelease, kWaiting, kNone, kNone, kOver},
      {CommandKind::kSetCollision, kNone, kNone, kNone, kOver},
      {CommandKind::kFreezeForces, kWaiting, kNone, kNone, kOver},
      {CommandKind::kClearEmergencyStop, kNone, kNone, kNone, kOver},
      {CommandKind::kStop, kNone, kNone, kNone, kOver},
  };
  for (const Row& row : rows) {
    SCOPED_TRACE(static_cast<int>(row.kind));
    EXPECT_EQ(refusalOf(CommandGate(), row.kind), row.waiting) << "before the first tick";
    EXPECT_EQ(refusalOf(gateIn(RunPhase::kWaitingForPeople), row.kind), row.waiting);
    EXPECT_EQ(refusalOf(gateIn(RunPhase::kRunning), row.kind), row.running);
    EXPECT_EQ(refusalOf(gateIn(RunPhase::kPaused), row.kind), row.paused);
    for (const RunPhase over : {RunPhase::kSucceeded, RunPhase::kFailed, RunPhase::kStopped})
      EXPECT_EQ(refusalOf(gateIn(over), row.kind), row.stopped);
  }
}

TEST(CommandGateTest, ACommandIsJudgedByThoseThatWereAcceptedBeforeIt) {
  CommandGate gate = gateIn(RunPhase::kRunning);
  gate.accept(ChangeKind::kPause);
  EXPECT_EQ(refusalOf(gate, CommandKind::kPause), Refusal::kAlready);
  EXPECT_EQ(refusalOf(gate, CommandKind::kResume), Refusal::kNone);
  EXPECT_EQ(gate.phase(), RunPhase::kRunning) << "no tick has applied it yet";
  gate.update(RunPhase::kRunning);
  EXPECT_EQ(refusalOf(gate, CommandKind::kPause), Refusal::kAlready) << "of a tick before it";
  gate.update(RunPhase::kPaused);
  gate.accept(ChangeKind::kResume);
  EXPECT_EQ(refusalOf(gate, CommandKind::kResume), Refusal::kAlready);
  gate.update(RunPhase::kSucceeded);
  EXPECT_EQ(refusalOf(gate, CommandKind::kPause), Refusal::kOver);
}

TEST(CommandGateTest, AClearedStopLeavesARunPausedAndOneThatWaitsWaiting) {
  struct Row {
    RunPhase phase;
    Refusal resume;
  };
  for (const Row& row : {Row{RunPhase::kRunning, Refusal::kNone}, Row{RunPhase::kPaused, Refusal::kNone},
                         Row{RunPhase::kWaitingForPeople, Refusal::kWaiting}}) {
    CommandGate gate = gateIn(row.phase);
    EXPECT_FALSE(gate.isStopEngaged());
    gate.engageStop();
    EXPECT_TRUE(gate.isStopEngaged());
    gate.clearStop();
    EXPECT_FALSE(gate.isStopEngaged());
    EXPECT_EQ(refusalOf(gate, CommandKind::kResume), row.resume) << static_cast<int>(row.phase);
  }
}

TEST(CommandGateTest, DuringAnEmergencyStopWhatChangesTheSceneIsRefused) {
  for (const RunPhase phase : {RunPhase::kRunning, RunPhase::kPaused}) {
    CommandGate gate = gateIn(phase);
    gate.engageStop();
    for (const CommandKind kind :
         {CommandKind::kReset, CommandKind::kSkipStep, CommandKind::kGoToStep, CommandKind::kBack,
          CommandKind::kRepeatStep, CommandKind::kHandOver, CommandKind::kSwapHands, CommandKind::kFulfilled,
          CommandKind::kSignal, CommandKind::kResume}) {
      const auto possible = gate.check(kind);
      ASSERT_FALSE(possible) << static_cast<int>(kind);
      EXPECT_EQ(possible.error().why, Refusal::kStopped);
      EXPECT_EQ(possible.error().what, "the emergency stop stands: clear it first");
    }
    for (const CommandKind kind : {CommandKind::kClearEmergencyStop, CommandKind::kFreezeForces,
                                   CommandKind::kRelease, CommandKind::kSetCollision, CommandKind::kStop})
      EXPECT_EQ(refusalOf(gate, kind), Refusal::kNone) << static_cast<int>(kind);
    gate.clearStop();
    EXPECT_EQ(refusalOf(gate, CommandKind::kGoToStep), Refusal::kNone) << "the run is paused";
    EXPECT_EQ(refusalOf(gate, CommandKind::kResume), Refusal::kNone) << "likewise";
  }
}

TEST(CommandGateTest, TheCommandsThatAreSaidToBeOpenAreThoseThatItTakes) {
  for (const RunPhase phase : {RunPhase::kWaitingForPeople, RunPhase::kRunning, RunPhase::kPaused,
                               RunPhase::kSucceeded, RunPhase::kFailed, RunPhase::kStopped})
    for (const bool is_stopped : {false, true}) {
      CommandGate gate = gateIn(phase);
      if (is_stopped) gate.engageStop();
      for (const CommandKind kind : kCommandKinds)
        EXPECT_EQ((openCommands(phase, is_stopped) & bitOf(kind)) != 0, gate.check(kind).has_value())
            << static_cast<int>(phase) << ", " << is_stopped << ", " << static_cast<int>(kind);
    }
  EXPECT_EQ(openCommands(RunPhase::kFailed, false), bitOf(CommandKind::kNote) | bitOf(CommandKind::kKick));
}

TEST(CommandGateTest, AnEndStaysRequested) {
  CommandGate gate = gateIn(RunPhase::kRunning);
  EXPECT_FALSE(gate.endRequested());
  gate.accept(ChangeKind::kStop);
  gate.accept(ChangeKind::kPause);
  EXPECT_TRUE(gate.endRequested());
}

}  // namespace
}  // namespace tenon::session
