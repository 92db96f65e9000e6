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
  say("emergency stop by " + stop.who + ": " + stop.reason);
  static_cast<void>(link_.send(stop));
}

/// Of who raises or clears many, once.
void StationStops::say(const std::string& text) {
  if (text != said_) callbacks_.print(printable(text));
  said_ = text;
}

void StationStops::clear(const EmergencyClear& cleared) {
  const auto raise = truth_.standing().find({cleared.client_guid, cleared.counter});
  const bool stood = raise != truth_.standing().end();
  if (stood) static_cast<void>(link_.withdraw(raise->second));
  truth_.clear(cleared);
  if (!stood) return;
  tell();
  say("emergency stop cleared by " + cleared.who + ": " + cleared.reason);
  if (!truth_.engaged() && reads_keys_) callbacks_.print("press return to continue at this station");
}

}  // namespace tenon::haptic
