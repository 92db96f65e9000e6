#include "clients/haptic/bracelet.h"

namespace tenon::haptic {

Bracelet::Bracelet(devices::HapticDevice& device, const TactileOptions& options)
    : device_(device), safety_(device.caps()), map_(options) {}

void Bracelet::begin(HandId forearm, bool armed) {
  contacts_ = {};
  contacts_.hand = forearm;
  answers_ = {};
  permitted_ = armed;
  finishing_ = false;
  if (armed) return handover_.askWithoutReset();
  device_.disarm();
}

void Bracelet::receive(const HandManifold& manifold) noexcept {
  if (manifold.hand == contacts_.hand && manifold.tick >= contacts_.tick) contacts_ = manifold;
}

void Bracelet::permit(bool permitted) noexcept {
  const bool runs = permitted_ && forces_on_ && !safety_.wantsDisarm();
  permitted_ = permitted;
  if (!permitted) handover_.withdraw();
  if (!permitted || runs || finishing_) return;
  safety_.reset();
  handover_.ask();
}

void Bracelet::finish(bool disarms) noexcept {
  finishing_ = true;
  finish_disarms_ = disarms;
  if (disarms) handover_.withdraw();
}

void Bracelet::step(std::uint32_t seq, double dt) noexcept {
  answers_.step(seq, contacts_.answers_seq, dt);
  if (handover_.pending()) return intensities_.fill(0);
  devices::DeviceState state;
  device_.read(state);
  forces_on_ = state.forces_on;
  devices::SafetyRequest request;
  request.requested.tactors = map_.step(contacts_, dt);
  request.age = answers_.excess();
  request.restart = finishing_;  // silent
  request.emergency_stop = !permitted_;
  const devices::DeviceCommand command = safety_.step(request, state, dt);
  device_.write(command);
  if (safety_.wantsDisarm() || (finishing_ && finish_disarms_)) device_.disarm();
  intensities_ = command.tactors;
}

}  // namespace tenon::haptic
