#include "clients/haptic/station_stops.h"

#include "idl/types/printable_text.h"

namespace tenon::haptic {

Result<void> StationStops::subscribe() {
  wire::Partition& session = link_.member().session();
  wire::Inbox& inbox = link_.inbox();
  auto heard = inbox.on<EmergencyStop>(session, wire::kEmergencyStop,
                                       [this](const EmergencyStop& stop) { raise(stop); });
  if (!heard) return heard;
  return inbox.on<EmergencyClear>(session, wire::kEmergencyClear,
                                  [this](const EmergencyClear& cleared) { clear(cleared); });
}

void StationStops::raise(const EmergencyStop& stop) {
  const StopChange change = truth_.raise(stop);
  if (!change) return;
  tell();
  if (change.superfluous) return;
  say("emergency stop by " + stop.who + (stop.reason.empty() ? "" : ": " + stop.reason));
  static_cast<void>(link_.send(stop));
  if (change.ended) static_cast<void>(link_.withdraw(*change.ended));
}

/// Of who raises or clears many, once.
void StationStops::say(const std::string& text) {
  if (text != said_) callbacks_.print(printable(text));
  said_ = text;
}

void StationStops::clear(const EmergencyClear& cleared) {
  const StopChange change = truth_.clear(cleared);
  if (!change.ended) return;
  static_cast<void>(link_.withdraw(*change.ended));
  tell();
  say("emergency stop cleared by " + cleared.who + (cleared.reason.empty() ? "" : ": " + cleared.reason));
  if (!truth_.engaged() && !to_continue_.empty()) callbacks_.print(to_continue_);
}

}  // namespace tenon::haptic
