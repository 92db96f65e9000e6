#include "clients/haptic/bracelet.h"

namespace tenon::haptic {

Bracelet::Bracelet(devices::HapticDevice& device, const TactileOptions& options)
    : GuardedDevice(device), map_(options) {}

void Bracelet::begin(HandId forearm, bool armed) {
  contacts_ = {};
  contacts_.hand = forearm;
  answers_ = {};
  GuardedDevice::begin(armed, state_);
}

void Bracelet::receive(const HandManifold& manifold) noexcept {
  if (manifold.hand == contacts_.hand && manifold.tick >= contacts_.tick) contacts_ = manifold;
}

void Bracelet::permit(bool permitted) noexcept {
  stopped_ = !permitted;
  GuardedDevice::permit(permitted, state_.forces_on);
}

void Bracelet::step(std::uint32_t seq, double dt) noexcept {
  answers_.step(seq, contacts_.answers_seq, dt);
  if (handover_.pending()) return intensities_.fill(0);
  device_.read(state_);
  devices::SafetyRequest request;
  request.requested.tactors = map_.step(contacts_, dt);
  request.age = answers_.excess();
  request.restart = finishing_;  // silent
  request.armed = permitted_ || stopped_;
  request.emergency_stop = stopped_;
  const devices::DeviceCommand command = safety_.step(request, state_, dt);
  write(command, finishing_);
  intensities_ = command.tactors;
}

}  // namespace tenon::haptic
