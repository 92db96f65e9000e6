#pragma once

#include <functional>
#include <string>

#include "clients/haptic/station.h"
#include "clients/haptic/station_link.h"
#include "idl/types/stop_truth.h"

namespace tenon::haptic {

/// The emergency stop at a station: raises are heard from anybody, without a server too, clears from the
/// server of this station alone. The station repeats each raise that it obeys, so that a server that hung or
/// starts anew hears of it.
///
/// Threads: one (wire). Real-time: no.
class StationStops {
 public:
  struct Callbacks {
    std::function<void(const StopSignal&)> changed;
    std::function<void(const std::string&)> print;
  };

  /// `link` must outlive this; `reads_keys`: who is at the station continues it by the return key.
  StationStops(StationLink& link, Callbacks callbacks, bool reads_keys)
      : link_(link), callbacks_(std::move(callbacks)), reads_keys_(reads_keys) {}

  [[nodiscard]] Result<void> subscribe();

 private:
  void raise(const EmergencyStop& stop);
  void clear(const EmergencyClear& cleared);
  void say(const std::string& text);
  void tell() const { callbacks_.changed({truth_.raised(), truth_.engaged()}); }

  StationLink& link_;
  Callbacks callbacks_;
  bool reads_keys_ = false;
  StopTruth truth_;
  std::string said_;  ///< the last line
};

}  // namespace tenon::haptic
