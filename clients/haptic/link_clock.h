#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "clients/haptic/clock_offset.h"
#include "idl/types/messages/timing.h"

namespace tenon::haptic {

/// A station's side of ClockSync: when to ask, and what the answers say of clock and link.
///
/// Threads: one (wire). Real-time: everything.
class LinkClock {
 public:
  /// Whether a request is due at `now_ns`, and if so its content.
  [[nodiscard]] bool ask(ClientId client, std::int64_t now_ns, ClockSync& request) noexcept;
  /// `inputs` samples of DeviceInput with this seq were sent.
  void sent(std::uint32_t seq, std::uint32_t inputs) noexcept;
  /// An answer of the server, at `now_ns`.
  void receive(const ClockSync& answer, std::int64_t now_ns) noexcept;
  /// The server or the seat was gone for a while: inputs of that while are no loss of the link.
  void interrupted() noexcept { since_.reset(); }
  /// Whether the loss of inputs has been counted once.
  [[nodiscard]] bool lossKnown() const noexcept { return loss_known_; }
  /// Sets the fields of `telemetry` that are measured here.
  void fill(Telemetry& telemetry, std::int64_t now_ns) const noexcept;

 private:
  static constexpr std::int64_t kInterval = 200'000'000;      // [ns]
  static constexpr std::int64_t kFirstInterval = 20'000'000;  // [ns] of the first kFirst
  static constexpr std::uint32_t kFirst = 30;                 // so the link is known within a second
  // inputs between two statements of their loss: a thousandth shows
  static constexpr std::uint32_t kInputs = 2000;
  static constexpr std::uint32_t kFirstInputs = 400;  // until the first one: rates follow from it

  // a longer time between two inputs at the server is an interruption
  static constexpr double kInterruption = 0.3;  // [s]

  static constexpr std::size_t kRing = 16384;
  struct Sent {
    std::uint32_t seq = 0;
    std::uint32_t inputs = 0;  // with this seq and before
  };

  ClockOffset offset_;
  std::array<Sent, kRing> sent_{};  // by seq modulo its size
  std::uint32_t inputs_ = 0;        // sent
  std::int64_t asked_ = 0;          // [ns]
  std::uint32_t requests_ = 0;
  std::optional<Sent> since_;  // from which on losses are counted
  ClockSync answer_since_;     // of that moment
  double inputs_lost_ = 0.0, inputs_replaced_ = 0.0, ticks_without_input_ = 0.0;  // [-]
  bool loss_known_ = false;
  double input_gap_ = 0.0;  // [s]
};

}  // namespace tenon::haptic
