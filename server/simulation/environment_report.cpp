#include <algorithm>
#include <array>
#include <numeric>
#include <span>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon::simulation {
namespace {

/// Contacts of all pairs of one object, with the pair of each; first those that hold it.
struct Gathered {
  collision::ContactList contacts;
  std::array<std::uint16_t, collision::kMaxPairContacts> pair;
  std::size_t holding = 0;
};

using Chosen = std::array<std::uint32_t, kManifoldContacts>;

/// [-] cos(15 deg): for small motions, contacts of one pair with closer normals represent each other.
constexpr double kSameNormal = 0.966;

/// The contacts of a pair that have a force, as far as there is room. Returns their number.
std::size_t findHolding(const collision::IslandPairResult& result, Chosen& chosen) {
  std::size_t count = 0;
  for (std::size_t c = 0; c < result.query.contacts.size() && count < chosen.size(); ++c) {
    if (result.multipliers[c] > 0.0) chosen[count++] = static_cast<std::uint32_t>(c);
  }
  return count;
}

/// Adds contacts of a pair.
void add(const collision::ContactList& contacts, std::span<const std::uint32_t> chosen, std::size_t pair,
         Gathered& all) {
  for (const std::uint32_t c : chosen) {
    if (!all.contacts.push_back(contacts[c])) return;
    all.pair[all.contacts.size() - 1] = static_cast<std::uint16_t>(pair);
  }
}

void gatherHolding(const collision::IslandPairResult& result, std::size_t pair, Gathered& all) {
  Chosen chosen{};
  const std::size_t count = std::min(findHolding(result, chosen), kManifoldContacts - all.holding);
  add(result.query.contacts, {chosen.data(), count}, pair, all);
  all.holding += count;
}

/// Adds what represents the contacts of a pair beside those that hold: reduced per pair, so that no pair
/// displaces the contacts of another.
void gatherOthers(const collision::IslandPairResult& result, std::size_t pair, Gathered& all) {
  Chosen chosen{};
  const std::size_t holding = findHolding(result, chosen);
  const std::size_t count = collision::selectRepresentatives(result.query.contacts, chosen, holding);
  add(result.query.contacts, std::span(chosen).first(count).subspan(holding), pair, all);
}

Vector3 velocityAt(const ObjectMotion& object, const Vector3& p_WP) {
  return object.V_WO.linear + object.V_WO.angular.cross(p_WP - object.X_WO.translation());
}

/// The contact as a half-space fixed to the other body and a point fixed to the held one. When the held body
/// is the one whose surface is touched, its point is the other's projected onto that surface along the
/// normal.
ManifoldContact manifoldContact(const collision::Contact& contact, ObjectId other_id,
                                const ObjectMotion& other, const ObjectMotion& held, bool held_is_a) {
  const Vector3 n_W = held_is_a ? contact.n_W : Vector3(-contact.n_W);
  const bool held_has_point = held_is_a != (contact.kind == collision::ContactKind::kFeaturePoint);
  const Vector3 p_WP = held_has_point ? contact.p_WP : Vector3(contact.p_WP + contact.gap * n_W);
  const Vector3 n_A = other.X_WO.rotation().conjugate() * n_W;
  const Vector3 p_AP = other.X_WO.inverse() * p_WP;
  ManifoldContact result;
  result.other = other_id;
  result.p_BoP_B = (held.X_WO.inverse() * p_WP).cast<float>();
  result.normal_A = n_A.cast<float>();
  result.offset = static_cast<float>(n_A.dot(p_AP) - contact.gap);
  result.gap = static_cast<float>(contact.gap);
  result.velocity_W = velocityAt(other, p_WP).cast<float>();
  return result;
}

/// The spring that exerts F_Bq_W on a body at X_WB, and about that near it: a goal that is far away, and a
/// coupling that is soft beside that of any hand.
HandPull softPull(ObjectId body, const Wrench& F_Bq_W, const Pose& X_WB, const Vector3& p_BQ) {
  constexpr double kSoft = 1.0;            // [N/m]
  constexpr double kSoftRotational = 1.0;  // [Nm/rad]
  constexpr double kLargestTurn = 1.0;     // [rad] of the goal
  const double rotational = std::max(kSoftRotational, F_Bq_W.torque.norm() / kLargestTurn);
  HandPull pull;
  pull.object = body;
  pull.X_WG.rotation() = (expRotation(F_Bq_W.torque / rotational) * X_WB.rotation()).normalized();
  pull.X_WG.translation() = X_WB * p_BQ + F_Bq_W.force / kSoft - pull.X_WG.rotation() * p_BQ;
  pull.p_BoC_B = p_BQ;
  pull.stiffness = kSoft;
  pull.rotational_stiffness = rotational;
  return pull;
}

/// The bodies of the contacts, so that a jump of one is known; where they are more than the table has places
/// for, those with the smallest gaps.
void listBodies(std::span<const ObjectMotion> objects, HandManifold& out) {
  out.bodies.clear();
  while (!out.bodies.full()) {
    const ManifoldContact* nearest = nullptr;
    for (const ManifoldContact& contact : out.contacts) {
      const bool listed = std::any_of(out.bodies.begin(), out.bodies.end(),
                                      [&](const ManifoldBody& body) { return body.object == contact.other; });
      if (!listed && (nearest == nullptr || contact.gap < nearest->gap)) nearest = &contact;
    }
    if (nearest == nullptr) return;
    out.bodies.push_back({nearest->other, objects[nearest->other.value].epoch});
  }
}

}  // namespace

Wrench Environment::forceOn(ObjectId object) const noexcept {
  if (!isObject(object)) return {};
  const ForceBuffer& forces = engine_->forces[object.value];
  if (objects_[object.value].status != ObjectStatus::kHeld) return forces.total(tick_);
  Wrench F_Oq_W;
  for (std::uint32_t hand = 0; hand < hands_.size(); ++hand) {
    F_Oq_W += forces.cell(engine_->couplingCell(object, HandId{hand}));
  }
  return F_Oq_W;
}

bool Environment::inContact(ObjectId a, ObjectId b) const noexcept {
  return std::any_of(engine_->near.begin(), engine_->near.end(), [&](std::uint32_t i) {
    const CollPair& pair = engine_->pairs[i];
    const PairSpec& spec = pair.spec();
    return ((spec.a == a && spec.b == b) || (spec.a == b && spec.b == a)) && pair.touching();
  });
}

std::span<const std::uint32_t> Environment::nearPairs() const noexcept { return engine_->near; }

std::size_t Environment::contactListCapacity() const noexcept { return engine_->contact_lists.size(); }

void Environment::pairContact(std::size_t pair, PairContact& out) const noexcept {
  const CollPair& one = engine_->pairs[pair];
  out = PairContact{};
  out.a = one.spec().a;
  out.b = one.spec().b;
  out.enabled = one.enabled();
  if (!one.queried()) return;
  out.depth = one.depth();
  out.gap = one.gap();
  out.load_percent = one.counts().loadPercent();
  out.peak_depth = out.depth;
  if (!one.hasContacts()) return;
  Vector3 sum = Vector3::Zero();
  for (const collision::Contact& contact : one.result()->query.contacts) {
    if (contact.gap > collision::kTouchGap) continue;
    sum += contact.p_WP;
    ++out.contacts;
  }
  if (out.contacts > 0) out.p_WP = sum / out.contacts;
  out.colliding = one.touching();
  out.F_Ao_W = one.result()->F_Ao_W;
  out.peak_force = out.F_Ao_W.force.norm();
}

void Environment::manifold(HandId hand, HandManifold& out) const noexcept {
  if (!isHand(hand)) return;
  const HandMotion& motion = hands_[hand.value];
  out.hand = hand;
  out.tick = tick_;
  out.object = motion.object;
  out.X_HO = motion.X_HO;
  out.F_Ho_W = motion.F_Ho_W;
  const HandStiffness stiffness = couplingOf(hand);
  out.stiffness = stiffness.translational;
  out.rotational_stiffness = stiffness.rotational;
  out.frozen = motion.frozen;
  out.validity_radius = 0.0;
  out.others.clear();
  out.contacts.clear();
  out.bodies.clear();
  if (!isObject(motion.object)) return;
  const ObjectMotion& held = objects_[motion.object.value];
  out.object_epoch = held.epoch;
  out.X_WO = held.X_WO;
  listOtherCouplings(hand, out);
  listNeighbours(hand, out);
  listContacts(motion.object, out);
}

void Environment::listOtherCouplings(HandId hand, HandManifold& out) const noexcept {
  const ObjectId object = hands_[hand.value].object;
  if (engine_->movable[object.value] == 0) return;
  for (std::uint32_t i = 0; i < hands_.size() && !out.others.full(); ++i) {
    if (i == hand.value || !pulls(HandId{i}, object)) continue;
    out.others.push_back(pullOf(HandId{i}));
  }
  const Wrench F_Oq_W = engine_->forces[object.value].contributed(tick_);
  if (F_Oq_W.force.isZero(0.0) && F_Oq_W.torque.isZero(0.0)) return;
  out.others.push_back(softPull(object, F_Oq_W, objects_[object.value].X_WO, centreOf(object)));
}

HandPull Environment::pullOf(HandId hand) const noexcept {
  const HandMotion& motion = hands_[hand.value];
  const collision::Spring spring = springOf(hand);
  HandPull pull;
  pull.hand = hand;
  pull.object = motion.object;
  pull.X_WG = spring.X_WG;
  const Vector3 p_HG_W = spring.X_WG.translation() - motion.X_WH.translation();
  pull.V_WG.head<3>() = (motion.V_WH.linear + motion.V_WH.angular.cross(p_HG_W)).cast<float>();
  pull.V_WG.tail<3>() = motion.V_WH.angular.cast<float>();
  pull.p_BoC_B = spring.p_BC;
  pull.stiffness = spring.stiffness;
  pull.rotational_stiffness = spring.rotational_stiffness;
  return pull;
}

void Environment::listNeighbours(HandId hand, HandManifold& out) const noexcept {
  const ObjectId object = hands_[hand.value].object;
  const auto centre = [this](ObjectId one) { return objects_[one.value].X_WO * centreOf(one); };
  const auto gapTo = [&](ObjectId other) {
    return (centre(other) - centre(object)).norm() - engine_->sizes[object.value].ball_radius -
           engine_->sizes[other.value].ball_radius;
  };
  const auto isListed = [&](HandId one) {
    return std::any_of(out.others.begin(), out.others.end(),
                       [one](const HandPull& pull) { return pull.hand == one; });
  };
  while (!out.others.full()) {
    HandId nearest;
    double least = kNeighbourReach;
    for (std::uint32_t i = 0; i < hands_.size(); ++i) {
      const ObjectId other = hands_[i].object;
      if (i == hand.value || !isObject(other) || other == object || isListed(HandId{i})) continue;
      if (!pulls(HandId{i}, other) || gapTo(other) >= least) continue;
      least = gapTo(other);
      nearest = HandId{i};
    }
    if (!nearest.valid()) return;
    out.others.push_back(pullOf(nearest));
  }
}

void Environment::listContacts(ObjectId object, HandManifold& out) const noexcept {
  Gathered all;
  out.validity_radius = engine_->limits.contact_margin;
  // at the pose of the solve they alone give its force
  for (const auto gather : {gatherHolding, gatherOthers}) {
    for (const std::uint32_t i : engine_->near) {
      const CollPair& pair = engine_->pairs[i];
      if (!active(i) || (pair.spec().a != object && pair.spec().b != object)) continue;
      if (pair.hasContacts()) gather(*pair.result(), i, all);
    }
  }
  Chosen chosen{};
  std::iota(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(all.holding), 0U);
  const std::size_t count = collision::selectRepresentatives(all.contacts, chosen, all.holding);
  for (std::size_t i = 0; i < count; ++i) {
    const CollPair& pair = engine_->pairs[all.pair[chosen[i]]];
    const bool held_is_a = pair.spec().a == object;
    const ObjectId other = held_is_a ? pair.spec().b : pair.spec().a;
    out.contacts.push_back(manifoldContact(all.contacts[chosen[i]], other, objects_[other.value],
                                           objects_[object.value], held_is_a));
  }
  listBodies(objects_, out);

  // contacts that no listed one represents, and crossings that may come about, limit the manifold's validity
  for (const std::uint32_t i : engine_->near) {
    const CollPair& pair = engine_->pairs[i];
    if (!active(i) || (pair.spec().a != object && pair.spec().b != object)) continue;
    if (!pair.hasContacts()) continue;
    for (const collision::Contact& contact : pair.result()->query.contacts) {
      const bool represented =
          !contact.dormant() &&
          std::any_of(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(count),
                      [&](std::uint32_t one) {
                        return all.pair[one] == i && all.contacts[one].n_W.dot(contact.n_W) > kSameNormal;
                      });
      if (!represented) out.validity_radius = std::clamp(contact.gapBound(), 0.0, out.validity_radius);
    }
  }
}

}  // namespace tenon::simulation
