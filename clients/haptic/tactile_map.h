#pragma once

#include <array>
#include <cstdint>

#include "idl/types/messages/contacts.h"

namespace tenon::haptic {

inline constexpr int kTactors = 6;
using TactorIntensities = std::array<std::uint8_t, kTactors>;

enum class TactileMode : std::uint8_t {
  kIntensity,  ///< vibration intensity grows with contact force
  kPattern,    ///< pulses of constant intensity; pulse rate grows with contact force
};

struct TactileOptions {
  TactileMode mode = TactileMode::kIntensity;
  double threshold = 0.2;     ///< [N] no vibration below
  double full_force = 8.0;    ///< [N] at and above which the vibration is strongest
  double stiffness = 1000.0;  ///< [N/m] used when the manifold has none
};

/// Maps contacts of a forearm to intensities of six tactors around it (paper §4.2).
///
/// Frame B of the forearm has x from elbow to wrist. Tactor 0 is on top (+z), the others follow every 60
/// degrees towards +y (the inner side of a right arm). The penalty force of a contact is distributed to the
/// two tactors nearest in angle; a contact near the axis of the forearm drives all tactors.
///
/// Threads: one. Real-time: everything.
class TactileMap {
 public:
  explicit TactileMap(const TactileOptions& options = {}) : options_(options) {}
  /// One cycle of `dt` [s]; intensities from 0 to 255.
  TactorIntensities step(const HandManifold& manifold, double dt) noexcept;
  /// [N] contact force assigned to each tactor in the last step.
  [[nodiscard]] const std::array<double, kTactors>& forces() const noexcept { return forces_; }

 private:
  TactileOptions options_;
  std::array<double, kTactors> forces_{};       // [N]
  std::array<double, kTactors> pulse_clock_{};  // [s] since the begin of the pulse period
};

}  // namespace tenon::haptic
