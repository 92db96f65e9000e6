#include <algorithm>
#include <cmath>
#include <utility>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon::simulation {
namespace {

/// [m] Largest coordinate of a valid pose, larger than any work space; squares stay in the range of a double.
constexpr double kMaxCoordinate = 1e3;

bool isPose(const Pose& X) {
  constexpr double kUnitTolerance = 1e-3;
  if (!X.isFinite() || X.translation().cwiseAbs().maxCoeff() > kMaxCoordinate) return false;
  return std::abs(X.rotation().squaredNorm() - 1.0) < kUnitTolerance;
}

/// [m] An object that appears at its hand deeper than this in another one has no contacts until it is out.
constexpr double kEmergedDepth = 1e-3;

/// [m] Between a hand that comes back and the place where it held its object.
constexpr double kGraspReach = 5e-3;

Pose normalized(const Pose& X) { return {X.translation(), X.rotation().normalized()}; }

bool isFinite(const Twist& V) { return V.linear.allFinite() && V.angular.allFinite(); }

}  // namespace

void Environment::setHandPresent(HandId hand, bool present) noexcept {
  if (!isHand(hand) || hands_[hand.value].present == present) return;
  HandMotion& motion = hands_[hand.value];
  motion.present = present;
  motion.has_pose = false;
  if (present) return;
  motion.attached = false;
  motion.F_Ho_W = Wrench{};
  motion.V_WH = Twist{};
  if (isObject(motion.object)) {
    engine_->forces[motion.object.value].clear(engine_->couplingCell(motion.object, hand));
    updateHolder(motion.object);
    if (!objects_[motion.object.value].holder.valid()) park(motion.object, ObjectStatus::kParked);
  }
}

void Environment::setHandPose(HandId hand, const Pose& X_WH, const Twist& V_WH) noexcept {
  if (!isHand(hand)) return;
  HandMotion& motion = hands_[hand.value];
  if (!isPose(X_WH) || !isFinite(V_WH)) {
    ++motion.rejected_poses;
    return;
  }
  motion.X_WH = normalized(X_WH);
  motion.V_WH = V_WH;
  if (!motion.present) return;
  motion.has_pose = true;
  if (motion.attached || !isObject(motion.object)) return;
  // what was taken away from its hand is held again where it was held, not from wherever the hand comes back
  const ObjectMotion& object = objects_[motion.object.value];
  const bool was_held = motion.object != motion.default_object && !(motion.X_HO.translation().isZero(0.0)) &&
                        (object.status == ObjectStatus::kParked || object.holder.valid());
  const Vector3 p_WG = (object.X_WO * motion.X_HO.inverse()).translation();
  if (was_held && (motion.X_WH.translation() - p_WG).norm() > kGraspReach) return;
  attachHand(hand);
}

void Environment::setHandStiffness(HandId hand, const HandStiffness& stiffness) noexcept {
  if (!isHand(hand)) return;
  const HandSpec& spec = scene_->hands[hand.value];
  const auto known = [](double said, double otherwise) {
    return said > 0.0 && std::isfinite(said) ? said : otherwise;
  };
  hands_[hand.value].stiffness = {known(stiffness.translational, spec.stiffness),
                                  known(stiffness.rotational, spec.rotational_stiffness)};
  hands_[hand.value].round_trip = 0.0;
  hands_[hand.value].share = 1.0;
}

void Environment::setHandFrozen(HandId hand, bool frozen) noexcept {
  if (!isHand(hand) || hands_[hand.value].frozen == frozen) return;
  HandMotion& motion = hands_[hand.value];
  motion.frozen = frozen;
  if (!isObject(motion.object)) return;
  ObjectMotion& object = objects_[motion.object.value];
  markDirty(motion.object);
  const bool coupled = scene_->hands[hand.value].kind == HandKind::kCoupled;
  if (!coupled || engine_->movable[motion.object.value] == 0 || !isMovedByAnother(hand)) {
    object.V_WO = Twist{};
  } else if (!frozen && motion.attached) {
    motion.X_HO = motion.X_WH.inverse() * object.X_WO;
  }
}

/// Another hand's coupling acts on the object that this hand holds.
bool Environment::isMovedByAnother(HandId hand) const noexcept {
  for (std::uint32_t i = 0; i < hands_.size(); ++i)
    if (i != hand.value && pulls(HandId{i}, hands_[hand.value].object)) return true;
  return false;
}

void Environment::grab(HandId hand, ObjectId object) noexcept {
  if (!isHand(hand) || !isObject(object)) return;
  HandMotion& motion = hands_[hand.value];
  if (motion.object == object && motion.attached) return;
  const Pose X_WR = returnPose(motion);
  if (motion.object != object) detachHand(hand);
  motion.object = object;
  if (!motion.present || !motion.has_pose) return;
  attachHand(hand);
  motion.X_OR = objects_[object.value].X_WO.inverse() * X_WR;
}

void Environment::release(HandId hand) noexcept {
  if (!isHand(hand)) return;
  HandMotion& motion = hands_[hand.value];
  if (motion.object == motion.default_object) return;
  const Pose X_WR = returnPose(motion);
  detachHand(hand);
  if (!isObject(motion.default_object)) return;
  grab(hand, motion.default_object);
  // not at the hand's pose: it may be inside the held object by the deflection of the coupling
  if (motion.attached && objects_[motion.default_object.value].holder == hand)
    objects_[motion.default_object.value].X_WO = X_WR;
}

void Environment::swapHands(HandId one, HandId other) noexcept {
  if (!isHand(one) || !isHand(other) || one == other) return;
  HandMotion& a = hands_[one.value];
  HandMotion& b = hands_[other.value];
  std::swap(a.object, b.object);
  std::swap(a.default_object, b.default_object);
  std::swap(a.X_HO, b.X_HO);
  std::swap(a.X_OR, b.X_OR);
  std::swap(a.attached, b.attached);
  for (const HandId hand : {one, other}) {
    HandMotion& motion = hands_[hand.value];
    if (!isObject(motion.object)) continue;
    const HandId former = hand == one ? other : one;
    engine_->forces[motion.object.value].clear(engine_->couplingCell(motion.object, former));
    motion.attached = motion.attached && motion.present && motion.has_pose;
    updateHolder(motion.object);
    if (motion.attached) {
      objects_[motion.object.value].X_WO = motion.X_WH * motion.X_HO;
      beginEpoch(motion.object);
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
      if (hand.attached) hand.X_HO = hand.X_WH.inverse() * motion.X_WO;
      continue;
    }
    engine_->forces[object.value].clear(engine_->couplingCell(object, {static_cast<std::uint32_t>(i)}));
    hand.object = ObjectId{};
    hand.attached = false;
    hand.F_Ho_W = Wrench{};
  }
  if (!stays) {
    motion.holder = HandId{};
    // an object is held or tracked through a hand only
    const bool needs_hand = status == ObjectStatus::kHeld || status == ObjectStatus::kTracked;
    const bool massless = status == ObjectStatus::kFree && !scene_->objects[object.value].body;
    motion.status = needs_hand || massless ? ObjectStatus::kParked : status;
  }
  beginEpoch(object);
  for (const std::uint32_t pair : engine_->pairsOf(object.value)) engine_->noteSwitched(pair);
}

/// The hand has a pose; from now on its object follows it.
void Environment::attachHand(HandId hand) noexcept {
  HandMotion& motion = hands_[hand.value];
  ObjectMotion& object = objects_[motion.object.value];
  const bool starts_at_hand =
      motion.object == motion.default_object || object.status == ObjectStatus::kHidden;
  if (starts_at_hand && !object.holder.valid()) {
    // the frame of a hand's own object is its grip; another one, which was nowhere, is held at its centre
    const bool own = motion.object == motion.default_object;
    motion.X_HO = own ? Pose::Identity() : Pose(Vector3(-centreOf(motion.object)));
    object.X_WO = motion.X_WH * motion.X_HO;
    object.emerging = scene_->hands[hand.value].kind == HandKind::kCoupled;
  } else {
    motion.X_HO = motion.X_WH.inverse() * object.X_WO;
  }
  motion.X_OR = object.X_WO.inverse() * motion.X_WH;
  motion.attached = true;
  motion.X_WH_before = motion.X_WH;
  updateHolder(motion.object);
  object.status =
      scene_->hands[hand.value].kind == HandKind::kTracked ? ObjectStatus::kTracked : ObjectStatus::kHeld;
  beginEpoch(motion.object);
}

/// Objects that appeared at their hands this tick, or inside others before it: those that are out collide
/// from now on, which is a jump where they still overlap.
void Environment::findEmerged() noexcept {
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (!objects_[i].emerging || isInsideAnother(ObjectId{i})) continue;
    objects_[i].emerging = false;
    for (const std::uint32_t pair : engine_->pairsOf(i)) engine_->noteSwitched(pair);
  }
}

bool Environment::isInsideAnother(ObjectId object) noexcept {
  Engine& engine = *engine_;
  if (objects_[object.value].status == ObjectStatus::kHidden) return false;
  const auto pairs = engine.pairsOf(object.value);
  return std::any_of(pairs.begin(), pairs.end(), [&](std::uint32_t i) {
    const CollPair& pair = engine.pairs[i];
    const auto [a, b] = std::pair(pair.spec().a, pair.spec().b);
    const ObjectId other = a == object ? b : a;
    const bool collides = pair.enabled() && pair.possible() && !pair.spec().sensing &&
                          !engine.inOneGroup(i) && objects_[other.value].status != ObjectStatus::kHidden;
    if (!collides) return false;
    return pair.findDepth(objects_[a.value].X_WO, objects_[b.value].X_WO, engine.gap_query) > kEmergedDepth;
  });
}

/// Pose of the hand's default object; while the hand holds another one, its pose relative to that is
/// constant.
Pose Environment::returnPose(const HandMotion& hand) const noexcept {
  if (!hand.attached || !isObject(hand.object)) return hand.X_WH;
  const Pose& X_WO = objects_[hand.object.value].X_WO;
  return hand.object == hand.default_object ? X_WO : X_WO * hand.X_OR;
}

/// The hand moves no object. Its default object is hidden, another one becomes free (with a mass) or parked.
void Environment::detachHand(HandId hand) noexcept {
  HandMotion& motion = hands_[hand.value];
  const ObjectId object = motion.object;
  motion.object = ObjectId{};
  motion.attached = false;
  motion.X_HO = Pose::Identity();
  motion.F_Ho_W = Wrench{};
  if (!isObject(object)) return;
  engine_->forces[object.value].clear(engine_->couplingCell(object, hand));
  updateHolder(object);
  if (objects_[object.value].holder.valid()) return;
  const bool has_mass = scene_->objects[object.value].body.has_value();
  park(object, object == motion.default_object ? ObjectStatus::kHidden
               : has_mass                      ? ObjectStatus::kFree
                                               : ObjectStatus::kParked);
  // it was parked because its hand was not present; now no hand is assigned to it
  if (has_mass && objects_[object.value].status == ObjectStatus::kParked) {
    objects_[object.value].status = ObjectStatus::kFree;
  }
}

/// Sets the status of an object that no hand holds any more. Fixed and hidden objects remain so.
void Environment::park(ObjectId object, ObjectStatus status) noexcept {
  ObjectMotion& motion = objects_[object.value];
  const bool was_held = motion.status == ObjectStatus::kHeld || motion.status == ObjectStatus::kTracked;
  if (was_held || status == ObjectStatus::kHidden) motion.status = status;
  const Twist V_WO = motion.V_WO;
  beginEpoch(object);
  if (motion.status == ObjectStatus::kFree) motion.V_WO = V_WO;
}

/// The holder remains the same while it holds the object; then it is the first hand that does.
void Environment::updateHolder(ObjectId object) noexcept {
  HandId& holder = objects_[object.value].holder;
  const auto holds = [&](HandId hand) {
    return isHand(hand) && hands_[hand.value].object == object && engaged(hands_[hand.value]);
  };
  markDirty(object);
  if (holds(holder)) return;
  holder = HandId{};
  for (std::uint32_t i = 0; i < hands_.size() && !holder.valid(); ++i) {
    if (holds(HandId{i})) holder = HandId{i};
  }
}

/// After a discontinuity of pose or holder: next epoch, velocity 0, all pairs of the object reset.
void Environment::beginEpoch(ObjectId object) noexcept {
  ObjectMotion& motion = objects_[object.value];
  motion.V_WO = Twist{};
  motion.asleep = false;
  motion.rest_ticks = 0;
  ++motion.epoch;
  wakeNeighbours(object);
  for (const std::uint32_t i : engine_->near) {
    CollPair& pair = engine_->pairs[i];
    if (pair.spec().a != object && pair.spec().b != object) continue;
    pair.reset();
    updatePairMotion(i);
  }
}

/// The object may move differently than assumed by the due ticks of its pairs: they are due at once.
void Environment::markDirty(ObjectId object) noexcept {
  for (const std::uint32_t i : engine_->near) {
    CollPair& pair = engine_->pairs[i];
    if (pair.spec().a == object || pair.spec().b == object) pair.invalidate();
  }
}

}  // namespace tenon::simulation
