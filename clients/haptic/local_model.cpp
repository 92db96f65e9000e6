#include "clients/haptic/local_model.h"

#include <algorithm>
#include <array>
#include <span>

namespace tenon {

namespace {
// A row that pushes less than this only touches by rounding.
constexpr double kTouchForce = 1e-9;  // [N]

// Another hand's pull is gone so many ticks after it let go.
constexpr double kFadeTicks = 20.0;
}  // namespace

LocalModel::LocalModel(const StalenessLimits& limits) : limits_(limits), solver_(1, kManifoldContacts) {}

void LocalModel::receive(const HandManifold& manifold) noexcept {
  if (!manifold.X_WO.isFinite() || !manifold.X_HO.isFinite()) return;
  if (heard_) {
    if (manifold.server_epoch < manifold_.server_epoch) return;
    if (manifold.server_epoch == manifold_.server_epoch && manifold.tick < manifold_.tick) return;
  }
  const bool same = heard_ && manifold.server_epoch == manifold_.server_epoch &&
                    manifold.object == manifold_.object && manifold.object_epoch == manifold_.object_epoch;
  if (!same) new_object_ = true;
  manifold_ = manifold;
  receivePulls(same);
  proxy_.age = 0;
  heard_ = true;
}

const LocalProxy& LocalModel::step(const Pose& X_WH, const WorldView& world) noexcept {
  const bool was_active = proxy_.active;
  proxy_.jumped = false;
  proxy_.active = heard_ && manifold_.object.valid() && !manifold_.frozen && !outdated(world);
  if (!proxy_.active) {
    proxy_.jumped = was_active;
    proxy_.touching = false;
    proxy_.stiffness = proxy_.rotational_stiffness = 0.0;
    proxy_.X_WS = X_WH;
    proxy_.X_WO = heard_ ? X_WH * manifold_.X_HO : X_WH;
    ++proxy_.age;
    return proxy_;
  }
  if (new_object_ || !was_active) {
    // the server's proxy is the only one that fits the new planes
    proxy_.jumped = was_active;
    proxy_.X_WO = manifold_.X_WO;
    new_object_ = false;
  }
  const double freshness_now = freshness();
  proxy_.stiffness = manifold_.stiffness * freshness_now;
  proxy_.rotational_stiffness = manifold_.rotational_stiffness * freshness_now;
  solve(X_WH, world);
  fadePulls();
  proxy_.X_WS = proxy_.X_WO * manifold_.X_HO.inverse();
  countValidity();
  ++proxy_.age;
  return proxy_;
}

void LocalModel::receivePulls(bool same_object) noexcept {
  if (!same_object) pulls_.clear();
  for (OtherPull& known : pulls_) known.listed = false;
  for (const HandPull& pull : manifold_.others) {
    if (!pull.X_WG.isFinite() || !pull.p_BoC_B.allFinite()) continue;
    auto* const known = std::find_if(pulls_.begin(), pulls_.end(),
                                     [&](const OtherPull& other) { return other.pull.hand == pull.hand; });
    if (known != pulls_.end()) {
      *known = {pull, 1.0, true};
    } else {
      pulls_.push_back({pull, 1.0, true});
    }
  }
}

void LocalModel::fadePulls() noexcept {
  std::size_t kept = 0;
  for (OtherPull& other : pulls_) {
    if (!other.listed) other.weight -= 1.0 / kFadeTicks;
    if (other.weight > 0.0) pulls_[kept++] = other;
  }
  pulls_.resize(kept);
}

bool LocalModel::outdated(const WorldView& world) const noexcept {
  return world.knows(manifold_.object) && world.serverEpoch() == manifold_.server_epoch &&
         world.object(manifold_.object).epoch > manifold_.object_epoch;
}

double LocalModel::freshness() const noexcept {
  if (proxy_.age <= limits_.fresh) return 1.0;
  if (proxy_.age >= limits_.gone) return 0.0;
  return static_cast<double>(limits_.gone - proxy_.age) / static_cast<double>(limits_.gone - limits_.fresh);
}

void LocalModel::solve(const Pose& X_WH, const WorldView& world) noexcept {
  body_.X_WB = proxy_.X_WO;
  body_.springs.clear();
  // undecayed: where the object goes does not depend on how old the planes are, only how hard it is held does
  body_.springs.push_back({X_WH * manifold_.X_HO, manifold_.X_HO.inverse().translation(),
                           std::max(1.0, manifold_.stiffness),
                           std::max(0.1, manifold_.rotational_stiffness)});
  // those that hold on come first, should there be too many
  for (const bool listed : {true, false}) {
    for (const OtherPull& other : pulls_) {
      if (other.listed != listed) continue;
      const HandPull& pull = other.pull;
      body_.springs.push_back({pull.X_WG, pull.p_BoC_B, other.weight * std::max(0.0, pull.stiffness),
                               other.weight * std::max(0.0, pull.rotational_stiffness)});
    }
  }
  rows_.clear();
  for (const ManifoldContact& contact : manifold_.contacts) {
    if (!world.knows(contact.other)) continue;
    const Pose& X_WA = world.object(contact.other).X_WO;
    const Vector3 n_A = contact.normal_A.cast<double>();
    GapRow row;
    row.body_a = 0;
    row.n_W = X_WA.rotation() * n_A;
    row.p_WP = body_.X_WB * contact.p_BoP_B.cast<double>();
    row.gap = n_A.dot(X_WA.inverse() * row.p_WP) - static_cast<double>(contact.offset);
    rows_.push_back(row);
  }
  std::array<Displacement, 1> motion{};
  solver_.solve({&body_, 1}, {rows_.begin(), rows_.size()}, motion, {multipliers_.data(), rows_.size()});
  proxy_.X_WO = displaced(proxy_.X_WO, motion[0]);
  proxy_.touching = false;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    if (multipliers_[i] > kTouchForce) proxy_.touching = true;
  }
}

void LocalModel::countValidity() noexcept {
  const double way = fastestPoint(displacement(manifold_.X_WO, proxy_.X_WO), body_.radius);
  if (way > manifold_.validity_radius) ++beyond_validity_;
}

}  // namespace tenon
