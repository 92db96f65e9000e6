#pragma once

#include <memory>
#include <vector>

#include "idl/threads/latest.h"
#include "idl/threads/spsc_queue.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Passes inputs from the wire thread to the tick: the newest reading of each hand and every change, in
/// order.
///
/// Threads: one writer (wire: put, freeChanges), one reader (tick: collect). Real-time: all but construction.
class InputBuffer {
 public:
  static constexpr std::size_t kChanges = 256;  ///< that wait for ticks, at most

  /// `hands`: number of hands of the scenario.
  explicit InputBuffer(std::size_t hands)
      : readings_(std::make_unique<threads::Latest<HandReading>[]>(hands)), hands_(hands) {}

  /// Replaces a reading that no tick has consumed yet; `reading.hand` must be below the number of hands.
  void put(const HandReading& reading) noexcept { readings_[reading.hand.value].write(reading); }
  /// False, and the change is dropped, when the queue is full because the tick has fallen behind.
  bool put(const Change& change) noexcept { return changes_.push(change); }
  /// Changes that put() accepts before the queue is full.
  [[nodiscard]] std::size_t freeChanges() const noexcept { return changes_.capacity() - changes_.size(); }

  /// Fills the input of `tick`: readings newer than those of the tick before and up to kMaxChanges changes;
  /// the rest waits for the next tick.
  void collect(Tick tick, TickInput& input) noexcept {
    input.tick = tick;
    input.readings.clear();
    input.changes.clear();
    for (std::size_t i = 0; i < hands_; ++i)
      if (readings_[i].update()) input.readings.push_back(readings_[i].value());
    for (Change* change = changes_.front(); change != nullptr; change = changes_.front()) {
      if (!input.changes.push_back(*change)) return;
      changes_.pop();
    }
  }

 private:
  std::unique_ptr<threads::Latest<HandReading>[]> readings_;
  std::size_t hands_;
  threads::SpscQueue<Change> changes_{kChanges};
};

}  // namespace tenon::session
