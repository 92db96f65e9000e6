#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <set>
#include <vector>

#include "clients/haptic/station.h"

namespace tenon::haptic {

/// The hands of a station at which contacts are not felt, since its link is too long (kGuidanceAlone). The
/// link is that of all hands: it is told as too long with the first one, as short enough with the last one.
///
/// Threads: one. Real-time: no.
class FarHands {
 public:
  /// Whether `event` is to be told; all of other kinds are.
  [[nodiscard]] bool passes(const StationEvent& event) {
    if (event.kind == StationEventKind::kGuidanceAlone)
      return hands_.insert(event.hand).second && hands_.size() == 1;
    if (event.kind == StationEventKind::kContactsAgain)
      return hands_.erase(event.hand) == 1 && hands_.empty();
    return true;
  }
  /// The hands are others.
  void clear() { hands_.clear(); }
  [[nodiscard]] bool any() const { return !hands_.empty(); }

 private:
  std::set<HandId> hands_;
};

/// Events of a station that may happen many times a second: of each kind and hand at most one a second is
/// sent, with the number of times. The first one passes at once. All others pass always.
///
/// What readers keep of a client's events for late joiners is bounded, so events that repeat would displace
/// those that they need.
///
/// Threads: one. Real-time: no.
class RepeatedEvents {
 public:
  /// Whether `event` is to be sent now; else it waits.
  [[nodiscard]] bool passes(const StationEvent& event) {
    if (!repeats(event.kind)) return true;
    for (Known& known : known_) {
      if (known.last.kind != event.kind || known.last.hand != event.hand) continue;
      const std::uint32_t waiting = known.last.count + 1;
      if (waiting == 1 && isDue(known, event.seq)) {
        known.sent = event.seq;
        return true;
      }
      known.last = event;
      known.last.count = waiting;
      return false;
    }
    known_.push_back({event, event.seq});
    known_.back().last.count = 0;
    return true;
  }

  /// Takes an event whose second is over at step `seq` of the station, the newest one of those that waited.
  [[nodiscard]] std::optional<StationEvent> takeDue(std::uint32_t seq) {
    return takeIf([&](const Known& known) { return isDue(known, seq); }, seq);
  }
  /// Takes one that waits, at the end.
  [[nodiscard]] std::optional<StationEvent> takeWaiting() {
    return takeIf([](const Known&) { return true; }, 0);
  }

 private:
  struct Known {
    StationEvent last;       ///< the newest one that waits; count: how many do
    std::uint32_t sent = 0;  ///< [step] of the station
  };

  static constexpr std::int32_t kInterval = 1000;  // [steps] of a millisecond

  static bool repeats(StationEventKind kind) {
    return kind == StationEventKind::kBeyondValidity || kind == StationEventKind::kStale ||
           kind == StationEventKind::kIndexingBegan || kind == StationEventKind::kIndexingEnded;
  }
  /// Steps that begin anew are far from those before; `seq` may be a few steps before the newest event.
  static bool isDue(const Known& known, std::uint32_t seq) {
    return std::abs(static_cast<std::int32_t>(seq - known.sent)) >= kInterval;
  }

  template <class Condition>
  std::optional<StationEvent> takeIf(Condition is_wanted, std::uint32_t seq) {
    const auto found = std::find_if(known_.begin(), known_.end(), [&](const Known& known) {
      return known.last.count > 0 && is_wanted(known);
    });
    if (found == known_.end()) return std::nullopt;
    const StationEvent event = found->last;
    found->last.count = 0;
    found->sent = seq;
    return event;
  }

  std::vector<Known> known_;
};

}  // namespace tenon::haptic
