#include "clients/report/event_list.h"

#include <cstddef>
#include <functional>
#include <set>

namespace tenon::report {
namespace {

std::string_view toneOf(const SessionEvent& event) {
  if (event.kind == "mounted") return "good";
  if (event.severity == Severity::kError || event.kind == "emergency stop") return "bad";
  if (event.severity == Severity::kWarning || event.kind == "hand frozen" || event.kind == "safety")
    return "warn";
  return "";
}

bool isForTrainers(const SessionEvent& event) {
  static const std::set<std::string, std::less<>> kKinds{
      "join",        "leave",     "run",    "step",    "step done",    "step skipped",   "step timed out",
      "not in time", "taken",     "let go", "mounted", "put in place", "emergency stop", "safety",
      "hand frozen", "hand gone", "note",   "command", "dropped"};
  return event.severity == Severity::kError || kKinds.contains(event.kind);
}

}  // namespace

std::vector<ReportEvent> listedEvents(const std::vector<SessionEvent>& events) {
  constexpr double kJoinTime = 10.0;  // [s]
  std::vector<ReportEvent> listed;
  std::map<std::string, std::size_t> newest;  // index of the last one of each kind
  for (const SessionEvent& event : events) {
    if (!isForTrainers(event)) continue;
    const bool repeats = event.kind == "safety" || event.kind == "hand frozen";
    const auto known = newest.find(event.kind);
    if (repeats && known != newest.end() && event.time - listed[known->second].until < kJoinTime) {
      listed[known->second].until = event.time;
      ++listed[known->second].more;
      continue;
    }
    newest[event.kind] = listed.size();
    listed.push_back({event, toneOf(event), 0, event.time});
  }
  return listed;
}

std::map<std::string, int> otherEvents(const std::vector<SessionEvent>& events) {
  std::map<std::string, int> kinds;
  for (const SessionEvent& event : events)
    if (!isForTrainers(event)) kinds[event.kind] += event.times;
  return kinds;
}

}  // namespace tenon::report
