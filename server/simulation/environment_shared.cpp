#include <algorithm>
#include <cmath>

#include "server/simulation/environment.h"

namespace tenon::simulation {
namespace {

/// [Ns/m] Stiffness of each of two hands on one object, times the sum of the round trips of their links, at
/// most.
///
/// A hand's motion reaches the other station after half of both round trips. With couplings K to a body
/// without mass, each person feels K / 2 times the difference of their own hand and the other's, late by the
/// delay: a coupling of two positions. It is stable for passive arms of damping b if the stiffness times the
/// delay there and back is below 2 b (Nuno, Basanez, Ortega, Automatica 47, 2011), hence K times the sum
/// below 4 b. A relaxed arm has b = 6.5 Ns/m (HumanArmModel), a device 1 Ns/m and more.
constexpr double kStiffnessTimesDelay = 24.0;

// Ramps of the stiffness: at most so fast that a force in a contact that does not yield changes by
// kForceRate. It falls faster than that under a large force, since it is not stable until it has fallen.
constexpr double kForceRate = 20.0;  // [N/s]
constexpr double kLeastFall = 2.0;   // [1/s] of the stiffness
constexpr double kMostFall = 20.0;   // [1/s]
constexpr double kMostGrowth = 2.0;  // [1/s]
constexpr double kLever = 0.1;       // [m] makes a force of a torque

constexpr double kMostRoundTrip = 1.0;  // [s]

}  // namespace

void Environment::setHandRoundTrip(HandId hand, double round_trip) noexcept {
  if (!isHand(hand)) return;
  hands_[hand.value].round_trip = round_trip > 0.0 ? std::min(round_trip, kMostRoundTrip) : 0.0;
}

HandStiffness Environment::couplingOf(HandId hand) const noexcept {
  const HandMotion& motion = hands_[hand.value];
  return {motion.share * motion.stiffness.translational, motion.share * motion.stiffness.rotational};
}

/// [-] of its stiffness that a hand may have with the other hands on its object. One that is frozen counts:
/// it goes on at any time.
double Environment::shareFor(HandId hand) const noexcept {
  const HandMotion& motion = hands_[hand.value];
  if (!engaged(motion) || !isObject(motion.object)) return 1.0;
  double delay = 0.0;  // [s] there and back, to the farthest of the others
  for (std::uint32_t i = 0; i < hands_.size(); ++i) {
    const HandMotion& other = hands_[i];
    const bool shares = i != hand.value && engaged(other) && other.object == motion.object &&
                        scene_->hands[i].kind == HandKind::kCoupled;
    if (shares) delay = std::max(delay, motion.round_trip + other.round_trip);
  }
  const double most = motion.stiffness.translational * delay;
  return most > kStiffnessTimesDelay ? kStiffnessTimesDelay / most : 1.0;
}

void Environment::limitSharedCouplings() noexcept {
  for (std::uint32_t i = 0; i < hands_.size(); ++i) {
    HandMotion& hand = hands_[i];
    const double target = shareFor(HandId{i});
    if (hand.share == target) continue;
    const double force = std::max(hand.F_Ho_W.force.norm(), hand.F_Ho_W.torque.norm() / kLever);
    const double rate = force > 0.0 ? kForceRate / force : kMostFall;  // [1/s]
    if (target < hand.share) {
      const double fall = std::clamp(rate, kLeastFall, kMostFall);
      hand.share = std::max(target, hand.share * (1.0 - fall * kTickSeconds));
    } else {
      hand.share = std::min(target, hand.share * (1.0 + std::min(rate, kMostGrowth) * kTickSeconds));
    }
  }
}

}  // namespace tenon::simulation
