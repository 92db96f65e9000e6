#include "clients/observer/observer.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "idl/types/names.h"

namespace tenon::observer {

namespace {
using Json = nlohmann::json;
constexpr Tick kProgressPeriod = 2000;  // [ticks]

const char* nameOf(ConditionGroup group) {
  switch (group) {
    case ConditionGroup::kSingle:
      return "";
    case ConditionGroup::kAll:
      return "all";
    case ConditionGroup::kAny:
      return "any";
  }
  return "";
}

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

/// Texts of the bus are what people typed: bytes that are not UTF-8 become U+FFFD.
std::string lineOf(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }
}  // namespace

void Observer::printJson(const std::string& line) const {
  std::fprintf(options_.out, "%s\n", line.c_str());
  std::fflush(options_.out);
}

void Observer::receive(const StepState& step) {
  if (!options_.json) return timeline_.receive(step);
  const bool same = step.step == step_.step && step.phase == step_.phase && step.started == step_.started &&
                    step_.revision != 0;
  step_ = step;
  if (same) return;
  printJson(lineOf({{"kind", "step"},
                    {"tick", step.started},
                    {"step", step.step},
                    {"steps", step.steps},
                    {"name", step.name},
                    {"phase", nameOf(step.phase)},
                    {"part", step.part},
                    {"instruction", localized(step.instruction, options_.language)}}));
}

void Observer::receive(const StepProgress& progress) {
  if (!options_.json) return timeline_.receive(progress);
  if (progress.tick < last_progress_ + kProgressPeriod && progress.tick >= last_progress_) return;
  last_progress_ = progress.tick;
  Json conditions = Json::array();
  for (const ConditionValue& condition : progress.conditions) {
    conditions.push_back({{"text", condition.text},
                          {"value", condition.value},
                          {"limit", condition.limit},
                          {"met", condition.met},
                          {"group", nameOf(condition.group)},
                          {"depth", condition.depth}});
  }
  printJson(lineOf({{"kind", "progress"},
                    {"tick", progress.tick},
                    {"position_error", progress.position_error},
                    {"angle_error", progress.angle_error},
                    {"contact_seconds", progress.contact_seconds},
                    {"conditions", conditions}}));
}

void Observer::receive(const ContactPairs& pairs) {
  if (!options_.json) return timeline_.receive(pairs);
  for (const PairContact& pair : pairs.pairs) {
    bool& touching = touching_[{pair.a, pair.b}];
    if (touching == pair.colliding) continue;
    touching = pair.colliding;
    printJson(lineOf({{"kind", "contact"},
                      {"tick", pairs.tick},
                      {"a", timeline_.titleOf(pair.a)},
                      {"b", timeline_.titleOf(pair.b)},
                      {"colliding", pair.colliding},
                      {"force", pair.F_Ao_W.force.norm()},
                      {"depth", pair.depth}}));
  }
}

void Observer::receive(const EventLog& event) {
  if (!options_.json) return timeline_.receive(event);
  printJson(lineOf({{"kind", "event"},
                    {"tick", event.tick},
                    {"severity", nameOf(event.severity)},
                    {"what", event.kind},
                    {"text", event.text}}));
}

void Observer::receive(const Presence& presence) {
  if (!options_.json) return timeline_.receive(presence);
  bool& alive = participants_[presence.client];
  if (alive == presence.alive) return;
  alive = presence.alive;
  printJson(lineOf({{"kind", "person"}, {"name", presence.name}, {"here", presence.alive}}));
}

// without --json the event log reports the stop

void Observer::receive(const EmergencyStop& stop) {
  if (!stops_.raise(stop) || !options_.json) return;
  printJson(
      lineOf({{"kind", "emergency stop"}, {"engaged", true}, {"who", stop.who}, {"reason", stop.reason}}));
}

void Observer::receive(const EmergencyClear& cleared) {
  if (!stops_.clear(cleared) || !options_.json) return;
  printJson(lineOf({{"kind", "emergency stop"},
                    {"engaged", stops_.engaged()},
                    {"who", cleared.who},
                    {"reason", cleared.reason}}));
}

void Observer::receive(const RunState& run) {
  const bool same = run.phase == run_.phase && run.server_epoch == run_.server_epoch;
  run_ = run;
  if (!options_.json) return timeline_.receive(run);
  if (same) return;
  printJson(lineOf({{"kind", "run"},
                    {"tick", run.tick},
                    {"phase", runPhaseName(run.phase)},
                    {"reason", run.reason},
                    {"final_hash", fmt::format("{:016x}", run.final_hash)}}));
}

}  // namespace tenon::observer
