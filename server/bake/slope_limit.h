#pragma once

#include "server/bake/brick_level.h"

namespace tenon {

class ParallelWork;

/// Makes signed samples differ by no more than they are apart, as distances do: queries prune by that.
///
/// Samples of one sign do so by themselves. Steeper is only the step from an outside sample to one that the
/// flood did not reach: into a gap it closed. Nothing of the surface is nearer to the outside sample than its
/// own distance, so whatever lies in that ball is outside as well. A sample is raised to the highest of these
/// balls' slopes; none is lowered, and where the outside is right, none rises above the true distance.
///
/// With `coarse`, whose samples are limited already, balls reach in from there too.
void limitSlope(BrickLevel& level, const BrickLevel* coarse, ParallelWork& work);

}  // namespace tenon
