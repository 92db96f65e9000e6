#include "devices/simulated/vibrotac.h"

#include <utility>

namespace tenon::devices {

Vibrotac::Vibrotac(std::string serial) {
  caps_.model = "VibroTac (simulated)";
  caps_.serial = std::move(serial);
  caps_.rate = 1000.0 / kTicksPerCommand;
  caps_.tactors = 6;
}

Result<void> Vibrotac::arm() {
  if (state_.fault != DeviceFault::kNone)
    return fail(caps_.model + ": cannot be armed after a fault (" + toString(state_.fault) +
                "), an operator resets it first");
  if (!state_.forces_on) ticks_since_write_ = 0;
  state_.forces_on = true;
  return {};
}

void Vibrotac::disarm() noexcept {
  state_.forces_on = false;
  requested_.fill(0);
}

Result<void> Vibrotac::resetFault() {
  state_.fault = DeviceFault::kNone;
  return {};
}

void Vibrotac::read(DeviceState& state) noexcept {
  ++state_.seq;
  if (state_.forces_on && ++ticks_since_write_ > kWatchdog) {
    disarm();
    state_.fault = DeviceFault::kStale;
  }
  if (ticks_to_send_ == 0) {
    sent_ = requested_;
    ticks_to_send_ = kTicksPerCommand;
  }
  --ticks_to_send_;
  // each motor spins up and down as a first-order lag
  for (std::size_t i = 0; i < amplitude_.size(); ++i)
    amplitude_[i] += (sent_[i] / 255.0 - amplitude_[i]) * (1e-3 / kSpinUp);
  state = state_;
}

void Vibrotac::write(const DeviceCommand& command) noexcept {
  if (!state_.forces_on) return;
  ticks_since_write_ = 0;
  requested_ = command.tactors;
}

}  // namespace tenon::devices
