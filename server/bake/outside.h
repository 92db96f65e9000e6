#pragma once

#include "server/bake/brick_level.h"

namespace tenon {

class ParallelWork;
class TriangleTree;

/// Finds what is outside from unsigned distances alone: no normals, no winding, no watertightness.
///
/// A flood from the grid's corner passes only where the surface is more than sigma away, so missing triangles
/// of less than two sigma do not let it in; narrow gaps are opened afterwards (openNarrowGaps). What it
/// reached is extended to the surface: a sample is outside when it lies in an empty ball about a reached one
/// (after Xu and Barbic 2014). Both sides of a sheet without thickness are outside.
///
/// With `coarse`, a level of finer voxels starts from the coarse level's reached samples.
void findOutside(BrickLevel& level, const BrickLevel* coarse, const TriangleTree& tree, ParallelWork& work);

/// Carries the signs of the fine level over to the coarse samples that lie in refined bricks: only there a
/// slot too narrow for coarse voxels is open.
void adoptFineSigns(BrickLevel& coarse, const BrickLevel& fine, ParallelWork& work);

}  // namespace tenon
