#include "server/session/command_gate.h"

namespace tenon::session {

namespace {

/// `expected`: the phase after all that was accepted.
tl::expected<void, Refused> checkIn(RunPhase phase, RunPhase expected, bool is_stopped, CommandKind kind) {
  if (kind == CommandKind::kNote || kind == CommandKind::kKick) return {};
  if (isOver(phase)) return refuse(Refusal::kOver, "the run is over");
  const bool in_any_phase = kind == CommandKind::kSetCollision || kind == CommandKind::kStop ||
                            kind == CommandKind::kClearEmergencyStop || kind == CommandKind::kGuide;
  if (in_any_phase) return {};
  if (phase == RunPhase::kWaitingForPeople)
    return refuse(Refusal::kWaiting, "the session still waits for people: repeat the command once it runs");
  // a pause is what the clear of the stop leaves; a hand may have to let go in a stop
  const bool in_stop =
      kind == CommandKind::kPause || kind == CommandKind::kFreezeForces || kind == CommandKind::kRelease;
  if (is_stopped && !in_stop) return refuse(Refusal::kStopped, "the emergency stop stands: clear it first");
  const bool is_paused = expected == RunPhase::kPaused;
  if (kind == CommandKind::kResume && !is_paused)
    return refuse(Refusal::kAlready, "the session is not paused");
  if (kind == CommandKind::kPause && is_paused)
    return refuse(Refusal::kAlready, "the session is paused already");
  return {};
}

}  // namespace

std::uint32_t openCommands(RunPhase phase, bool is_stopped) {
  std::uint32_t open = 0;
  for (const CommandKind kind : kCommandKinds)
    if (checkIn(phase, phase, is_stopped, kind)) open |= bitOf(kind);
  return open;
}

void CommandGate::update(RunPhase phase) {
  phase_ = phase;
  const bool active = phase == RunPhase::kRunning || phase == RunPhase::kPaused;
  if (pending_phase_ == phase || !active) pending_phase_.reset();
}

tl::expected<void, Refused> CommandGate::check(CommandKind kind) const {
  return checkIn(phase_, expectedPhase(), is_stop_engaged_, kind);
}

void CommandGate::accept(ChangeKind change) {
  if (change == ChangeKind::kPause) pending_phase_ = RunPhase::kPaused;
  if (change == ChangeKind::kResume) pending_phase_ = RunPhase::kRunning;
  end_requested_ = end_requested_ || change == ChangeKind::kStop;
}

void CommandGate::clearStop() {
  is_stop_engaged_ = false;
  if (expectedPhase() == RunPhase::kRunning) pending_phase_ = RunPhase::kPaused;
}

}  // namespace tenon::session
