#pragma once

#include <span>
#include <vector>

#include "server/structures/pointshell.h"

namespace tenon::structures {

/// [m^2] The surface area that each point represents when finer levels are skipped: [k][i] for point i among
/// those of levels 0..k.
///
/// The area of a point is its own plus that of every skipped point whose nearest used point on the same side
/// of the object it is. So forces keep their magnitude and point of application where the surface is curved
/// or edges are sampled more densely, which one factor per level cannot do (paper §3.2: "force values are
/// scaled with the number of colliding points and point densities").
///
/// Threads: pure. Real-time: no; once for each shell.
[[nodiscard]] std::vector<std::vector<float>> levelAreas(std::span<const ShellPoint> points,
                                                         std::span<const ShellLevel> levels);

}  // namespace tenon::structures
