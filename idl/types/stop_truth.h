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
  /// Raises of too many clients stand: this one is not kept, and is cleared by this.
  std::optional<EmergencyClear> superfluous;
  /// A raise that stands no more: it is cleared, or a later one of its client stands.
  std::optional<EmergencyStop> ended;
  /// A clear that is not remembered any more: a later one of its client is, or there are too many.
  std::optional<EmergencyClear> forgotten;

  explicit operator bool() const { return changed; }
};

/// Which raises of the emergency stop stand: of each client the newest one, unless a clear names it or a
/// later one of that client.
///
/// A client counts its raises, so its newest raise and its newest clear say all: one that was cleared stays
/// so, however many came after it and however often it is repeated. The server, the clients and the stations
/// keep one each. They agree once they have heard the same messages, in whatever order, however often, and
/// whatever clocks say: a clear that comes before its raise clears it too.
///
/// What is kept is bounded, for clients under ever new names. Beyond the bound a raise is counted and not
/// kept: the stop is engaged by those that stand, and who clears them has to know of the newest one
/// (NewestRaise). Beyond the bound of clears one is forgotten: its raise stands again if it is repeated.
/// Exceeding a bound can re-engage a cleared stop; it never lifts one. Beyond the bounds two programs may
/// differ for a while in which raises stand.
///
/// Threads: a value. Real-time: no.
class StopTruth {
 public:
  static constexpr std::size_t kMostClients = 1024;  ///< of whom a raise stands; of whom a clear is known

  /// True when this raise is new: it stands, or is superfluous beside those that do.
  StopChange raise(const EmergencyStop& stop);
  /// True when neither it nor a later one of its client was heard before.
  StopChange clear(const EmergencyClear& cleared);

  [[nodiscard]] bool engaged() const { return !standing_.empty(); }
  /// Whether this raise stands, or a later one of its client.
  [[nodiscard]] bool stands(const EmergencyStop& stop) const;
  /// Whether this raise was cleared, or a later one of its client.
  [[nodiscard]] bool wasCleared(const EmergencyStop& stop) const;
  /// The largest number that was heard of a client, in a raise or a clear that is known; 0: none.
  [[nodiscard]] std::uint32_t newestOf(const std::string& client_guid) const;
  /// How many raises were new so far.
  [[nodiscard]] std::uint32_t raised() const { return raised_; }
  /// By client: the newest raise, and the newest clear.
  [[nodiscard]] const std::map<std::string, EmergencyStop>& standing() const { return standing_; }
  [[nodiscard]] const std::map<std::string, EmergencyClear>& cleared() const { return cleared_; }

 private:
  std::map<std::string, EmergencyStop> standing_;
  std::map<std::string, EmergencyClear> cleared_;
  std::uint32_t raised_ = 0;
};

}  // namespace tenon
