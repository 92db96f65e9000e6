#pragma once

#include <cstdint>
#include <optional>

#include "clients/haptic/force_model.h"

namespace tenon::haptic {

/// What a station was told to use.
enum class ForceModelWish : std::uint8_t {
  kAuto,  ///< the copy of the scene if there is one and the link is long
  kManifold,
  kSceneCopy,
};

/// Chooses the force model by the link, once a second. Next to the server its own contacts are as young as a
/// copy's would be; a few milliseconds away they no longer are, for what moves and for what is narrow. A
/// station that is too slow for the copy, so that its cycles are late, does without it for a while, whatever
/// it was told.
///
/// Threads: one. Real-time: everything.
class ForceModelChooser {
 public:
  static constexpr double kLong = 0.004;           ///< [s] round trip from which on the copy is used
  static constexpr double kShort = 0.002;          ///< [s] below which it is no more
  static constexpr std::uint32_t kMostLate = 300;  ///< cycles of a second that may be late with the copy
  static constexpr std::uint32_t kWithout = 60;    ///< [s] without the copy after more than that

  explicit ForceModelChooser(ForceModelWish wish) : wish_(wish) {}
  /// `round_trip` [s]; none: not known. `has_scene`: the station has the compiled scene. `late`: cycles that
  /// were late since the last call.
  ForceModelKind step(std::optional<double> round_trip, bool has_scene, std::uint64_t late) noexcept {
    if (without_ > 0) --without_;
    if (kind_ == ForceModelKind::kSceneCopy && late > kMostLate) without_ = kWithout;
    if (!has_scene || without_ > 0) return kind_ = ForceModelKind::kManifold;
    if (wish_ != ForceModelWish::kAuto) {
      return kind_ =
                 wish_ == ForceModelWish::kSceneCopy ? ForceModelKind::kSceneCopy : ForceModelKind::kManifold;
    }
    if (round_trip > kLong) kind_ = ForceModelKind::kSceneCopy;
    if (round_trip && *round_trip < kShort) kind_ = ForceModelKind::kManifold;
    return kind_;
  }

 private:
  ForceModelWish wish_;
  ForceModelKind kind_ = ForceModelKind::kManifold;
  std::uint32_t without_ = 0;  // [s] from now on
};

}  // namespace tenon::haptic
