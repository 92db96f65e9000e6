#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "clients/haptic/repeated_events.h"
#include "clients/haptic/station.h"
#include "clients/haptic/station_link.h"

namespace tenon::haptic {

/// What a station tells the session of itself: its devices, and the events of its steps. Who sits at the
/// station is told of those that ask for something.
///
/// Threads: one (wire). Real-time: no.
class StationEvents {
 public:
  /// `station` and `link` must outlive this. `reads_keys`: a fault is reset by the return key.
  StationEvents(const Station& station, StationLink& link, std::function<void(const std::string&)> print,
                bool reads_keys)
      : station_(station), link_(link), print_(std::move(print)), reads_keys_(reads_keys) {}

  /// Others see what a hand can reach by this and HandState::p_WC.
  void sendDevices();
  void send(Tick tick, const char* kind, const std::string& text);
  /// Of a step of the station: now, or later if it repeats.
  void receive(const StationEvent& event) {
    if (repeated_.passes(event) && far_hands_.passes(event)) send(event);
  }
  /// The station has new hands: what was told of the link is to be told of them.
  void restart() { far_hands_.clear(); }
  /// Contacts are not felt at one of the hands, since the link is too long
  /// (StationEventKind::kGuidanceAlone).
  [[nodiscard]] bool guidanceAlone() const { return far_hands_.any(); }
  /// Those that repeat and are due at step `seq` of the station.
  void sendDue(std::uint32_t seq) {
    while (const auto repeated = repeated_.takeDue(seq)) send(*repeated);
  }
  /// All that wait, at the end.
  void sendWaiting() {
    while (const auto repeated = repeated_.takeWaiting()) send(*repeated);
  }

 private:
  void send(const StationEvent& event);

  const Station& station_;
  StationLink& link_;
  std::function<void(const std::string&)> print_;
  bool reads_keys_ = false;
  RepeatedEvents repeated_;
  FarHands far_hands_;
  std::uint64_t seq_ = 0;
  std::uint64_t devices_seq_ = 0;  ///< of the last event that names a device
};

}  // namespace tenon::haptic
