#include "clients/haptic/station_events.h"

namespace tenon::haptic {

void StationEvents::sendDevices() {
  const Welcome& welcome = link_.welcome();
  for (const HandDevice& device : station_.handDevices())
    static_cast<void>(
        link_.send(ClientEvent{welcome.client, ++seq_, welcome.tick, "device", describe(device)}));
  devices_seq_ = seq_;
}

/// Of a client's events late joiners get the last ones alone: its devices are always among them.
void StationEvents::send(Tick tick, const char* kind, const std::string& text) {
  if (seq_ - devices_seq_ >= wire::kClientEvent.parameters.late_joiner_depth / 2) sendDevices();
  static_cast<void>(link_.send(ClientEvent{link_.welcome().client, ++seq_, tick, kind, text}));
}

void StationEvents::send(const StationEvent& event) {
  const std::string text = station_.describe(event);
  const bool is_safety =
      event.kind == StationEventKind::kSafetyBegan || event.kind == StationEventKind::kSafetyEnded;
  send(event.tick, is_safety ? "safety" : "station", text);
  if (event.kind == StationEventKind::kGuidanceBegan || event.kind == StationEventKind::kGuidanceEnded ||
      event.kind == StationEventKind::kGuidanceAlone || event.kind == StationEventKind::kContactsAgain)
    print_(text);
  if (event.kind != StationEventKind::kDeviceFault) return;
  print_(text + (reads_keys_ ? "; look at the device, then press return to reset it" : ""));
}

}  // namespace tenon::haptic
