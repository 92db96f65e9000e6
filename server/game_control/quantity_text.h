#pragma once

#include <string>

#include "idl/types/spatial.h"

namespace tenon::game_control {

// Numbers as sentences to people have them.

/// "2.6 mm": three significant digits, to the hundredth; `metres` [m]. From 10 m on in metres.
[[nodiscard]] std::string inMillimetres(double metres);

/// "12.5 deg"; `radians` [rad].
[[nodiscard]] std::string inDegrees(double radians);

/// "(12, 0, -59) mm", to the tenth.
[[nodiscard]] std::string pointText(const Vector3& p_W);

}  // namespace tenon::game_control
