#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

// What a copy of another Environment does with what it hears of that one.

namespace tenon::simulation {

void Environment::follow(ObjectId object, const Pose& X_WO, const Twist& V_WO) noexcept {
  if (!isObject(object) || !X_WO.isFinite() || isPulled(object) || isDynamic(object)) return;
  ObjectMotion& motion = objects_[object.value];
  if (motion.X_WO == X_WO) {
    motion.V_WO = V_WO;
    return;
  }
  engine_->addPathLength(object, displacement(motion.X_WO, X_WO, centreOf(object)));
  motion.X_WO = X_WO;
  motion.V_WO = V_WO;
  // due ticks count on objects without a hand to stand still
  markDirty(object);
}

void Environment::correct(ObjectId object, const Pose& X_WO, const Twist& V_WO) noexcept {
  if (!isObject(object) || !X_WO.isFinite() || objects_[object.value].status != ObjectStatus::kFree) return;
  wake(object);
  ObjectMotion& motion = objects_[object.value];
  engine_->addPathLength(object, displacement(motion.X_WO, X_WO, centreOf(object)));
  motion.X_WO = X_WO;
  motion.V_WO = V_WO;
  markDirty(object);
}

void Environment::hold(HandId hand, ObjectId object, const Pose& X_HO, const Pose& X_WO) noexcept {
  if (!isHand(hand) || !isObject(object) || !X_HO.isFinite() || !X_WO.isFinite()) return;
  attachAt(hand, object, X_HO, X_WO);
  objects_[object.value].X_WO = X_WO;
  objects_[object.value].emerging = true;
  beginEpoch(object);
}

void Environment::grasp(HandId hand, ObjectId object, const Pose& X_HO) noexcept {
  if (!isHand(hand) || !isObject(object) || !X_HO.isFinite()) return;
  const Pose X_WO = objects_[object.value].X_WO;
  if (objects_[object.value].status == ObjectStatus::kHidden) return hold(hand, object, X_HO, X_WO);
  attachAt(hand, object, X_HO, X_WO);
}

/// The hand holds the object with X_HO, and would have it at X_WO.
void Environment::attachAt(HandId hand, ObjectId object, const Pose& X_HO, const Pose& X_WO) noexcept {
  HandMotion& motion = hands_[hand.value];
  if (motion.object != object) detachHand(hand);
  motion.object = object;
  motion.present = motion.has_pose = motion.attached = true;
  motion.frozen = false;
  motion.X_HO = X_HO;
  motion.X_WH = motion.X_WH_before = X_WO * X_HO.inverse();
  motion.V_WH = Twist{};
  objects_[object.value].status = ObjectStatus::kHeld;
  updateHolder(object);
}

}  // namespace tenon::simulation
