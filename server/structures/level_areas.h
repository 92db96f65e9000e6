#pragma once

#include <span>
#include <vector>

#include "server/structures/pointshell.h"

namespace tenon {

/// [m^2] What each point stands for when finer levels are left out: [k][i] for point i among those of levels
/// 0..k.
///
/// A point has the skin of its subtree: its own and that of every left-out point to which it is the nearest
/// on the same side of the object. So forces keep their size and place where the skin is curved or edges are
/// sampled more densely, which one factor for a whole level cannot do (paper §3.2: "force values are scaled
/// with the number of colliding points and point densities").
///
/// Threads: pure. Real-time: no; once for each shell.
[[nodiscard]] std::vector<std::vector<float>> levelAreas(std::span<const ShellPoint> points,
                                                         std::span<const ShellLevel> levels);

}  // namespace tenon
