#include "server/session/event_generator.h"

#include <algorithm>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "server/game_control/state_machine.h"
#include "server/session/command_gate.h"
#include "server/session/step_blocker.h"

namespace tenon::session {

namespace {

/// Kind of the event that a state ends with; nullptr while it has not ended.
const char* endKind(StepPhase phase) {
  switch (phase) {
    case StepPhase::kDone:
      return "step done";
    case StepPhase::kSkipped:
      return "step skipped";
    case StepPhase::kTimedOut:
      return "step timed out";
    default:
      return nullptr;
  }
}

constexpr std::size_t kMostOfReason = 511;  ///< [bytes] of RunState in idl/tenon.idl

std::string counted(std::uint32_t steps, std::string_view what) {
  return fmt::format(", {} step{} {}", steps, steps == 1 ? "" : "s", what);
}

/// How a run ends after its last step.
std::string endOf(const game_control::StepStatus& step) {
  if (step.skipped == 0 && step.timed_out == 0) return "everything is mounted";
  return "ended" + (step.skipped > 0 ? counted(step.skipped, "skipped") : "") +
         (step.timed_out > 0 ? counted(step.timed_out, "not done in time") : "");
}

}  // namespace

SceneObject describe(ObjectId id, const simulation::ObjectSpec& spec) {
  SceneObject object;
  object.object = id;
  object.name = spec.name;
  object.title = spec.title;
  object.titles = spec.titles;
  object.kind = spec.kind;
  object.color = spec.color;
  object.X_WO = spec.X_WO;
  if (spec.structures == nullptr) return object;
  object.structure_hash = spec.structures->info.content_hash;
  object.size = spec.structures->info.box_M.sizes();
  object.centre = spec.structures->info.box_M.center();
  return object;
}

EventGenerator::EventGenerator(std::shared_ptr<const game_control::ScenarioFile> scenario,
                               std::uint32_t server_epoch)
    : scenario_(std::move(scenario)), server_epoch_(server_epoch) {}

void EventGenerator::resume(Tick tick) {
  constexpr std::uint64_t kMostEventsPerTick = 64;
  tick_ = tick;
  event_count_ = tick * kMostEventsPerTick;
}

EventLog EventGenerator::makeEvent(Severity severity, std::string kind, std::string text) {
  return {++event_count_, tick_, severity, std::move(kind), std::move(text)};
}

TickEvents EventGenerator::generate(const TickOutput& output) {
  TickEvents events;
  tick_ = output.tick;
  addRun(output, events);
  addStep(output, events);
  addMatrix(output, events);
  addObjects(output, events);
  addHands(output, events);
  previous_ = output;
  return events;
}

void EventGenerator::addMatrix(const TickOutput& output, TickEvents& events) const {
  if (previous_ && previous_->collides == output.collides) return;
  const std::size_t parts =
      std::max<std::size_t>(1, (output.collides.size() + kMatrixBytes - 1) / kMatrixBytes);
  for (std::size_t i = 0; i < parts; ++i) {
    const auto bits = std::span(output.collides).subspan(i * kMatrixBytes);
    const auto some = bits.first(std::min(bits.size(), kMatrixBytes));
    events.matrix.push_back({static_cast<std::uint32_t>(i),
                             static_cast<std::uint32_t>(parts),
                             output.tick,
                             {some.begin(), some.end()}});
  }
}

RunState EventGenerator::runBefore(bool is_stopped, const std::vector<std::string>& missing) const {
  std::string waiting =
      fmt::format("waiting for people{}{}", missing.empty() ? "" : ": ", fmt::join(missing, ", "));
  if (waiting.size() > kMostOfReason) waiting = "waiting for people";
  return {.phase = RunPhase::kWaitingForPeople,
          .tick = tick_,
          .reason = is_stopped ? "emergency stop" : std::move(waiting),
          .server_epoch = server_epoch_,
          .emergency_stop = is_stopped,
          .open_commands = openCommands(RunPhase::kWaitingForPeople, is_stopped)};
}

void EventGenerator::addRun(const TickOutput& output, TickEvents& events) {
  if (previous_ && previous_->phase == output.phase && previous_->emergency_stop == output.emergency_stop &&
      previous_->forces_frozen == output.forces_frozen)
    return;
  RunState run;
  run.phase = output.phase;
  run.tick = output.tick;
  run.server_epoch = server_epoch_;
  switch (output.phase) {
    case RunPhase::kWaitingForPeople:
      run.reason = "waiting for people";
      break;
    case RunPhase::kRunning:
      run.reason = "running";
      break;
    case RunPhase::kPaused:
      run.reason = "paused";
      break;
    case RunPhase::kSucceeded:
      run.reason = endOf(output.step);
      break;
    case RunPhase::kFailed:
      run.reason = fmt::format("step '{}' was not done in time", scenario_->states[output.step.step].name);
      if (const std::string blocker = blockerOf(output); !blocker.empty()) run.reason += ": " + blocker;
      break;
    case RunPhase::kStopped:
      run.reason = "stopped";
      break;
  }
  run.forces_frozen = output.forces_frozen;
  run.emergency_stop = output.emergency_stop;
  run.open_commands = openCommands(output.phase, output.emergency_stop);
  if (output.forces_frozen && output.phase == RunPhase::kRunning) run.reason = "forces frozen";
  if (output.emergency_stop && !isOver(output.phase)) run.reason = "emergency stop";
  run.steps_skipped = output.step.skipped;
  run.steps_timed_out = output.step.timed_out;
  if (output.phase >= RunPhase::kSucceeded) run.final_hash = output.hash;
  const bool is_error = output.phase == RunPhase::kFailed || output.emergency_stop;
  // a pause within a stop is the same to people
  if (run.reason != run_reason_)
    events.log.push_back(makeEvent(is_error ? Severity::kError : Severity::kInfo, "run", run.reason));
  run_reason_ = run.reason;
  events.run = std::move(run);
}

std::string EventGenerator::blockerOf(const TickOutput& output) const {
  // in the tick before: where a step ends, its object may be placed
  const bool is_known = previous_ && previous_->step.step == output.step.step;
  return is_known ? whatBlocks(*scenario_, *previous_) : "";
}

void EventGenerator::addStep(const TickOutput& output, TickEvents& events) {
  if (previous_ && previous_->step.revision == output.step.revision) return;
  const game_control::ScenarioFile& scenario = *scenario_;
  if (const char* const end = endKind(output.step.phase))
    events.log.push_back(makeEvent(Severity::kInfo, end,
                                   fmt::format("{} ({:.1f} s)", scenario.states[output.step.step].name,
                                               static_cast<double>(output.step.elapsed) * kTickSeconds)));
  events.step = describe(scenario, output.step);
  if (output.step.phase == StepPhase::kTimedOut)
    if (std::string blocker = blockerOf(output); !blocker.empty())
      events.log.push_back(makeEvent(Severity::kWarning, "not in time", std::move(blocker)));
  if (output.phase != RunPhase::kWaitingForPeople && output.step.phase == StepPhase::kActive)
    events.log.push_back(makeEvent(Severity::kInfo, "step", scenario.states[output.step.step].name));
}

void EventGenerator::addObjects(const TickOutput& output, TickEvents& events) {
  for (std::size_t i = 0; i < output.objects.size(); ++i) {
    const ObjectState& now = output.objects[i];
    const ObjectState* then = previous_ ? &previous_->objects[i] : nullptr;
    const bool jumped = then == nullptr || then->epoch != now.epoch || then->status != now.status;
    if (jumped || (output.tick + i) % 1000 == 0) events.snapshots.push_back({output.tick, now});
    const HandId previous_holder = then != nullptr ? then->holder : HandId{};
    if (previous_holder != now.holder || (jumped && now.holder.valid())) {
      GrabState grab{now.object, now.holder, now.epoch, {}, output.tick};
      if (now.holder.valid()) grab.X_HO = output.manifolds[now.holder.value].X_HO;
      events.grabs.push_back(grab);
    }
    if (then == nullptr) continue;

    const std::string& title = scenario_->objects[i].title.front().text;
    if (then->status != now.status && now.status == static_cast<std::uint8_t>(ObjectStatus::kFixed)) {
      // a step that is skipped, passed by 'goto' or out of time puts its part in place too
      const bool by_people =
          output.step.phase == StepPhase::kDone && scenario_->states[output.step.step].object.value == i;
      events.log.push_back(makeEvent(Severity::kInfo, by_people ? "mounted" : "put in place", title));
    }
    if (then->holder != now.holder) {
      const HandId hand = now.holder.valid() ? now.holder : then->holder;
      events.log.push_back(makeEvent(Severity::kInfo, now.holder.valid() ? "taken" : "let go",
                                     fmt::format("{} ({} hand)", title, scenario_->hands[hand.value].name)));
    }
  }
}

void EventGenerator::addHands(const TickOutput& output, TickEvents& events) {
  for (std::size_t i = 0; i < output.present.size(); ++i) {
    const bool was_frozen = previous_ && previous_->present[i] && previous_->manifolds[i].frozen;
    const bool is_frozen = output.present[i] && output.manifolds[i].frozen;
    const std::string& name = scenario_->hands[i].name;
    if (previous_ && previous_->present[i] && !output.present[i])
      events.log.push_back(makeEvent(Severity::kWarning, "hand gone",
                                     fmt::format("hand '{}' is absent: the object it held is parked", name)));
    if (!previous_ || previous_->present[i] != output.present[i]) continue;
    if (is_frozen && !was_frozen)
      events.log.push_back(
          makeEvent(Severity::kWarning, "hand frozen",
                    fmt::format("hand '{}' is held still (last input {} ms ago)", name, output.ages[i])));
    if (was_frozen && !is_frozen && output.present[i])
      events.log.push_back(
          makeEvent(Severity::kInfo, "hand free", fmt::format("hand '{}' moves again", name)));
  }
}

bool FramePacker::contains(const std::vector<WorldFrame>& frames, ObjectId object) {
  return std::any_of(frames.begin(), frames.end(), [&](const WorldFrame& frame) {
    return std::any_of(frame.states.begin(), frame.states.end(),
                       [&](const ObjectState& state) { return state.object == object; });
  });
}

void FramePacker::pack(const TickOutput& output, bool all, std::vector<WorldFrame>& frames) {
  const std::size_t count = output.objects.size();
  if (poses_.size() != count) {
    poses_.assign(count, Pose::Identity());
    epochs_.assign(count, 0);
    twists_.assign(count, decltype(ObjectState::V_WO)::Zero());
  }
  frames.clear();
  const auto add = [&](std::size_t i) {
    if (frames.empty() || frames.back().states.full()) {
      frames.emplace_back();
      frames.back().server_epoch = server_epoch_;
      frames.back().tick = output.tick;
      frames.back().step_revision = output.step.revision;
      frames.back().part = static_cast<std::uint32_t>(frames.size() - 1);
    }
    frames.back().states.push_back(output.objects[i]);
    poses_[i] = output.objects[i].X_WO;
    epochs_[i] = output.objects[i].epoch;
    twists_[i] = output.objects[i].V_WO;
  };
  const auto isAsPacked = [&](std::size_t i) {
    const ObjectState& now = output.objects[i];
    return epochs_[i] == now.epoch && poses_[i] == now.X_WO && twists_[i] == now.V_WO;
  };
  for (std::size_t i = 0; i < count; ++i)
    if (all || !isAsPacked(i)) add(i);

  bool refreshed = false;
  for (std::size_t k = 0; !all && !refreshed && k < count; ++k) {
    refreshed_ = (refreshed_ + 1) % static_cast<std::uint32_t>(count);
    if (contains(frames, ObjectId{refreshed_})) continue;
    add(refreshed_);
    refreshed = true;
  }
  for (WorldFrame& frame : frames) frame.parts = static_cast<std::uint32_t>(frames.size());
}

}  // namespace tenon::session
