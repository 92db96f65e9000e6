#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "clients/haptic/servo_loop.h"
#include "clients/haptic/station.h"
#include "idl/threads/clock.h"
#include "idl/threads/cyclic_thread.h"

namespace tenon::haptic {

/// The thread of a station's loop: a cycle each millisecond, by the clock, or by the readings of a device
/// that paces (devices::HapticDevice::paces). A device that is silent for 3 ms leaves it to the clock until
/// it has a reading again. No cycle begins within 0.75 ms of the last one.
///
/// Threads: one (wire), which starts the other one (servo). Real-time: the loop.
class ServoThread {
 public:
  /// `wake` as that of ServoLoop. `station` outlives this. `real_time`: with SCHED_FIFO.
  ServoThread(Station& station, std::function<void()> wake, bool real_time,
              std::shared_ptr<threads::Clock> clock = std::make_shared<threads::SteadyClock>())
      : station_(station),
        clock_(std::move(clock)),
        loop_(station, std::move(wake), clock_),
        real_time_(real_time) {}

  [[nodiscard]] ServoLoop& loop() noexcept { return loop_; }
  void start();
  /// The last cycles take the forces away; with `disarms` the devices are off. Before anything that may
  /// block: a device holds its last command.
  void stop(bool disarms);
  /// CyclicThread's. Precondition: it runs.
  [[nodiscard]] const std::string& notGranted() const { return thread_->notGranted(); }
  /// Likewise.
  [[nodiscard]] std::uint64_t lateCycles() const { return thread_->lateTicks(); }

 private:
  Station& station_;
  std::shared_ptr<threads::Clock> clock_;
  ServoLoop loop_;
  bool real_time_;
  std::optional<threads::CyclicThread> thread_;
};

}  // namespace tenon::haptic
