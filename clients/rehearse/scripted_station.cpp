#include "clients/rehearse/scripted_station.h"

#include "clients/rehearse/rehearsal.h"

namespace tenon::rehearse {

void ScriptedStation::step(std::uint32_t seq) noexcept {
  inputs_.clear();
  if (hands().empty()) return;
  const Pose X_WH = trajectory_.poseAt(secondsAt(seq));
  const Displacement moved = displacement(trajectory_.poseAt(secondsAt(seq - 1)), X_WH);
  DeviceInput input;
  input.hand = hands().front();
  input.client = client_;
  input.server_epoch = world_.serverEpoch();
  input.active = true;
  input.sample = {seq, X_WH, {moved.translation / kTickSeconds, moved.rotation / kTickSeconds}, 0};
  inputs_.push_back(input);
}

}  // namespace tenon::rehearse
