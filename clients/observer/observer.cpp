#include "clients/observer/observer.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "idl/types/names.h"

namespace tenon::observer {

namespace {
using Json = nlohmann::json;
constexpr Tick kProgressPeriod = 2000;  // [ticks]
constexpr double kDegrees = 57.29577951308232;

std::string seconds(Tick tick) { return fmt::format("{:7.2f} s", static_cast<double>(tick) * kTickSeconds); }

const char* nameOf(StepPhase phase) {
  switch (phase) {
    case StepPhase::kWaiting:
      return "waiting";
    case StepPhase::kActive:
      return "active";
    case StepPhase::kDone:
      return "done";
    case StepPhase::kTimedOut:
      return "timed out";
    case StepPhase::kSkipped:
      return "skipped";
  }
  return "unknown";
}

const char* nameOf(Severity severity) {
  switch (severity) {
    case Severity::kInfo:
      return "info";
    case Severity::kWarning:
      return "warning";
    case Severity::kError:
      return "error";
  }
  return "unknown";
}
}  // namespace

void Observer::print(const std::string& line) const {
  std::fprintf(options_.out, "%s\n", line.c_str());
  std::fflush(options_.out);
}

std::string Observer::titleOf(ObjectId object) const {
  const auto found = titles_.find(object);
  if (found != titles_.end()) return found->second;
  return object.valid() ? fmt::format("object {}", object.value) : "nothing";
}

std::string Observer::localized(const std::vector<LocalizedText>& texts) const {
  for (const LocalizedText& text : texts) {
    if (text.language == options_.language) return text.text;
  }
  return texts.empty() ? std::string() : texts.front().text;
}

void Observer::receive(const SceneObject& object) {
  const std::string& title = object.title.empty() ? object.name : object.title;
  titles_[object.object] = title;
  if (object.kind == "pointer" || object.kind == "assistant") pointer_titles_.insert(title);
}

void Observer::receive(const StepState& step) {
  const bool same = step.step == step_.step && step.phase == step_.phase && step.started == step_.started &&
                    step_.revision != 0;
  step_ = step;
  if (same) return;
  if (options_.json) {
    print(Json{{"kind", "step"},
               {"tick", step.started},
               {"step", step.step},
               {"steps", step.steps},
               {"name", step.name},
               {"phase", nameOf(step.phase)},
               {"part", step.part},
               {"instruction", localized(step.instruction)}}
              .dump());
    return;
  }
  const std::string title = localized(step.title).empty() ? step.name : localized(step.title);
  print(fmt::format("{}  step {}/{}  {}: {}", seconds(step.started), step.step + 1, step.steps, title,
                    nameOf(step.phase)));
  if (step.phase == StepPhase::kActive) print(fmt::format("{:11}{}", "", localized(step.instruction)));
}

void Observer::receive(const StepProgress& progress) {
  if (progress.tick < last_progress_ + kProgressPeriod && progress.tick >= last_progress_) return;
  last_progress_ = progress.tick;
  if (options_.json) {
    Json conditions = Json::array();
    for (const ConditionValue& condition : progress.conditions) {
      conditions.push_back({{"text", condition.text},
                            {"value", condition.value},
                            {"limit", condition.limit},
                            {"met", condition.met}});
    }
    print(Json{{"kind", "progress"},
               {"tick", progress.tick},
               {"position_error", progress.position_error},
               {"angle_error", progress.angle_error},
               {"contact_seconds", progress.contact_seconds},
               {"conditions", conditions}}
              .dump());
    return;
  }
  if (!step_.has_target) return;
  print(fmt::format("{}    position error {:.1f} mm, angle error {:.1f} degrees, {:.1f} s in contact",
                    seconds(progress.tick), progress.position_error * 1e3, progress.angle_error * kDegrees,
                    progress.contact_seconds));
}

void Observer::receive(const ContactPairs& pairs) {
  for (const PairContact& pair : pairs.pairs) {
    bool& touching = touching_[{pair.a, pair.b}];
    if (touching == pair.colliding) continue;
    touching = pair.colliding;
    const double force = pair.F_Ao_W.force.norm();
    if (options_.json) {
      print(Json{{"kind", "contact"},
                 {"tick", pairs.tick},
                 {"a", titleOf(pair.a)},
                 {"b", titleOf(pair.b)},
                 {"colliding", pair.colliding},
                 {"force", force},
                 {"depth", pair.depth}}
                .dump());
    } else if (pair.colliding) {
      print(fmt::format("{}    {} touches {}", seconds(pairs.tick), titleOf(pair.a), titleOf(pair.b)));
    }
  }
}

void Observer::receive(const EventLog& event) {
  if (options_.json) {
    print(Json{{"kind", "event"},
               {"tick", event.tick},
               {"severity", nameOf(event.severity)},
               {"what", event.kind},
               {"text", event.text}}
              .dump());
    return;
  }
  const bool grab = event.kind == "taken" || event.kind == "let go";
  if (grab && pointer_titles_.contains(event.text.substr(0, event.text.rfind(" (")))) return;
  const char* mark = event.severity == Severity::kError     ? "!!"
                     : event.severity == Severity::kWarning ? "! "
                                                            : "  ";
  print(fmt::format("{}  {}{}: {}", seconds(event.tick), mark, event.kind, event.text));
}

void Observer::receive(const Presence& presence) {
  bool& alive = participants_[presence.client];
  if (alive == presence.alive) return;
  alive = presence.alive;
  if (options_.json) {
    print(Json{{"kind", "person"}, {"name", presence.name}, {"here", presence.alive}}.dump());
  } else {
    print(fmt::format("{:11}{} {}", "", presence.name, presence.alive ? "has joined" : "has left"));
  }
}

void Observer::receive(const EmergencyStop& stop) {
  if (options_.json) {
    print(Json{
        {"kind", "emergency stop"}, {"engaged", stop.engaged}, {"who", stop.who}, {"reason", stop.reason}}
              .dump());
  } else if (stop.engaged) {
    print(fmt::format("{:11}!! EMERGENCY STOP by {}: {}", "", stop.who, stop.reason));
  }
}

void Observer::receive(const RunState& run) {
  const bool same = run.phase == run_.phase && run.server_epoch == run_.server_epoch;
  run_ = run;
  if (same) return;
  if (options_.json) {
    print(Json{{"kind", "run"},
               {"tick", run.tick},
               {"phase", runPhaseName(run.phase)},
               {"reason", run.reason},
               {"final_hash", fmt::format("{:016x}", run.final_hash)}}
              .dump());
  } else {
    const std::string reason =
        run.phase == RunPhase::kSucceeded || run.reason.empty() ? "" : ": " + run.reason;
    print(fmt::format("{}  session {}{}", seconds(run.tick), runPhaseName(run.phase), reason));
  }
}

bool Observer::over() const {
  return run_.phase == RunPhase::kSucceeded || run_.phase == RunPhase::kFailed ||
         run_.phase == RunPhase::kStopped;
}

}  // namespace tenon::observer
