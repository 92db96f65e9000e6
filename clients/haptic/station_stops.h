#pragma once

#include <functional>
#include <string>
#include <utility>

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

  /// `link` must outlive this; `to_continue` is said when the stop is cleared: what the person at the station
  /// does next. Empty: nothing.
  StationStops(StationLink& link, Callbacks callbacks, std::string to_continue)
      : link_(link), callbacks_(std::move(callbacks)), to_continue_(std::move(to_continue)) {}

  [[nodiscard]] Result<void> subscribe();

 private:
  void raise(const EmergencyStop& stop);
  void clear(const EmergencyClear& cleared);
  void say(const std::string& text);
  void tell() const { callbacks_.changed({truth_.raised(), truth_.engaged()}); }

  StationLink& link_;
  Callbacks callbacks_;
  std::string to_continue_;
  StopTruth truth_;
  std::string said_;  ///< the last line
};

}  // namespace tenon::haptic
