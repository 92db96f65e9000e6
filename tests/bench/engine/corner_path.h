#pragma once

#include <string>

namespace tenon::bench {

/// Path of a held box whose hand moves down through a floor, below it through a wall, and up again, as CSV:
/// for each contact method and tick the positions of hand and box [m] and the force on the hand [N], in the
/// x-z plane.
[[nodiscard]] std::string cornerPath();

}  // namespace tenon::bench
