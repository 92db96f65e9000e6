#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon {
namespace {

/// No room is larger [m]; squares of much larger numbers leave the range of a double.
constexpr double kFarthest = 1e3;

bool isPose(const Pose& X) {
  constexpr double kUnitTolerance = 1e-3;
  if (!X.isFinite() || X.translation().cwiseAbs().maxCoeff() > kFarthest) return false;
  return std::abs(X.rotation().squaredNorm() - 1.0) < kUnitTolerance;
}

Pose normalized(const Pose& X) { return {X.translation(), X.rotation().normalized()}; }

bool isFinite(const Twist& V) { return V.linear.allFinite() && V.angular.allFinite(); }

}  // namespace

void Environment::setHandPresent(HandId hand, bool present) noexcept {
  if (!isHand(hand) || hands_[hand.value].present == present) return;
  HandMotion& motion = hands_[hand.value];
  motion.present = present;
  motion.posed = false;
  if (present) return;
  motion.taken = false;
  motion.F_Ho_W = Wrench{};
  motion.V_WH = Twist{};
  if (isObject(motion.object)) {
    engine_->forces[motion.object.value].clear(engine_->couplingCell(motion.object, hand));
    chooseHolder(motion.object);
    if (!objects_[motion.object.value].holder.valid()) park(motion.object, ObjectStatus::kParked);
  }
}

void Environment::setHandPose(HandId hand, const Pose& X_WH, const Twist& V_WH) noexcept {
  if (!isHand(hand)) return;
  HandMotion& motion = hands_[hand.value];
  if (!isPose(X_WH) || !isFinite(V_WH)) {
    ++motion.refused_poses;
    return;
  }
  motion.X_WH = normalized(X_WH);
  motion.V_WH = V_WH;
  if (!motion.present) return;
  motion.posed = true;
  if (!motion.taken && isObject(motion.object)) take(hand);
}

void Environment::setHandFrozen(HandId hand, bool frozen) noexcept {
  if (!isHand(hand) || hands_[hand.value].frozen == frozen) return;
  hands_[hand.value].frozen = frozen;
  const ObjectId object = hands_[hand.value].object;
  if (!isObject(object)) return;
  objects_[object.value].V_WO = Twist{};
  stir(object);
}

void Environment::grab(HandId hand, ObjectId object) noexcept {
  if (!isHand(hand) || !isObject(object)) return;
  HandMotion& motion = hands_[hand.value];
  if (motion.object == object && motion.taken) return;
  const Pose X_WR = returnPlace(motion);
  if (motion.object != object) letGo(hand);
  motion.object = object;
  if (!motion.present || !motion.posed) return;
  take(hand);
  motion.X_OR = objects_[object.value].X_WO.inverse() * X_WR;
}

void Environment::release(HandId hand) noexcept {
  if (!isHand(hand)) return;
  HandMotion& motion = hands_[hand.value];
  if (motion.object == motion.own) return;
  const Pose X_WR = returnPlace(motion);
  letGo(hand);
  if (!isObject(motion.own)) return;
  grab(hand, motion.own);
  // the hand is up to its coupling's stretch inside what it has held
  if (motion.taken && objects_[motion.own.value].holder == hand) objects_[motion.own.value].X_WO = X_WR;
}

void Environment::swapHands(HandId one, HandId other) noexcept {
  if (!isHand(one) || !isHand(other) || one == other) return;
  HandMotion& a = hands_[one.value];
  HandMotion& b = hands_[other.value];
  std::swap(a.object, b.object);
  std::swap(a.own, b.own);
  std::swap(a.X_HO, b.X_HO);
  std::swap(a.X_OR, b.X_OR);
  std::swap(a.taken, b.taken);
  for (const HandId hand : {one, other}) {
    HandMotion& motion = hands_[hand.value];
    if (!isObject(motion.object)) continue;
    const HandId former = hand == one ? other : one;
    engine_->forces[motion.object.value].clear(engine_->couplingCell(motion.object, former));
    motion.taken = motion.taken && motion.present && motion.posed;
    chooseHolder(motion.object);
    if (motion.taken) {
      objects_[motion.object.value].X_WO = motion.X_WH * motion.X_HO;
      jump(motion.object);
    } else if (!objects_[motion.object.value].holder.valid()) {
      park(motion.object, ObjectStatus::kParked);
    }
  }
}

void Environment::place(ObjectId object, const Pose& X_WO, ObjectStatus status) noexcept {
  if (!isObject(object) || !isPose(X_WO)) return;
  ObjectMotion& motion = objects_[object.value];
  motion.X_WO = normalized(X_WO);
  const bool stays = status == ObjectStatus::kHeld && motion.holder.valid();
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    HandMotion& hand = hands_[i];
    if (hand.object != object) continue;
    if (stays) {
      if (hand.taken) hand.X_HO = hand.X_WH.inverse() * motion.X_WO;
      continue;
    }
    engine_->forces[object.value].clear(engine_->couplingCell(object, {static_cast<std::uint32_t>(i)}));
    hand.object = ObjectId{};
    hand.taken = false;
    hand.F_Ho_W = Wrench{};
  }
  if (!stays) {
    motion.holder = HandId{};
    // only a hand makes an object held or tracked
    const bool needs_hand = status == ObjectStatus::kHeld || status == ObjectStatus::kTracked;
    const bool massless = status == ObjectStatus::kFree && !scene_->objects[object.value].body;
    motion.status = needs_hand || massless ? ObjectStatus::kParked : status;
  }
  jump(object);
}

/// The hand has given a pose and moves its object from here on.
void Environment::take(HandId hand) noexcept {
  HandMotion& motion = hands_[hand.value];
  ObjectMotion& object = objects_[motion.object.value];
  const bool own = motion.object == motion.own || object.status == ObjectStatus::kHidden;
  if (own && !object.holder.valid()) {
    motion.X_HO = Pose::Identity();
    object.X_WO = motion.X_WH;
  } else {
    motion.X_HO = motion.X_WH.inverse() * object.X_WO;
  }
  motion.X_OR = object.X_WO.inverse() * motion.X_WH;
  motion.taken = true;
  chooseHolder(motion.object);
  object.status =
      scene_->hands[hand.value].kind == HandKind::kTracked ? ObjectStatus::kTracked : ObjectStatus::kHeld;
  jump(motion.object);
}

/// Where the hand's own first object is, or would be if it had stayed on what the hand holds.
Pose Environment::returnPlace(const HandMotion& hand) const noexcept {
  if (!hand.taken || !isObject(hand.object)) return hand.X_WH;
  const Pose& X_WO = objects_[hand.object.value].X_WO;
  return hand.object == hand.own ? X_WO : X_WO * hand.X_OR;
}

/// The hand moves nothing; its own first object leaves the scene, another one stays where it is.
void Environment::letGo(HandId hand) noexcept {
  HandMotion& motion = hands_[hand.value];
  const ObjectId object = motion.object;
  motion.object = ObjectId{};
  motion.taken = false;
  motion.X_HO = Pose::Identity();
  motion.F_Ho_W = Wrench{};
  if (!isObject(object)) return;
  engine_->forces[object.value].clear(engine_->couplingCell(object, hand));
  chooseHolder(object);
  if (objects_[object.value].holder.valid()) return;
  const bool has_mass = scene_->objects[object.value].body.has_value();
  park(object, object == motion.own ? ObjectStatus::kHidden
               : has_mass           ? ObjectStatus::kFree
                                    : ObjectStatus::kParked);
  // it was parked when its hand was gone, and now nobody is to hold it any more
  if (has_mass && objects_[object.value].status == ObjectStatus::kParked) {
    objects_[object.value].status = ObjectStatus::kFree;
  }
}

/// Nobody holds the object any more. What the state machine has fixed or hidden stays so.
void Environment::park(ObjectId object, ObjectStatus status) noexcept {
  ObjectMotion& motion = objects_[object.value];
  const bool moved = motion.status == ObjectStatus::kHeld || motion.status == ObjectStatus::kTracked;
  if (moved || status == ObjectStatus::kHidden) motion.status = status;
  const Twist V_WO = motion.V_WO;
  jump(object);
  if (motion.status == ObjectStatus::kFree) motion.V_WO = V_WO;
}

/// The holder remains as long as it holds; then the first hand that does follows.
void Environment::chooseHolder(ObjectId object) noexcept {
  HandId& holder = objects_[object.value].holder;
  const auto holds = [&](HandId hand) {
    return isHand(hand) && hands_[hand.value].object == object && engaged(hands_[hand.value]);
  };
  stir(object);
  if (holds(holder)) return;
  holder = HandId{};
  for (std::uint32_t i = 0; i < hands_.size() && !holder.valid(); ++i) {
    if (holds(HandId{i})) holder = HandId{i};
  }
}

/// A declared jump: what was known about the object's contacts holds no longer.
void Environment::jump(ObjectId object) noexcept {
  ObjectMotion& motion = objects_[object.value];
  motion.V_WO = Twist{};
  motion.asleep = false;
  motion.calm_ticks = 0;
  ++motion.epoch;
  wakeNeighbours(object);
  for (const std::uint32_t i : engine_->near) {
    CollPair& pair = engine_->pairs[i];
    if (pair.spec().a != object && pair.spec().b != object) continue;
    pair.forget();
    note(i);
  }
}

/// Something about the object's motion changes: its pairs are due at once.
void Environment::stir(ObjectId object) noexcept {
  for (const std::uint32_t i : engine_->near) {
    CollPair& pair = engine_->pairs[i];
    if (pair.spec().a == object || pair.spec().b == object) pair.lookAgain();
  }
}

}  // namespace tenon
