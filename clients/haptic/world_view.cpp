#include "clients/haptic/world_view.h"

#include <algorithm>

namespace tenon::haptic {

void WorldView::begin(std::span<const SceneObject> objects, std::uint32_t server_epoch, Tick tick) {
  std::size_t count = 0;
  for (const SceneObject& object : objects) {
    if (object.object.valid()) count = std::max<std::size_t>(count, object.object.value + 1);
  }
  objects_.assign(count, ObservedObject{});
  for (const SceneObject& object : objects) {
    if (!object.object.valid()) continue;
    ObservedObject& observed = objects_[object.object.value];
    observed.X_WO = object.X_WO;
    observed.p_OQ_O = object.centre;
    observed.radius = 0.5 * object.size.norm();
  }
  server_epoch_ = server_epoch;
  tick_ = tick;
}

bool WorldView::receive(const WorldFrame& frame) noexcept {
  if (frame.server_epoch < server_epoch_) return false;
  if (frame.server_epoch > server_epoch_) {
    server_epoch_ = frame.server_epoch;
    tick_ = 0;
    for (ObservedObject& object : objects_) object.updated_at = object.jumped_at = 0;
  }
  tick_ = std::max(tick_, frame.tick);
  for (const ObjectState& state : frame.states) {
    if (!contains(state.object) || !state.X_WO.isFinite()) continue;
    ObservedObject& object = objects_[state.object.value];
    if (object.updated_at > frame.tick) continue;
    object.X_WO = state.X_WO;
    object.V_WO = {state.V_WO.head<3>().cast<double>(), state.V_WO.tail<3>().cast<double>()};
    if (object.updated_at > 0 && object.epoch != state.epoch) object.jumped_at = frame.tick;
    object.epoch = state.epoch;
    object.status = static_cast<ObjectStatus>(state.status);
    object.holder = state.holder;
    object.in_contact = state.in_contact;
    object.updated_at = frame.tick;
  }
  return true;
}

}  // namespace tenon::haptic
