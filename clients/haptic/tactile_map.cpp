#include "clients/haptic/tactile_map.h"

#include <algorithm>
#include <cmath>

namespace tenon {

namespace {
constexpr double kHalf = 0.5;
constexpr double kHalfSqrt3 = 0.86602540378443864676;
// (y, z) of each tactor around the arm, 60 degrees apart, from the top.
constexpr std::array<std::array<double, 2>, kTactors> kDirections{{{0.0, 1.0},
                                                                   {kHalfSqrt3, kHalf},
                                                                   {kHalfSqrt3, -kHalf},
                                                                   {0.0, -1.0},
                                                                   {-kHalfSqrt3, -kHalf},
                                                                   {-kHalfSqrt3, kHalf}}};
// A contact nearer to the arm's axis than this has no side: it is at an end.
constexpr double kAxisRadius = 0.005;  // [m]
// Below about a quarter of full drive an eccentric motor does not start to turn.
constexpr double kWeakest = 64.0;
constexpr double kStrongest = 255.0;
constexpr double kPulse = 0.08;           // [s] a pulse lasts
constexpr double kSlowestPeriod = 0.6;    // [s] between pulses at the threshold
constexpr double kQuickestPeriod = 0.14;  // [s] at full force
}  // namespace

TactorIntensities TactileMap::step(const HandManifold& manifold, double dt) noexcept {
  const double stiffness = manifold.stiffness > 0.0 ? manifold.stiffness : options_.stiffness;
  forces_.fill(0.0);
  for (const ManifoldContact& contact : manifold.contacts) {
    const double force = stiffness * std::max(0.0, -static_cast<double>(contact.gap));
    const double y = static_cast<double>(contact.p_BoP_B.y());
    const double z = static_cast<double>(contact.p_BoP_B.z());
    const double radius = std::sqrt(y * y + z * z);
    for (int tactor = 0; tactor < kTactors; ++tactor) {
      const auto& direction = kDirections[static_cast<std::size_t>(tactor)];
      // 1 right at the tactor, 0 at the next one
      const double nearness =
          radius < kAxisRadius ? 1.0 : (y * direction[0] + z * direction[1]) / radius * 2.0 - 1.0;
      double& felt = forces_[static_cast<std::size_t>(tactor)];
      // several points of one dent are one contact: the strongest counts
      felt = std::max(felt, force * std::max(0.0, nearness));
    }
  }
  TactorIntensities intensities{};
  for (std::size_t i = 0; i < intensities.size(); ++i) {
    if (forces_[i] < options_.threshold) {
      pulse_clock_[i] = 0.0;
      continue;
    }
    const double strength = std::min(1.0, forces_[i] / options_.full_force);
    if (options_.mode == TactileMode::kIntensity) {
      intensities[i] = static_cast<std::uint8_t>(kWeakest + strength * (kStrongest - kWeakest));
      continue;
    }
    const double period = kSlowestPeriod + strength * (kQuickestPeriod - kSlowestPeriod);
    intensities[i] = pulse_clock_[i] < kPulse ? static_cast<std::uint8_t>(kStrongest) : std::uint8_t{0};
    pulse_clock_[i] += dt;
    if (pulse_clock_[i] >= period) pulse_clock_[i] = 0.0;
  }
  return intensities;
}

}  // namespace tenon
