#pragma once

#include <array>
#include <cstdint>

#include "idl/types/messages.h"

namespace tenon {

inline constexpr int kTactors = 6;
using TactorIntensities = std::array<std::uint8_t, kTactors>;

enum class TactileMode : std::uint8_t {
  kIntensity,  ///< the stronger the contact, the stronger the vibration
  kPattern,    ///< pulses of one strength: the stronger the contact, the quicker they follow
};

struct TactileOptions {
  TactileMode mode = TactileMode::kIntensity;
  double threshold = 0.2;     ///< [N] below it nothing vibrates
  double full_force = 8.0;    ///< [N] of the strongest vibration
  double stiffness = 1000.0;  ///< [N/m] where the manifold names none
};

/// Contacts of a forearm as vibrations of six tactors around it (paper §4.2).
///
/// The forearm's frame has x from elbow to wrist. Tactor 0 sits on top (+z), the others follow every 60
/// degrees towards +y (the inner side of a right arm). A contact drives the tactors nearest to it by angle,
/// each with the strength of the contact's penalty force; a contact at the wrist's end drives all.
///
/// Threads: one. Real-time: everything.
class TactileMap {
 public:
  explicit TactileMap(const TactileOptions& options = {}) : options_(options) {}
  TactorIntensities step(const HandManifold& manifold, double dt) noexcept;
  /// [N] the force each tactor stands for, before mode and quantisation.
  [[nodiscard]] const std::array<double, kTactors>& forces() const noexcept { return forces_; }

 private:
  TactileOptions options_;
  std::array<double, kTactors> forces_{};
  std::array<double, kTactors> pulse_clock_{};  // [s] within a pulse's period
};

}  // namespace tenon
