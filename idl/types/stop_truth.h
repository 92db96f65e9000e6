#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "idl/types/messages/run.h"

namespace tenon {

/// What a message has changed in a StopTruth.
struct StopChange {
  bool changed = false;  ///< it said something new
  /// Too many raises stand: this one is not kept, and is cleared by this.
  std::optional<EmergencyClear> superfluous;
  std::optional<RaiseId> forgotten;  ///< a clear that is not remembered any more

  explicit operator bool() const { return changed; }
};

/// Which raises of the emergency stop stand: those that were heard and that no clear names.
///
/// The server, the clients and the stations keep one each. They agree once they have heard the same messages,
/// in whatever order, however often, and whatever clocks say: a clear that comes before its raise clears it
/// too.
///
/// What is kept is bounded, for a client that raises without end, or under ever new names. Beyond a bound a
/// raise is counted and not kept: the stop is engaged by those that stand, and who clears them has to know of
/// the newest one (NewestRaise). Beyond the bounds of clears one is forgotten: its raise stands again if it
/// is repeated. So a bound engages a stop, at worst, that was cleared before, and lifts none; beyond the
/// bounds two programs may differ for a while in which raises stand.
///
/// Threads: a value. Real-time: no.
class StopTruth {
 public:
  static constexpr std::size_t kMostOfClient = 64;  ///< raises of a client that stand; clears likewise
  static constexpr std::size_t kMostInAll = 1024;   ///< likewise, of all clients

  /// True when this raise is new: it stands, or is superfluous beside those that do.
  StopChange raise(const EmergencyStop& stop);
  /// True when it was not cleared before.
  StopChange clear(const EmergencyClear& cleared);

  [[nodiscard]] bool engaged() const { return !standing_.empty(); }
  /// How many raises were new so far.
  [[nodiscard]] std::uint32_t raised() const { return raised_; }
  [[nodiscard]] const std::map<RaiseId, EmergencyStop>& standing() const { return standing_; }
  [[nodiscard]] const std::map<RaiseId, EmergencyClear>& cleared() const { return cleared_; }

 private:
  std::map<RaiseId, EmergencyStop> standing_;
  std::map<RaiseId, EmergencyClear> cleared_;
  std::uint32_t raised_ = 0;
};

}  // namespace tenon
