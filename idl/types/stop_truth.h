#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "idl/types/messages/run.h"

namespace tenon {

/// The name of one raise of the emergency stop.
struct RaiseId {
  std::string client_guid;
  std::uint32_t counter = 0;

  auto operator<=>(const RaiseId&) const = default;
};

/// What a message has changed in a StopTruth.
struct StopChange {
  bool changed = false;                      ///< it said something new
  std::optional<EmergencyClear> superseded;  ///< ended because too many raises stand: cleared by this
  std::optional<RaiseId> forgotten;          ///< a clear that is not remembered any more

  explicit operator bool() const { return changed; }
};

/// Which raises of the emergency stop stand: those that were heard and that no clear names.
///
/// The server, the clients and the stations keep one each. They agree once they have heard the same messages,
/// in whatever order, however often, and whatever clocks say: a clear that comes before its raise clears it
/// too.
///
/// What is kept is bounded, for a client that raises without end, or under ever new names. Beyond a bound the
/// newest raise stands and an older one ends in its favour: the stop is engaged as before, and ends only when
/// all that stand are cleared. Beyond the bounds of clears one is forgotten: its raise stands again if it is
/// repeated. So a bound engages a stop, at worst, that was cleared before, and lifts none; beyond the bounds
/// two programs may differ for a while in which raises stand.
///
/// Threads: a value. Real-time: no.
class StopTruth {
 public:
  static constexpr std::size_t kMostOfClient = 64;  ///< raises of a client that stand; clears likewise
  static constexpr std::size_t kMostInAll = 1024;   ///< likewise, of all clients

  /// True when this raise now stands and did not before.
  StopChange raise(const EmergencyStop& stop);
  /// True when it was not cleared before.
  StopChange clear(const EmergencyClear& cleared);

  [[nodiscard]] bool engaged() const { return !standing_.empty(); }
  /// How many raises have come to stand so far.
  [[nodiscard]] std::uint32_t raised() const { return raised_; }
  [[nodiscard]] const std::map<RaiseId, EmergencyStop>& standing() const { return standing_; }
  [[nodiscard]] const std::map<RaiseId, EmergencyClear>& cleared() const { return cleared_; }

 private:
  std::map<RaiseId, EmergencyStop> standing_;
  std::map<RaiseId, EmergencyClear> cleared_;
  std::uint32_t raised_ = 0;
};

}  // namespace tenon
