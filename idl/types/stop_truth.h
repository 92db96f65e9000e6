#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/run.h"

namespace tenon {

/// What a message has changed in a StopTruth.
struct StopChange {
  bool changed = false;                      ///< it said something new
  std::optional<EmergencyClear> superseded;  ///< ended because too many raises stand: cleared by this
  std::optional<RaiseId> forgotten;          ///< a clear that is not remembered any more

  explicit operator bool() const { return changed; }
};

/// As few ranges as name these raises and no other ones. At most kMostRanges, as many as a clear takes:
/// raises beyond stand until the next clear.
[[nodiscard]] std::vector<RaiseRange> rangesOf(std::vector<RaiseId> raises);

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
