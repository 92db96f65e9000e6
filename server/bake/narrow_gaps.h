#pragma once

#include <vector>

#include "server/bake/brick_level.h"

namespace tenon {

class ParallelWork;
class TriangleTree;

/// Opens the gaps that a flood with a wide sigma leaves closed.
///
/// Two samples whose empty balls overlap are on the same side of every surface. So what hangs together with
/// the outside through such pairs is outside too, unless triangles are missing. Therefore each part that
/// would be won is asked, by rays, whether it is in a solid: crossings are odd there, whichever way triangles
/// wind. A part that reaches into a chamber too large for the band remains closed.
///
/// Gives the nodes where samples became outside; they are marked as reached as well.
[[nodiscard]] std::vector<std::uint8_t> openNarrowGaps(BrickLevel& level, const TriangleTree& tree,
                                                       ParallelWork& work);

}  // namespace tenon
