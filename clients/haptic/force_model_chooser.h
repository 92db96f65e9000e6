#pragma once

#include "clients/haptic/force_model.h"

namespace tenon::haptic {

/// What a station was told to use.
enum class ForceModelWish : std::uint8_t {
  kAuto,  ///< the copy of the scene if there is one and the link is long
  kManifold,
  kSceneCopy,
};

/// Chooses the force model by the link, once a second. Next to the server its own contacts are as young as a
/// copy's would be; a few milliseconds away they no longer are, for what moves and for what is narrow.
///
/// Threads: one. Real-time: everything.
class ForceModelChooser {
 public:
  static constexpr double kLong = 0.004;   ///< [s] round trip from which on the copy is used
  static constexpr double kShort = 0.002;  ///< [s] below which it is no more

  explicit ForceModelChooser(ForceModelWish wish) : wish_(wish) {
    if (wish == ForceModelWish::kSceneCopy) kind_ = ForceModelKind::kSceneCopy;
  }
  /// `round_trip` [s]; 0: not known. `has_scene`: the station has the compiled scene.
  ForceModelKind step(double round_trip, bool has_scene) noexcept {
    if (!has_scene) return kind_ = ForceModelKind::kManifold;
    if (wish_ != ForceModelWish::kAuto) {
      return kind_ =
                 wish_ == ForceModelWish::kSceneCopy ? ForceModelKind::kSceneCopy : ForceModelKind::kManifold;
    }
    if (round_trip > kLong) kind_ = ForceModelKind::kSceneCopy;
    if (round_trip > 0.0 && round_trip < kShort) kind_ = ForceModelKind::kManifold;
    return kind_;
  }

 private:
  ForceModelWish wish_;
  ForceModelKind kind_ = ForceModelKind::kManifold;
};

}  // namespace tenon::haptic
