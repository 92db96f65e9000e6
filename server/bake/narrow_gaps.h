#pragma once

#include <vector>

#include "server/bake/brick_level.h"

namespace tenon::bake {

class ParallelWork;
class TriangleTree;

/// Opens narrow gaps, which the flood fill of findOutside does not enter.
///
/// Two samples whose empty balls overlap are on the same side of every surface. So a region connected with
/// the outside through such pairs is outside too, unless triangles are missing. Therefore rays are cast from
/// each such region: in a solid their number of crossings is odd, whatever the winding. A region that extends
/// into bricks without samples (a chamber larger than the band) remains closed.
///
/// Returns 1 for each node where samples became outside; these are also marked in `level.reached`.
///
/// Threads: one caller; uses several threads inside.
[[nodiscard]] std::vector<std::uint8_t> openNarrowGaps(BrickLevel& level, const TriangleTree& tree,
                                                       ParallelWork& work);

}  // namespace tenon::bake
