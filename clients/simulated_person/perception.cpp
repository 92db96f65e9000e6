#include "clients/simulated_person/perception.h"

namespace tenon::simulated_person {

void DelayedPerception::begin(std::size_t objects, unsigned delay_ticks) {
  objects_ = objects;
  delay_ = delay_ticks > 0 ? delay_ticks : 1;
  history_.assign(objects_ * delay_, Pose());
  records_ = 0;
}

void DelayedPerception::record(const haptic::WorldView& world) noexcept {
  const std::size_t scene = records_ % delay_;
  for (std::size_t i = 0; i < objects_ && i < world.size(); ++i) {
    const Pose& X_WO = world.object(ObjectId{static_cast<std::uint32_t>(i)}).X_WO;
    history_[scene * objects_ + i] = X_WO;
    // the first scene fills the whole ring: pose() returns it until the first delay has passed
    if (records_ == 0) {
      for (std::size_t k = 1; k < delay_; ++k) history_[k * objects_ + i] = X_WO;
    }
  }
  ++records_;
}

const Pose& DelayedPerception::pose(ObjectId object) const noexcept {
  return history_[(records_ % delay_) * objects_ + object.value];
}

}  // namespace tenon::simulated_person
