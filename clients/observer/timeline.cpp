#include "clients/observer/timeline.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "idl/types/names.h"

namespace tenon::observer {

namespace {
constexpr Tick kProgressPeriod = 2000;  // [ticks]
constexpr Tick kStepDelay = 1;  // [ticks] a step takes effect, and is published, in the tick after its begin
constexpr double kDegrees = 57.29577951308232;

constexpr Tick kHandsPeriod = 1000;  // [ticks] at most one sentence of a kind about hands in it
const std::set<std::string> kOwnKinds{"pointer", "assistant", "forearm", "head"};

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

/// The name in "hand 'right' is held still"; empty when there is none.
std::string quotedName(const std::string& text) {
  const std::size_t begin = text.find('\'');
  const std::size_t end = text.find('\'', begin + 1);
  return end == std::string::npos ? std::string() : text.substr(begin, end + 1 - begin);
}

/// A sentence about one or several hands, for a trainer.
std::string handsText(const std::string& kind, const std::vector<std::string>& names) {
  const bool one = names.size() == 1;
  const std::string hands = fmt::format("{} {}", one ? "hand" : "hands", fmt::join(names, ", "));
  if (kind == "hand free") return fmt::format("{} {} again", hands, one ? "moves" : "move");
  if (kind == "hand gone")
    return fmt::format("! {} {} absent: what {} held is parked", hands, one ? "is" : "are",
                       one ? "it" : "they");
  return fmt::format("! {} {} still: no movement arrives from the station in time", hands,
                     one ? "is held" : "are held");
}

/// A step of which only the begin was heard was done, unless the next one began without its end.
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
  if (kOwnKinds.contains(object.kind)) own_titles_.insert(title);
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
  if (event.kind == "run" || event.kind.starts_with("step")) return;
  if (event.kind == "taken" || event.kind == "let go") {
    add(event.tick, Rank::kGrab, [this, event] { printGrab(event, event.kind == "taken"); });
  } else if (event.kind == "mounted" || event.kind == "put in place") {
    add(event.tick, Rank::kGrab, [this, event] { printMounted(event); });
  } else if (event.kind == "hand frozen" || event.kind == "hand free" || event.kind == "hand gone") {
    receiveHand(event);
  } else {
    add(event.tick, event.kind == "leave" ? Rank::kLeave : Rank::kParticipant,
        [this, event] { printEvent(event); });
  }
}

/// Hands of one station stall together, and on a busy machine many times a second.
void Timeline::receiveHand(const EventLog& event) {
  const std::string name = quotedName(event.text);
  if (event.kind == "hand frozen") frozen_since_[name] = event.tick;
  if (event.kind == "hand free" && event.tick < frozen_since_[name] + kHandsPeriod) return;
  const std::pair period{event.kind, event.tick / kHandsPeriod};
  auto& names = hands_[period];
  if (names.empty())
    add(event.tick, Rank::kParticipant, [this, event, period] { printHands(event, hands_[period]); });
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

void Timeline::receive(const RunState& run) {
  clock_.add(run);
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
    // the end of a step has a revision of its own
    const bool is_left =
        step_phases_[step_.started] == StepPhase::kActive && step.revision == step_.revision + 1;
    endStep(begin, is_left ? "left after" : endText(step_phases_[step_.started]));
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

void Timeline::endStep(Tick tick, const char* how) {
  if (step_ended_) return;
  step_ended_ = true;
  print(tick,
        fmt::format("{}: {} {:.1f} s", stepNumber(), how, seconds(clock_.between(step_.started, tick))));
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
  if (own_titles_.contains(title)) return;
  if (is_taken) holders_[title] = holderOf(title, event.tick);
  if (!is_taken && mounted_ == std::pair(title, event.tick)) return;
  const std::string& holder = holders_[title];
  const char* const by = holder.empty() ? "" : " by ";
  print(event.tick, fmt::format("  {} is {}{}{}{}", title, is_taken ? "taken" : "let go", by, holder, hand));
}

void Timeline::printMounted(const EventLog& event) {
  mounted_ = {event.text, event.tick};
  if (event.kind != "mounted") return print(event.tick, fmt::format("  {} is put in place", event.text));
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
  const bool says_what = event.kind == "join" || event.kind == "leave";
  print(event.tick, fmt::format("{}{}{}", mark, says_what ? "" : event.kind + ": ", text));
}

void Timeline::printHands(const EventLog& event, const std::vector<std::string>& names) {
  const auto last = hands_told_.find(event.kind);
  if (last != hands_told_.end() && event.tick < last->second + kHandsPeriod) return;
  hands_told_[event.kind] = event.tick;
  print(event.tick, handsText(event.kind, names));
}

void Timeline::printRun(const RunState& run) {
  const bool is_over = isOver(run.phase);
  const bool has_timed_out = !step_ended_ && step_phases_[step_.started] == StepPhase::kTimedOut;
  if (run.phase == RunPhase::kSucceeded || has_timed_out)
    endStep(run.tick, endText(step_phases_[step_.started]));
  const bool is_incomplete = run.phase == RunPhase::kSucceeded && !isCompleted(run);
  const std::string_view phase = is_incomplete ? std::string_view(run.reason) : runPhaseName(run.phase);
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
