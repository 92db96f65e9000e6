#pragma once

#include <optional>
#include <span>
#include <string>

#include "server/structures/distance_field.h"
#include "server/structures/feature_shell.h"
#include "server/structures/pointshell.h"

namespace tenon::structures {

/// What makes a field, a pointshell or a feature shell unsafe or wrong to query, as the rest of the sentence
/// "its field ..." or "its pointshell ..."; nothing when it is sound. An empty one is. Queries check no
/// index: whatever comes from a file passes here first, and what is written too, so that nothing is baked
/// that cannot be read.
///
/// A sound field has a finite geometry and arrays of exactly the sizes that its index asks for: the blocks of
/// refined bricks follow one another behind the coarse bricks, and each brick of samples is named once, in
/// order. The leaves of a sound pointshell hold each point once and in order, its clusters each leaf, its
/// levels each of all three; and every point is inside of the spheres of its leaf and its cluster.
[[nodiscard]] std::optional<std::string> problemOf(const DistanceField::Layout& field);
[[nodiscard]] std::optional<std::string> problemOf(const Pointshell::Layout& shell);
/// The same for the points of a feature shell, and an edge for each of them.
[[nodiscard]] std::optional<std::string> problemOf(const Pointshell::Layout& points,
                                                   std::span<const FeatureEdge> edges);

}  // namespace tenon::structures
