#include "clients/haptic/scene_copy.h"

#include <algorithm>

#include "idl/types/messages/objects.h"
#include "idl/types/motion_law.h"

namespace tenon::haptic {

namespace {
// A few pairs about one object have contacts at a time; each list has 80 kB.
constexpr std::size_t kContactLists = 48;

// The server's proxy is elsewhere: beyond friction and rounding, for longer than a step of either takes.
constexpr double kApart = 2e-3;           // [m] of any point
constexpr std::uint32_t kApartFor = 250;  // [cycles]
constexpr double kStands = 5e-3;          // [m/s] of any point

// What a frozen hand holds has moved by more: it was frozen while a frame was on its way, or is not.
constexpr double kStoodStill = 5e-3;  // [m] of any point

// A contribution is repeated each cycle.
constexpr std::uint32_t kLifetime = 2;  // [ticks]
constexpr std::uint32_t kSource = 0;

std::vector<SceneObject> sceneObjects(const simulation::Scene& scene) {
  std::vector<SceneObject> objects(scene.objects.size());
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    objects[i].object = ObjectId{i};
    objects[i].X_WO = scene.objects[i].X_WO;
    if (scene.objects[i].structures == nullptr) continue;
    objects[i].size = scene.objects[i].structures->info.box_M.sizes();
    objects[i].centre = scene.objects[i].structures->info.box_M.center();
  }
  return objects;
}

/// What stands in the copy while something else moves it in the server's.
ObjectStatus kinematic(ObjectStatus status) {
  const bool stays = status == ObjectStatus::kHidden || status == ObjectStatus::kFixed;
  return stays ? status : ObjectStatus::kParked;
}

double pointSpeed(const Twist& V, double radius) { return V.linear.norm() + V.angular.norm() * radius; }

/// What is extrapolated of the twist of a body whose points move at `pace` [m/s].
Twist faded(const Twist& V, double pace) {
  const double weight = extrapolationWeight(pace);
  return {weight * V.linear, weight * V.angular};
}

/// The pose of `object` a cycle after X_WO, on the way to X_WO_target, which moves at `pace` [m/s].
Pose towards(const Pose& X_WO, const Pose& X_WO_target, const ObservedObject& object, double pace) {
  Displacement motion = displacement(X_WO, X_WO_target, object.p_OQ_O);
  const double way = maxPointMotion(motion, object.radius);
  const double most = SceneCopy::kLargestCorrection + pace * kTickSeconds;
  if (way <= most) return X_WO_target;
  motion.translation *= most / way;
  motion.rotation *= most / way;
  return displaced(X_WO, motion, object.p_OQ_O);
}
}  // namespace

SceneCopy::SceneCopy(std::shared_ptr<const simulation::Scene> scene)
    : environment_(scene, {.contact_lists = kContactLists}),
      mirrored_(scene->objects.size()),
      stiffness_(scene->hands.size()),
      others_(scene->hands.size()) {
  view_.begin(sceneObjects(*scene), 0, 0);
  model_.expectAt(1.0);  // the contacts of a cycle are rendered by the next one
  const auto has_mass = [](const simulation::ObjectSpec& object) { return object.body.has_value(); };
  bodies_.resize(
      static_cast<std::size_t>(std::count_if(scene->objects.begin(), scene->objects.end(), has_mass)));
  std::uint32_t count = 0;
  for (const simulation::ObjectSpec& object : scene->objects)
    body_of_.push_back(has_mass(object) ? count++ : static_cast<std::uint32_t>(bodies_.size()));
  // the matrix of the server has its groups in it
  for (const simulation::PairSpec& pair : scene->pairs) {
    const std::uint32_t group = environment_.groupOf(pair.a);
    collides_.push_back(pair.enabled && (group == 0 || group != environment_.groupOf(pair.b)));
  }
  for (std::uint32_t i = 0; i < scene->objects.size(); ++i) environment_.setGroup(ObjectId{i}, 0);
  enablePairs(0, scene->pairs.size());
}

SceneCopy::~SceneCopy() = default;

void SceneCopy::receive(const CollisionMatrix& matrix) noexcept {
  const std::size_t first = std::size_t{8} * kMatrixBytes * matrix.part;
  const std::size_t end = std::min(collides_.size(), first + 8 * matrix.bits.size());
  for (std::size_t i = first; i < end; ++i)
    collides_[i] = (matrix.bits[(i - first) / 8] >> ((i - first) % 8) & 1U) != 0;
  if (first < end) enablePairs(first, end);
}

PredictedBody* SceneCopy::bodyOf(ObjectId object) noexcept {
  const std::uint32_t index = body_of_[object.value];
  return index < bodies_.size() ? &bodies_[index] : nullptr;
}

bool SceneCopy::isNeighbours(ObjectId object) const noexcept {
  return std::any_of(others_.begin(), others_.end(),
                     [object](const OtherHand& one) { return one.object == object; });
}

/// Of the pairs from `first` to `end` those that collide and have the hand's object, a neighbour's or a free
/// body: no other is of interest.
void SceneCopy::enablePairs(std::size_t first, std::size_t end) noexcept {
  for (std::size_t i = first; i < end; ++i) {
    const simulation::PairSpec& pair = environment_.scene().pairs[i];
    const auto isMoved = [this](ObjectId object) {
      return object == object_ || bodyOf(object) != nullptr || isNeighbours(object);
    };
    const bool enabled = collides_[i] && (isMoved(pair.a) || isMoved(pair.b));
    if (environment_.pairs()[i].enabled != enabled) environment_.setPairEnabled(i, enabled);
  }
}

const LocalProxy& SceneCopy::step(const Pose& X_WH, const WorldView& /*world*/) noexcept {
  return model_.step(X_WH, view_);
}

void SceneCopy::compute(const HandManifold& heard, std::uint32_t seq, const ServerTime& time,
                        const Pose& X_WH, const Twist& V_WH, const WorldView& world, bool rendered) noexcept {
  heard_age_ += kTickSeconds;
  if (heard.tick != heard_tick_ || heard.server_epoch != heard_epoch_) hear(heard);
  const bool known = heard.object.value < mirrored_.size() && heard.hand.value < stiffness_.size() &&
                     world.size() == mirrored_.size() && time.known();
  if (!rendered || heard.frozen || !known) {
    following_ = diverged_ = false;
    return;
  }
  const bool holds =
      following_ && heard.hand == hand_ && heard.object == object_ && heard.object_epoch == object_epoch_;
  if (!holds) takeHold(heard);
  mirrorObjects(world, heard, time.tickOf(seq));
  mirrorOtherHands(world, heard, time.tickOf(seq));
  setStiffness(heard.hand, {heard.stiffness, heard.rotational_stiffness});
  environment_.setHandPose(hand_, X_WH, V_WH);
  environment_.step();
  for (std::uint32_t i = 0; i < body_of_.size(); ++i) {
    const simulation::ObjectMotion& motion = environment_.objects()[i];
    if (motion.status == ObjectStatus::kFree && bodyOf(ObjectId{i}) != nullptr)
      bodyOf(ObjectId{i})->record(seq, motion.X_WO, motion.V_WO);
  }
  listContacts(heard, seq);
  // what the hand begins with is no jump of what it has
  if (!holds) model_.step(X_WH, view_);
  following_ = true;
  compareWithServer(heard, seq);
}

void SceneCopy::hear(const HandManifold& heard) noexcept {
  if (heard.server_epoch != heard_epoch_) answered_.fill({});
  // a tick that lacked its input, and the one after it, had another time between inputs than the copy
  const std::int64_t behind = static_cast<std::int64_t>(heard.tick) - heard.answers_seq;
  answered_[answers_++ % answered_.size()] = {heard.tick, heard.answers_seq,
                                              heard.answers_seq != 0 && behind == behind_};
  behind_ = behind;
  heard_tick_ = heard.tick;
  heard_epoch_ = heard.server_epoch;
  heard_age_ = 0.0;
}

void SceneCopy::takeHold(const HandManifold& heard) noexcept {
  for (std::uint32_t i = 0; i < stiffness_.size(); ++i)
    if (HandId{i} != heard.hand) environment_.setHandPresent(HandId{i}, false);
  for (OtherHand& other : others_) {
    if (other.object.valid()) mirrored_[other.object.value].known = false;
    other = {};
  }
  hand_ = heard.hand;
  object_ = heard.object;
  object_epoch_ = heard.object_epoch;
  enablePairs(0, collides_.size());
  environment_.hold(hand_, object_, heard.X_HO, heard.X_WO);
  stiffness_[hand_.value] = {};
  mirrored_[object_.value].known = false;
  for (std::uint32_t i = 0; i < body_of_.size(); ++i)  // they stood still while no cycle was computed
    if (bodyOf(ObjectId{i}) != nullptr) mirrored_[i].known = false;
  past_.fill({});
  apart_ = 0;
  following_ = diverged_ = false;
}

void SceneCopy::mirrorObjects(const WorldView& world, const HandManifold& heard, double now) noexcept {
  for (std::uint32_t i = 0; i < mirrored_.size(); ++i) {
    const ObjectId object{i};
    if (object == heard.object) continue;
    const ObservedObject& seen = world.object(object);
    if (seen.status == ObjectStatus::kFree && bodyOf(object) != nullptr) {
      predict(object, seen, now);
    } else {
      mirror(object, seen, now);
    }
  }
}

void SceneCopy::predict(ObjectId object, const ObservedObject& seen, double now) noexcept {
  Mirrored& mirrored = mirrored_[object.value];
  PredictedBody& body = *bodyOf(object);
  const simulation::ObjectMotion& motion = environment_.objects()[object.value];
  const bool is_known =
      mirrored.known && mirrored.epoch == seen.epoch && mirrored.status == ObjectStatus::kFree;
  if (is_known) compareBody(body, mirrored, seen);
  if (!is_known || body.isLost(seen.radius)) {
    const double ahead = (now - static_cast<double>(seen.updated_at)) * kTickSeconds;
    const Pose X_WO = extrapolated(seen.X_WO, seen.V_WO, seen.p_OQ_O, ahead);
    environment_.place(object, X_WO, ObjectStatus::kFree);
    environment_.correct(object, X_WO, seen.V_WO);
    body.restart();
  } else {
    Pose X_WO = motion.X_WO;
    Twist V_WO = motion.V_WO;
    if (body.correct(seen, X_WO, V_WO)) environment_.correct(object, X_WO, V_WO);
  }
  mirrored = {.known = true,
              .epoch = seen.epoch,
              .status = ObjectStatus::kFree,
              .updated_at = seen.updated_at,
              .V_WO = seen.V_WO,
              .X_WO = seen.X_WO,
              .compared_at = mirrored.compared_at};
}

/// Frame and manifold of one tick, whichever comes first.
void SceneCopy::compareBody(PredictedBody& body, Mirrored& mirrored, const ObservedObject& seen) noexcept {
  if (seen.updated_at == mirrored.compared_at) return;
  for (const Answered& one : answered_) {
    if (one.tick != seen.updated_at || !one.is_comparable) continue;
    body.compare(seen, one.seq);
    mirrored.compared_at = seen.updated_at;
  }
}

void SceneCopy::mirror(ObjectId object, const ObservedObject& seen, double now) noexcept {
  Mirrored& mirrored = mirrored_[object.value];
  const Pose& X_WO_now = environment_.objects()[object.value].X_WO;
  const double ahead = (now - static_cast<double>(seen.updated_at)) * kTickSeconds;
  if (!mirrored.known || mirrored.epoch != seen.epoch || mirrored.status != seen.status) {
    const Pose X_WO = mirrored.known && mirrored.epoch == seen.epoch
                          ? X_WO_now
                          : extrapolated(seen.X_WO, seen.V_WO, seen.p_OQ_O, ahead);
    environment_.place(object, X_WO, kinematic(seen.status));
    mirrored = {.known = true,
                .epoch = seen.epoch,
                .status = seen.status,
                .updated_at = seen.updated_at,
                .V_WO = seen.V_WO,
                .X_WO = seen.X_WO};
  } else if (seen.updated_at != mirrored.updated_at) {
    hearMotion(mirrored, seen);
  }
  if (seen.status == ObjectStatus::kHidden) return;
  const double pace = pointSpeed(mirrored.V_WO, seen.radius);
  const Pose X_WO_target = extrapolated(seen.X_WO, faded(mirrored.V_WO, pace), seen.p_OQ_O, ahead);
  if (X_WO_target == X_WO_now) return;
  environment_.follow(object, towards(X_WO_now, X_WO_target, seen, pace), mirrored.V_WO);
}

void SceneCopy::hearMotion(Mirrored& mirrored, const ObservedObject& seen) noexcept {
  const double dt = static_cast<double>(seen.updated_at - mirrored.updated_at) * kTickSeconds;
  const Displacement way = displacement(mirrored.X_WO, seen.X_WO);
  const Twist before = mirrored.mean_V_WO;
  const std::optional<double> before_seconds = mirrored.mean_seconds;
  mirrored.mean_V_WO = {way.translation / dt, way.rotation / dt};
  mirrored.mean_seconds.reset();
  if (dt > kTwistFilter && dt < kLongestFrame) mirrored.mean_seconds = dt;
  mirrored.updated_at = seen.updated_at;
  mirrored.X_WO = seen.X_WO;
  const bool stands = seen.V_WO.linear.isZero(0.0) && seen.V_WO.angular.isZero(0.0);
  if (stands || dt >= kLongestFrame) {
    mirrored.V_WO = seen.V_WO;
  } else if (dt > kTwistFilter) {
    // each is that of the middle of its time
    const double ahead = before_seconds ? dt / (dt + *before_seconds) : 0.0;
    mirrored.V_WO = mirrored.mean_V_WO;
    mirrored.V_WO.linear += ahead * (mirrored.mean_V_WO.linear - before.linear);
    mirrored.V_WO.angular += ahead * (mirrored.mean_V_WO.angular - before.angular);
  } else {
    const double blend = dt / (kTwistFilter + dt);
    mirrored.V_WO.linear += blend * (seen.V_WO.linear - mirrored.V_WO.linear);
    mirrored.V_WO.angular += blend * (seen.V_WO.angular - mirrored.V_WO.angular);
  }
}

/// Each pulls its object as in the server's last manifold; those that it lists no more do not.
void SceneCopy::mirrorOtherHands(const WorldView& world, const HandManifold& heard, double now) noexcept {
  for (std::uint32_t i = 0; i < others_.size(); ++i) {
    const HandId hand{i};
    const bool listed = std::any_of(heard.others.begin(), heard.others.end(),
                                    [&](const HandPull& pull) { return pull.hand == hand; });
    if (!listed && others_[i].object.valid()) fadePull(hand, world);
  }
  const double ahead = (now - static_cast<double>(heard.tick)) * kTickSeconds;
  for (const HandPull& pull : heard.others) {
    if (!pull.X_WG.isFinite() || !pull.V_WG.allFinite() || !pull.p_BoC_B.allFinite()) continue;
    if (pull.hand == hand_) continue;
    if (pull.hand.value < others_.size() && pull.object.value < mirrored_.size()) {
      mirrorPull(pull, ahead);
    } else if (pull.object == object_) {
      contribute(pull);
    }
  }
}

/// By a soft spring that stands for a wrench.
void SceneCopy::contribute(const HandPull& pull) noexcept {
  const Pose& X_WO = environment_.objects()[object_.value].X_WO;
  const Displacement stretch = displacement(X_WO, pull.X_WG, pull.p_BoC_B);
  const Vector3 force = pull.stiffness * stretch.translation;
  const Vector3 p_OC_W = X_WO.rotation() * pull.p_BoC_B;
  environment_.contribute(object_, kSource,
                          {force, pull.rotational_stiffness * stretch.rotation + p_OC_W.cross(force)},
                          kLifetime);
}

void SceneCopy::fadePull(HandId hand, const WorldView& world) noexcept {
  OtherHand& other = others_[hand.value];
  const bool is_own = other.object == object_;
  const ObservedObject& seen = world.object(other.object);
  if (!is_own && other.weight > 0.0) other.X_WO_begun = seen.X_WO;
  if (!is_own && hasLeft(other, seen)) return endGrasp(hand);
  // another's object stands where it is, so that nothing is to fade
  other.weight = is_own ? std::max(0.0, other.weight - kTickSeconds / kPullFade) : 0.0;
  if (other.weight > 0.0) {
    applyWeight(hand);
  } else {
    environment_.setHandFrozen(hand, true);
  }
}

/// It has released its object, or moves it out of reach. One that a frozen hand holds stands still.
bool SceneCopy::hasLeft(const OtherHand& other, const ObservedObject& seen) const noexcept {
  const ObservedObject& held = view_.object(object_);
  const auto objects = environment_.objects();
  const Vector3 p_WQ = objects[other.object.value].X_WO * seen.p_OQ_O;
  const double apart = (p_WQ - objects[object_.value].X_WO * held.p_OQ_O).norm() - seen.radius - held.radius;
  const Displacement way = displacement(other.X_WO_begun, seen.X_WO, seen.p_OQ_O);
  return seen.status != ObjectStatus::kHeld || apart > kNeighbourReach ||
         maxPointMotion(way, seen.radius) > kStoodStill;
}

void SceneCopy::endGrasp(HandId hand) noexcept {
  environment_.setHandPresent(hand, false);
  others_[hand.value] = {};
  enablePairs(0, collides_.size());
}

void SceneCopy::mirrorPull(const HandPull& pull, double ahead) noexcept {
  OtherHand& other = others_[pull.hand.value];
  const bool is_own = pull.object == object_;
  const ObservedObject& object = view_.object(pull.object);
  const Twist V_WG{pull.V_WG.head<3>().cast<double>(), pull.V_WG.tail<3>().cast<double>()};
  const double pace = pointSpeed(V_WG, object.radius);
  // between two manifolds a shared object needs slow motion, too, or the goal would move in steps
  const double since = is_own ? std::min(heard_age_, kLongestExtrapolation) : 0.0;
  const double rest = std::min(ahead, kLongestExtrapolation) - since;
  Pose X_WG = extrapolated(pull.X_WG, V_WG, object.p_OQ_O, since);
  X_WG = extrapolated(X_WG, faded(V_WG, pace), object.p_OQ_O, rest);
  const simulation::HandMotion& hand = environment_.hands()[pull.hand.value];
  const bool is_held = hand.present && hand.attached && hand.object == pull.object;
  if (!is_held || other.weight <= 0.0) grasp(pull, X_WG);
  other.stiffness = {pull.stiffness, pull.rotational_stiffness};
  other.weight = std::min(1.0, other.weight + kTickSeconds / kPullFade);
  if (!is_own && other.weight < 1.0) {
    // goal displacement scaled by the weight, stiffness by 1/weight: the force equals the listed one
    const Displacement way = displacement(other.X_WO_begun, X_WG, object.p_OQ_O);
    X_WG = displaced(other.X_WO_begun, {other.weight * way.translation, other.weight * way.rotation},
                     object.p_OQ_O);
  }
  other.X_WG = towards(other.X_WG, X_WG, object, pace);
  applyWeight(pull.hand);
  environment_.setHandPose(pull.hand, other.X_WG * hand.X_HO.inverse(), {});
}

/// A hand with which this one begins pulls at once; one that comes or resumes later, within kPullFade.
void SceneCopy::grasp(const HandPull& pull, const Pose& X_WG) noexcept {
  OtherHand& other = others_[pull.hand.value];
  const bool begins = !following_, is_own = pull.object == object_;
  const Pose X_WO = environment_.objects()[pull.object.value].X_WO;
  environment_.grasp(pull.hand, pull.object, Pose(-pull.p_BoC_B));
  other = {.object = pull.object,
           .X_WG = begins || is_own ? X_WG : X_WO,
           .X_WO_begun = X_WO,
           .weight = begins ? 1.0 : 0.0};
  stiffness_[pull.hand.value] = {};
  enablePairs(0, collides_.size());
}

void SceneCopy::applyWeight(HandId hand) noexcept {
  const OtherHand& other = others_[hand.value];
  // another's object stood: its coupling becomes soft from stiff, so that it gives way without a step
  const double factor = other.object == object_ ? other.weight : 1.0 / other.weight;
  setStiffness(hand, {factor * other.stiffness.translational, factor * other.stiffness.rotational});
}

void SceneCopy::setStiffness(HandId hand, const HandStiffness& stiffness) noexcept {
  HandStiffness& known = stiffness_[hand.value];
  if (known.translational == stiffness.translational && known.rotational == stiffness.rotational) return;
  known = stiffness;
  environment_.setHandStiffness(hand, stiffness);
}

void SceneCopy::listContacts(const HandManifold& heard, std::uint32_t seq) noexcept {
  environment_.manifold(hand_, contacts_);
  contacts_.server_epoch = heard.server_epoch;
  contacts_.answers_seq = seq;
  contacts_.step_revision = heard.step_revision;
  model_.receive(contacts_);
  const auto objects = environment_.objects();
  for (const ManifoldContact& contact : contacts_.contacts)
    view_.set(contact.other, objects[contact.other.value].X_WO, objects[contact.other.value].epoch);
  for (const ManifoldBody& body : contacts_.bodies)
    view_.set(body.object, objects[body.object.value].X_WO, objects[body.object.value].epoch);
  view_.set(object_, objects[object_.value].X_WO, objects[object_.value].epoch);
}

void SceneCopy::compareWithServer(const HandManifold& heard, std::uint32_t seq) noexcept {
  past_[seq % past_.size()] = {seq, environment_.objects()[object_.value].X_WO};
  const PastProxy& then = past_[heard.answers_seq % past_.size()];
  const auto isStill = [&](ObjectId object) {
    return pointSpeed(mirrored_[object.value].V_WO, view_.object(object).radius) < kStands;
  };
  const bool is_pulled = std::any_of(heard.others.begin(), heard.others.end(),
                                     [this](const HandPull& pull) { return pull.object == object_; });
  const bool comparable =
      then.seq == heard.answers_seq && !is_pulled &&
      std::all_of(contacts_.bodies.begin(), contacts_.bodies.end(),
                  [&](const ManifoldBody& body) { return isStill(body.object); }) &&
      std::all_of(heard.bodies.begin(), heard.bodies.end(), [&](const ManifoldBody& body) {
        return body.object.value >= mirrored_.size() || isStill(body.object);
      });
  const ObservedObject& held = view_.object(object_);
  const bool apart =
      comparable && maxPointMotion(displacement(then.X_WO, heard.X_WO, held.p_OQ_O), held.radius) > kApart;
  apart_ = apart ? apart_ + 1 : 0;
  if (apart_ > kApartFor) diverged_ = true;
}

std::vector<std::unique_ptr<SceneCopy>> copiesOf(const std::shared_ptr<const simulation::Scene>& scene,
                                                 std::size_t count) {
  std::vector<std::unique_ptr<SceneCopy>> copies(count);
  for (std::unique_ptr<SceneCopy>& copy : copies) copy = std::make_unique<SceneCopy>(scene);
  return copies;
}

}  // namespace tenon::haptic
