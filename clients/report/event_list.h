#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "clients/report/session_analysis.h"

namespace tenon::report {

/// An event as a report lists it.
struct ReportEvent {
  SessionEvent event;
  std::string_view tone;  ///< how it is marked in plots: good, warn or bad; empty: not at all
  int more = 0;           ///< events of its kind that followed, each within 10 s of the one before
  double until = 0.0;     ///< [s] time of the last of them
};

/// The events about people, steps, mounts and safety, and all errors, in their order. A safety layer may act
/// many times a second: an event that follows one of its kind within 10 s is counted there.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::vector<ReportEvent> listedEvents(const std::vector<SessionEvent>& events);

/// Number of events that listedEvents() leaves out, by kind.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::map<std::string, int> otherEvents(const std::vector<SessionEvent>& events);

}  // namespace tenon::report
