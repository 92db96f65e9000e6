#pragma once

#include <algorithm>
#include <iterator>
#include <map>

#include "idl/types/messages/run.h"

namespace tenon {

/// The time of steps, as their time limits are counted: it stands in pauses and while an emergency stop
/// stands, and runs while forces are frozen.
///
/// Threads: one at a time. Real-time: no.
class StepClock {
 public:
  /// In the order in which they were published. A resumed server may go back in time.
  void add(const RunState& run) {
    goes_.erase(goes_.upper_bound(run.tick), goes_.end());
    goes_[run.tick] = run.phase == RunPhase::kRunning && !run.emergency_stop;
  }
  /// [ticks] of those after `begin` up to `end`. Before the first state that is known it goes.
  [[nodiscard]] Tick between(Tick begin, Tick end) const {
    Tick time = 0;
    for (Tick from = begin + 1; from <= end;) {
      const auto next = goes_.upper_bound(from);
      const Tick until = next == goes_.end() ? end : std::min(end, next->first - 1);
      if (next == goes_.begin() || std::prev(next)->second) time += until - from + 1;
      from = until + 1;
    }
    return time;
  }

 private:
  std::map<Tick, bool> goes_;  ///< from this tick on
};

}  // namespace tenon
