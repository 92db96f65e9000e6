#include "clients/haptic/tactile_map.h"

#include <algorithm>
#include <cmath>

namespace tenon::haptic {

namespace {
constexpr double kHalf = 0.5;
constexpr double kHalfSqrt3 = 0.86602540378443864676;
// Direction (y, z) of each tactor from the axis of the forearm.
constexpr std::array<std::array<double, 2>, kTactors> kDirections{{{0.0, 1.0},
                                                                   {kHalfSqrt3, kHalf},
                                                                   {kHalfSqrt3, -kHalf},
                                                                   {0.0, -1.0},
                                                                   {-kHalfSqrt3, -kHalf},
                                                                   {-kHalfSqrt3, kHalf}}};
// A contact nearer to the axis has no defined direction: it drives all tactors.
constexpr double kAxisRadius = 0.005;  // [m]
// An eccentric-mass motor does not start below about a quarter of full drive.
constexpr double kMinIntensity = 64.0;
constexpr double kMaxIntensity = 255.0;
constexpr double kPulseDuration = 0.08;   // [s]
constexpr double kMaxPulsePeriod = 0.6;   // [s] at the threshold
constexpr double kMinPulsePeriod = 0.14;  // [s] at full force
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
      // 1 at the tactor, 0 at its neighbours
      const double weight =
          radius < kAxisRadius ? 1.0 : (y * direction[0] + z * direction[1]) / radius * 2.0 - 1.0;
      double& tactor_force = forces_[static_cast<std::size_t>(tactor)];
      // several points usually belong to one contact: the largest force counts
      tactor_force = std::max(tactor_force, force * std::max(0.0, weight));
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
      intensities[i] = static_cast<std::uint8_t>(kMinIntensity + strength * (kMaxIntensity - kMinIntensity));
      continue;
    }
    const double period = kMaxPulsePeriod + strength * (kMinPulsePeriod - kMaxPulsePeriod);
    intensities[i] =
        pulse_clock_[i] < kPulseDuration ? static_cast<std::uint8_t>(kMaxIntensity) : std::uint8_t{0};
    pulse_clock_[i] += dt;
    if (pulse_clock_[i] >= period) pulse_clock_[i] = 0.0;
  }
  return intensities;
}

}  // namespace tenon::haptic
