#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.h"
#include "idl/types/spatial.h"
#include "server/session/scene_loader.h"

namespace tenon::bench {

/// X_DH of a hand at a time [s].
using HandPath = std::function<Pose(double)>;

inline constexpr double kPressAt = 2.2;   // [s] the soft start of the longest link is over
inline constexpr double kPressed = 2.7;   // [s] the hand has arrived
inline constexpr double kKickAt = 3.6;    // [s] the arm's intent jumps once
inline constexpr double kHeldFrom = 4.3;  // [s] begin of the two seconds that judge a held contact
inline constexpr double kHeldUntil = 6.3;
inline constexpr double kComparedUntil = 4.8;  // [s] forces are compared from kPressed to here

inline constexpr double kSlowPeriod = 0.02;  ///< [s] of slow answers

/// A hand of a situation. Frame D is the world's, with its origin at p_WD.
struct RigHand {
  std::string name;
  Vector3 p_WD = Vector3::Zero();  ///< [m]
  HandPath intent;                 ///< of the arm that holds the device, in the held contact
  HandPath path;                   ///< of the device whose motion is given
};

/// What a hand meets.
struct RigSituation {
  std::string name;   ///< identifier
  std::string title;  ///< for display
  session::LoadedScene loaded;
  std::shared_ptr<const simulation::Scene> compiled;  ///< as a station reads it
  std::vector<RigHand> hands;      ///< each at a station of its own, with a device and a link
  std::optional<RigHand> carrier;  ///< carries a part along `path`, as if nothing could stop it
  bool is_held = true;             ///< there is a held contact whose stability can be judged
  /// Forces are compared with the paths so often, each time later by a part of kSlowPeriod: what turns does
  /// it between two slow answers at any time, and the worst counts.
  int phases = 1;
  /// Whether what the hand meets has moved steadily for long enough at a time [s], for the mean error.
  std::function<bool(double)> steady;
};

/// All situations, with structures from `cache`.
[[nodiscard]] Result<std::vector<RigSituation>> makeSituations(const std::filesystem::path& cache);

}  // namespace tenon::bench
