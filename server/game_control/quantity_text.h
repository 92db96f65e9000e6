#pragma once

#include <numbers>
#include <string>

#include "idl/types/spatial.h"

namespace tenon::game_control {

// Numbers as sentences to people have them.

/// "2.6 mm": three significant digits, from 0.1 mm on to the hundredth; `metres` [m]. From 10 m on in metres.
[[nodiscard]] std::string inMillimetres(double metres);

inline constexpr double kDegree = std::numbers::pi / 180.0;  ///< [rad]

/// "12.5 deg"; `radians` [rad].
[[nodiscard]] std::string inDegrees(double radians);

/// "12 %", "0.42 %": two significant digits, from 10 % on whole ones, below 0.001 % words; `fraction` [-] in
/// 0 to 1.
[[nodiscard]] std::string inPercent(double fraction);

/// "(12, 0, -59) mm", to the tenth.
[[nodiscard]] std::string pointText(const Vector3& p_W);

}  // namespace tenon::game_control
