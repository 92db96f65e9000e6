#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <string>

#include "idl/types/messages/run.h"

namespace tenon {

/// The name of one raise of the emergency stop.
struct RaiseId {
  std::string client_guid;
  std::uint32_t counter = 0;

  auto operator<=>(const RaiseId&) const = default;
};

/// Which raises of the emergency stop stand: those that were heard and that no clear names.
///
/// The server, the clients and the stations keep one each. They agree once they have heard the same messages,
/// in whatever order, however often, and whatever clocks say: a clear that comes before its raise clears it
/// too.
///
/// Threads: a value. Real-time: no.
class StopTruth {
 public:
  /// Whether this raise now stands and did not before.
  bool raise(const EmergencyStop& stop);
  /// Whether it was not cleared before.
  bool clear(const EmergencyClear& cleared);

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
