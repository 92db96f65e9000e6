#include "clients/haptic/station_stops.h"

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
  if (change.superseded)
    static_cast<void>(link_.withdraw({change.superseded->client_guid, change.superseded->counter, {}, {}}));
  callbacks_.print("emergency stop by " + stop.who + ": " + stop.reason);
  static_cast<void>(link_.send(stop));
}

void StationStops::clear(const EmergencyClear& cleared) {
  const auto raise = truth_.standing().find({cleared.client_guid, cleared.counter});
  const bool stood = raise != truth_.standing().end();
  if (stood) static_cast<void>(link_.withdraw(raise->second));
  truth_.clear(cleared);
  if (!stood) return;
  tell();
  callbacks_.print("emergency stop cleared by " + cleared.who + ": " + cleared.reason);
  if (!truth_.engaged() && reads_keys_) callbacks_.print("press return to continue at this station");
}

}  // namespace tenon::haptic
