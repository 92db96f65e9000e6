#include "server/session/chronicle.h"

#include <algorithm>

#include <fmt/format.h>

#include "server/game_control/state_machine.h"

namespace tenon {

SceneObject describe(ObjectId id, const ObjectSpec& spec) {
  SceneObject object;
  object.object = id;
  object.name = spec.name;
  object.title = spec.title;
  object.kind = spec.kind;
  object.color = spec.color;
  object.X_WO = spec.X_WO;
  if (spec.structures == nullptr) return object;
  object.structure_hash = spec.structures->info.content_hash;
  object.size = spec.structures->info.box_M.sizes();
  object.centre = spec.structures->info.box_M.center();
  return object;
}

Chronicle::Chronicle(std::shared_ptr<const ScenarioFile> scenario, std::uint32_t server_epoch)
    : scenario_(std::move(scenario)), server_epoch_(server_epoch) {}

EventLog Chronicle::event(Severity severity, std::string kind, std::string text) {
  return {++events_, tick_, severity, std::move(kind), std::move(text)};
}

News Chronicle::read(const TickOutput& output) {
  News news;
  tick_ = output.tick;
  readRun(output, news);
  readStep(output, news);
  readObjects(output, news);
  readHands(output, news);
  before_ = output;
  return news;
}

void Chronicle::readRun(const TickOutput& output, News& news) {
  if (before_ && before_->phase == output.phase && before_->emergency_stop == output.emergency_stop) return;
  RunState run;
  run.phase = output.phase;
  run.tick = output.tick;
  run.server_epoch = server_epoch_;
  switch (output.phase) {
    case RunPhase::kWaitingForPeople:
      run.reason = "waiting for people";
      break;
    case RunPhase::kRunning:
      run.reason = output.emergency_stop ? "emergency stop" : "running";
      break;
    case RunPhase::kPaused:
      run.reason = "paused";
      break;
    case RunPhase::kSucceeded:
      run.reason = "everything is mounted";
      break;
    case RunPhase::kFailed:
      run.reason = fmt::format("step '{}' was not done in time", scenario_->states[output.step.step].name);
      break;
    case RunPhase::kStopped:
      run.reason = "stopped";
      break;
  }
  if (output.phase >= RunPhase::kSucceeded) run.final_hash = output.hash;
  const bool bad = output.phase == RunPhase::kFailed || output.emergency_stop;
  news.events.push_back(event(bad ? Severity::kError : Severity::kInfo, "run", run.reason));
  news.run = std::move(run);
}

void Chronicle::readStep(const TickOutput& output, News& news) {
  if (before_ && before_->step.revision == output.step.revision) return;
  const ScenarioFile& scenario = *scenario_;
  if (before_ && before_->step.step != output.step.step)
    news.events.push_back(
        event(Severity::kInfo, "step done",
              fmt::format("{} ({:.1f} s)", scenario.states[before_->step.step].name,
                          static_cast<double>(output.tick - before_->step.started) * kTickSeconds)));
  news.step = describe(scenario, output.step);
  if (output.phase != RunPhase::kWaitingForPeople && output.step.phase == StepPhase::kActive)
    news.events.push_back(event(Severity::kInfo, "step", scenario.states[output.step.step].name));
}

void Chronicle::readObjects(const TickOutput& output, News& news) {
  for (std::size_t i = 0; i < output.objects.size(); ++i) {
    const ObjectState& now = output.objects[i];
    const ObjectState* then = before_ ? &before_->objects[i] : nullptr;
    const bool jumped = then == nullptr || then->epoch != now.epoch || then->status != now.status;
    if (jumped || (output.tick + i) % 1000 == 0) news.snapshots.push_back({output.tick, now});
    const HandId former = then != nullptr ? then->holder : HandId{};
    if (former != now.holder || (jumped && now.holder.valid())) {
      GrabState grab{now.object, now.holder, now.epoch, {}, output.tick};
      if (now.holder.valid()) grab.X_HO = output.manifolds[now.holder.value].X_HO;
      news.grabs.push_back(grab);
    }
    if (then == nullptr) continue;

    const std::string& title = scenario_->objects[i].title.front().text;
    if (then->status != now.status && now.status == static_cast<std::uint8_t>(ObjectStatus::kFixed))
      news.events.push_back(event(Severity::kInfo, "mounted", title));
    if (then->holder != now.holder) {
      const HandId hand = now.holder.valid() ? now.holder : then->holder;
      news.events.push_back(event(Severity::kInfo, now.holder.valid() ? "taken" : "let go",
                                  fmt::format("{} ({} hand)", title, scenario_->hands[hand.value].name)));
    }
  }
}

void Chronicle::readHands(const TickOutput& output, News& news) {
  for (std::size_t i = 0; i < output.present.size(); ++i) {
    const bool was_frozen = before_ && before_->present[i] && before_->manifolds[i].frozen;
    const bool is_frozen = output.present[i] && output.manifolds[i].frozen;
    const std::string& name = scenario_->hands[i].name;
    if (before_ && before_->present[i] && !output.present[i])
      news.events.push_back(event(Severity::kWarning, "hand gone",
                                  fmt::format("hand '{}' is gone: what it held is parked", name)));
    if (!before_ || before_->present[i] != output.present[i]) continue;
    if (is_frozen && !was_frozen)
      news.events.push_back(
          event(Severity::kWarning, "hand frozen",
                fmt::format("hand '{}' is held still (last input {} ms ago)", name, output.ages[i])));
    if (was_frozen && !is_frozen && output.present[i])
      news.events.push_back(event(Severity::kInfo, "hand free", fmt::format("hand '{}' moves again", name)));
  }
}

bool FramePacker::isListed(const std::vector<WorldFrame>& frames, ObjectId object) {
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
  };
  for (std::size_t i = 0; i < count; ++i)
    if (all || epochs_[i] != output.objects[i].epoch || !(poses_[i] == output.objects[i].X_WO)) add(i);

  // the refresh: of those that stand still one in turn, and more as far as a frame of moving ones has room
  const bool nothing_moved = frames.empty();
  bool refreshed = false;
  for (std::size_t k = 0; !all && k < count; ++k) {
    if (refreshed && (nothing_moved || frames.back().states.full())) break;
    turn_ = (turn_ + 1) % static_cast<std::uint32_t>(count);
    if (isListed(frames, ObjectId{turn_})) continue;
    add(turn_);
    refreshed = true;
  }
  for (WorldFrame& frame : frames) frame.parts = static_cast<std::uint32_t>(frames.size());
}

}  // namespace tenon
