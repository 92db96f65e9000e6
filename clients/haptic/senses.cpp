#include "clients/haptic/senses.h"

namespace tenon {

void DelayedSight::begin(std::size_t objects, unsigned delay_ticks) {
  objects_ = objects;
  delay_ = delay_ticks > 0 ? delay_ticks : 1;
  seen_.assign(objects_ * delay_, Pose());
  looks_ = 0;
}

void DelayedSight::look(const WorldView& world) noexcept {
  const std::size_t scene = looks_ % delay_;
  for (std::size_t i = 0; i < objects_ && i < world.size(); ++i) {
    const Pose& X_WO = world.object(ObjectId{static_cast<std::uint32_t>(i)}).X_WO;
    seen_[scene * objects_ + i] = X_WO;
    // before the first reaction she knows the scene as it was when she came
    if (looks_ == 0) {
      for (std::size_t k = 1; k < delay_; ++k) seen_[k * objects_ + i] = X_WO;
    }
  }
  ++looks_;
}

const Pose& DelayedSight::pose(ObjectId object) const noexcept {
  return seen_[(looks_ % delay_) * objects_ + object.value];
}

}  // namespace tenon
