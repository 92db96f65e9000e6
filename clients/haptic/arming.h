#pragma once

#include <cstdint>

namespace tenon::haptic {

/// What a station's wire thread has heard of the emergency stop (StopTruth).
struct StopSignal {
  std::uint32_t raised = 0;  ///< raises that came to stand so far
  bool engaged = false;      ///< one stands now
};

/// Whether a station's devices may display forces: its person has armed it, and no emergency stop holds it.
///
/// Arming is local: nothing on the bus arms a device. A raise stops the station until no raise stands any
/// more and the person at the station has pressed since, in either order.
///
/// Threads: a value. Real-time: yes.
class Arming {
 public:
  /// The person presses the button or key that arms.
  void press() noexcept {
    armed_ = true;
    pressed_ = true;
  }
  void receive(const StopSignal& stop) noexcept {
    if (stop.raised != raised_ || (stop.engaged && !engaged_)) {
      stopped_ = true;
      pressed_ = false;
    }
    raised_ = stop.raised;
    engaged_ = stop.engaged;
  }
  /// To be called after the above: true when the stop has ended by it.
  bool release() noexcept {
    if (!stopped_ || engaged_ || !pressed_) return false;
    stopped_ = false;
    return true;
  }
  [[nodiscard]] bool stopped() const noexcept { return stopped_; }
  /// A press is awaited: to arm, or to end a stop.
  [[nodiscard]] bool awaitsPress() const noexcept { return !armed_ || (stopped_ && !pressed_); }
  [[nodiscard]] bool permitsForces() const noexcept { return armed_ && !stopped_; }

 private:
  bool armed_ = false;
  bool stopped_ = false;
  bool pressed_ = false;  ///< since the last raise
  bool engaged_ = false;
  std::uint32_t raised_ = 0;
};

}  // namespace tenon::haptic
