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

CommandGate gateIn(RunPhase phase, bool emergency_stop = false) {
  CommandGate gate;
  gate.update(phase, emergency_stop);
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
      {CommandKind::kRelease, kNone, kNone, kNone, kOver},
      {CommandKind::kSetCollision, kNone, kNone, kNone, kOver},
      {CommandKind::kFreezeForces, kNone, kNone, kNone, kOver},
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
  gate.update(RunPhase::kRunning, false);
  EXPECT_EQ(refusalOf(gate, CommandKind::kPause), Refusal::kAlready) << "of a tick before it";
  gate.update(RunPhase::kPaused, false);
  gate.accept(ChangeKind::kResume);
  EXPECT_EQ(refusalOf(gate, CommandKind::kResume), Refusal::kAlready);
  gate.update(RunPhase::kSucceeded, false);
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

TEST(CommandGateTest, AsManyCommandsWaitForTheEndOfAPauseOrAStopAsATickTakes) {
  const auto fill = [](CommandGate& gate) {
    for (std::size_t i = 0; i < kMaxChanges; ++i) {
      EXPECT_EQ(refusalOf(gate, CommandKind::kFulfilled), Refusal::kNone);
      gate.accept(ChangeKind::kGameCommand);
    }
  };
  CommandGate running = gateIn(RunPhase::kRunning);
  fill(running);
  EXPECT_EQ(refusalOf(running, CommandKind::kFulfilled), Refusal::kNone) << "each tick takes them";

  CommandGate paused = gateIn(RunPhase::kPaused);
  fill(paused);
  EXPECT_EQ(refusalOf(paused, CommandKind::kFulfilled), Refusal::kTooMany);
  EXPECT_EQ(refusalOf(paused, CommandKind::kResume), Refusal::kNone) << "the way out is open";
  paused.update(RunPhase::kPaused, false);
  EXPECT_EQ(refusalOf(paused, CommandKind::kFulfilled), Refusal::kTooMany);
  paused.update(RunPhase::kRunning, false);
  EXPECT_EQ(refusalOf(paused, CommandKind::kFulfilled), Refusal::kNone) << "the session continues";

  CommandGate stopped = gateIn(RunPhase::kRunning);
  stopped.engageStop();
  fill(stopped);
  stopped.update(RunPhase::kRunning, true);
  EXPECT_EQ(refusalOf(stopped, CommandKind::kFulfilled), Refusal::kTooMany);

  CommandGate resumed = gateIn(RunPhase::kPaused);
  resumed.resume(kMaxChanges);
  EXPECT_EQ(refusalOf(resumed, CommandKind::kFulfilled), Refusal::kTooMany) << "of the killed server";
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
