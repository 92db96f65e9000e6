#pragma once

#include "server/bake/brick_level.h"

namespace tenon::bake {

class ParallelWork;

/// Makes the signed samples 1-Lipschitz, as distances are: queries rely on it for pruning.
///
/// Samples of one sign fulfil it already. It is violated only between an outside sample and a neighbour that
/// the flood fill did not reach, in a gap too narrow for it. The ball around an outside sample with its
/// distance as radius is empty, so every point in it is outside too: radius minus distance to the centre is a
/// lower bound of the sample there. Each sample is raised to the highest of these bounds. None is lowered;
/// where outside samples are correct, none rises above the true distance.
///
/// With `coarse`, whose samples are limited already, its balls give bounds too.
///
/// Threads: one caller; uses several threads inside.
void limitSlope(BrickLevel& level, const BrickLevel* coarse, ParallelWork& work);

}  // namespace tenon::bake
