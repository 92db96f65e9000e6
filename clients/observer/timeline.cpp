#include "clients/observer/timeline.h"

#include <algorithm>

#include <fmt/format.h>

#include "idl/types/names.h"

namespace tenon::observer {

namespace {
constexpr Tick kProgressPeriod = 2000;  // [ticks]
constexpr Tick kStepDelay = 1;  // [ticks] a step takes effect, and is published, in the tick after its begin
constexpr double kDegrees = 57.29577951308232;

double seconds(Tick ticks) { return static_cast<double>(ticks) * kTickSeconds; }

/// "title (hand)" of an event about a grab.
std::pair<std::string, std::string> splitGrab(const std::string& text) {
  const std::size_t at = text.rfind(" (");
  if (at == std::string::npos) return {text, {}};
  return {text.substr(0, at), text.substr(at)};
}

std::string errorText(const StepProgress& progress) {
  const double mm = progress.position_error * 1e3;
  return fmt::format("{:.{}f} mm and {:.1f} degrees", mm, mm < 100.0 ? 1 : 0,
                     progress.angle_error * kDegrees);
}

/// A step of which only the begin was heard was done: otherwise no next one would have begun.
const char* endText(StepPhase phase) {
  switch (phase) {
    case StepPhase::kSkipped:
      return "skipped after";
    case StepPhase::kTimedOut:
      return "not done in time:";
    default:
      return "done after";
  }
}
}  // namespace

void Timeline::add(Tick tick, Rank rank, std::function<void()> print) {
  pending_.insert({{tick, rank}, {Clock::now(), std::move(print)}});
}

void Timeline::printReceivedBefore(Clock::time_point limit) {
  auto end = pending_.end();
  while (end != pending_.begin() && std::prev(end)->second.received >= limit) --end;
  for (auto it = pending_.begin(); it != end; it = pending_.erase(it)) it->second.print();
}

void Timeline::print(Tick tick, const std::string& text) const {
  if (is_over_) return;
  std::fprintf(out_, "%s\n", fmt::format("{:7.2f} s  {}", seconds(tick), text).c_str());
  std::fflush(out_);
}

void Timeline::receive(const SceneObject& object) {
  const std::string& title = object.title.empty() ? object.name : object.title;
  titles_[object.object] = title;
  if (object.kind == "pointer" || object.kind == "assistant") pointer_titles_.insert(title);
}

void Timeline::receive(const StepState& step) {
  if (step.phase == StepPhase::kWaiting) return;
  const bool is_new = step_phases_.insert_or_assign(step.started, step.phase).second;
  if (is_new) add(step.started + kStepDelay, Rank::kStepBegin, [this, step] { beginStep(step); });
}

void Timeline::receive(const StepProgress& progress) {
  add(progress.tick, Rank::kProgress, [this, progress] { printProgress(progress); });
}

void Timeline::receive(const ContactPairs& pairs) {
  for (const PairContact& pair : pairs.pairs) {
    bool& touching = touching_[std::minmax(pair.a, pair.b)];
    if (pair.colliding && !touching)
      add(pairs.tick, Rank::kContact,
          [this, tick = pairs.tick, a = pair.a, b = pair.b] { printContact(tick, a, b); });
    touching = pair.colliding;
  }
}

void Timeline::receive(const EventLog& event) {
  // RunState and StepState say more
  if (event.kind == "run" || event.kind == "step" || event.kind == "step done") return;
  if (event.kind == "taken" || event.kind == "let go") {
    add(event.tick, Rank::kGrab, [this, event] { printGrab(event, event.kind == "taken"); });
  } else if (event.kind == "mounted") {
    add(event.tick, Rank::kGrab, [this, event] { printMounted(event); });
  } else {
    add(event.tick, event.kind == "leave" ? Rank::kLeave : Rank::kParticipant,
        [this, event] { printEvent(event); });
  }
}

void Timeline::receive(const RunState& run) {
  const std::pair newest{run.phase, run.server_epoch};
  if (newest == run_) return;
  run_ = newest;
  add(run.tick, isOver(run.phase) ? Rank::kRunEnd : Rank::kRun, [this, run] { printRun(run); });
}

void Timeline::beginStep(const StepState& step) {
  const Tick begin = step.started + kStepDelay;
  if (step_.revision > 0 && step.step <= step_.step) {
    print(begin, fmt::format("the session is set back to step {}", step.step + 1));
  } else {
    endStep(begin);
  }
  step_ = step;
  step_ended_ = false;
  progress_ = {};
  last_progress_ = step.started;
  contacts_.clear();
  const std::string title = localized(step.title, language_);
  print(begin, fmt::format("{}: {}", stepNumber(), title.empty() ? step.name : title));
  if (const std::string instruction = localized(step.instruction, language_); !instruction.empty())
    print(begin, fmt::format("  the trainee is told: {}", instruction));
}

void Timeline::endStep(Tick tick) {
  if (step_ended_) return;
  step_ended_ = true;
  print(tick, fmt::format("{}: {} {:.1f} s", stepNumber(), endText(step_phases_[step_.started]),
                          seconds(tick - step_.started)));
}

void Timeline::printProgress(const StepProgress& progress) {
  if (progress.revision != step_.revision) return;  // of another step
  progress_ = progress;
  if (step_ended_ || !step_.has_target || progress.tick < last_progress_ + kProgressPeriod) return;
  last_progress_ = progress.tick;
  std::string text = fmt::format("  {} is {} from its place", titleOf(step_.object), errorText(progress));
  if (progress.contact_seconds > 0.0)
    text += fmt::format(", was in contact for {:.1f} s", progress.contact_seconds);
  print(progress.tick, text);
}

void Timeline::printContact(Tick tick, ObjectId a, ObjectId b) {
  if (contacts_.insert(std::minmax(a, b)).second)
    print(tick, fmt::format("  {} touches {}", titleOf(a), titleOf(b)));
}

void Timeline::printGrab(const EventLog& event, bool is_taken) {
  const auto [title, hand] = splitGrab(event.text);
  if (pointer_titles_.contains(title)) return;
  if (is_taken) holders_[title] = holderOf(title, event.tick);
  if (!is_taken && mounted_ == std::pair(title, event.tick)) return;
  const std::string& holder = holders_[title];
  const char* const by = holder.empty() ? "" : " by ";
  print(event.tick, fmt::format("  {} is {}{}{}{}", title, is_taken ? "taken" : "let go", by, holder, hand));
}

void Timeline::printMounted(const EventLog& event) {
  mounted_ = {event.text, event.tick};
  const bool is_measured = progress_.tick > 0 && step_.has_target && titleOf(step_.object) == event.text;
  print(event.tick, fmt::format("  {} is mounted{}{}", event.text, is_measured ? ", with an error of " : "",
                                is_measured ? errorText(progress_) : ""));
}

void Timeline::printEvent(const EventLog& event) const {
  const char* mark = "";
  if (event.severity == Severity::kWarning) mark = "! ";
  if (event.severity == Severity::kError) mark = "!! ";
  std::string text = event.text;
  if (const std::size_t at = text.find(" ("); at != std::string::npos) {
    const std::string role = " (" + text.substr(0, at) + ")";
    if (text.compare(at, role.size(), role) == 0) text.erase(at, role.size());  // "trainee (trainee) is here"
  }
  const bool says_what = event.kind == "join" || event.kind == "leave" || event.kind.starts_with("hand");
  print(event.tick, fmt::format("{}{}{}", mark, says_what ? "" : event.kind + ": ", text));
}

void Timeline::printRun(const RunState& run) {
  const bool is_over = isOver(run.phase);
  const bool has_timed_out = !step_ended_ && step_phases_[step_.started] == StepPhase::kTimedOut;
  if (run.phase == RunPhase::kSucceeded || has_timed_out) endStep(run.tick);
  const std::string_view phase = runPhaseName(run.phase);
  const bool is_clear = run.phase == RunPhase::kSucceeded || has_timed_out || run.reason == phase;
  const char* const verb = run.phase == RunPhase::kStopped ? "was" : is_over ? "has" : "is";
  print(run.tick,
        fmt::format("the session {} {}{}{}", verb, phase, is_clear ? "" : ": ", is_clear ? "" : run.reason));
  is_over_ = is_over;
}

std::string Timeline::titleOf(ObjectId object) const {
  const auto found = titles_.find(object);
  if (found != titles_.end()) return found->second;
  return object.valid() ? fmt::format("object {}", object.value) : "nothing";
}

std::string Timeline::stepNumber() const { return fmt::format("step {} of {}", step_.step + 1, step_.steps); }

std::string Timeline::holderOf(const std::string& title, Tick tick) const {
  for (const auto& [key, hand] : grabs_) {
    if (key.second != tick || titleOf(key.first) != title) continue;
    for (const auto& [client, who] : participants_) {
      if (who.alive && std::find(who.hands.begin(), who.hands.end(), hand) != who.hands.end())
        return who.name;
    }
  }
  return {};
}

}  // namespace tenon::observer
