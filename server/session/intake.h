#pragma once

#include <memory>
#include <vector>

#include "idl/threads/latest.h"
#include "idl/threads/spsc_queue.h"
#include "server/session/tick_io.h"

namespace tenon {

/// What has come in for the next tick: of each hand the newest reading, of changes every one.
///
/// Threads: one writer (wire: put), one reader (tick: collect). Real-time: all but construction.
class Intake {
 public:
  explicit Intake(std::size_t hands)
      : readings_(std::make_unique<Latest<HandReading>[]>(hands)), hands_(hands) {}

  void put(const HandReading& reading) noexcept { readings_[reading.hand.value].write(reading); }
  /// False when the tick has fallen so far behind that there is no room.
  bool put(const Change& change) noexcept { return changes_.push(change); }
  /// How many changes there is room for.
  [[nodiscard]] std::size_t room() const noexcept { return changes_.capacity() - changes_.size(); }

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
  std::unique_ptr<Latest<HandReading>[]> readings_;
  std::size_t hands_;
  SpscQueue<Change> changes_{256};
};

}  // namespace tenon
