#pragma once

#include <string>

namespace tenon::bench {

/// The way of a held box whose hand goes down through a floor, along it through a wall, and up again, as CSV:
/// a line for each method and tick, where hand and box are and what the hand feels, in the plane across the
/// corner [m, N].
[[nodiscard]] std::string cornerPath();

}  // namespace tenon::bench
