#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "tests/server/simulation/disturbed_scene.h"
#include "tests/server/simulation/wave.h"

namespace tenon::test {

/// `count` cubes on a grid over a floor; every two may collide, and each with the floor. The first `held`
/// cubes are held by hands that press them into the floor and move them.
struct ManyBodies : DisturbedScene {
  /// `spacing` [m].
  ManyBodies(int count, int held, double spacing = 0.1) : DisturbedScene(offsetOf) {
    const int side = static_cast<int>(std::ceil(std::sqrt(count)));
    floor = small.object("floor", floorStructures(spacing * side + 0.2, 0.02), Vector3::Zero());
    for (int i = 0; i < count; ++i) {
      const Vector3 p_WO(spacing * (i % side - 0.5 * side), spacing * (i / side - 0.5 * side),
                         0.5 * kCubeEdge + 0.001);
      cubes.push_back(small.object("cube" + std::to_string(i), cubeShape(), p_WO));
      positions.push_back(p_WO);
    }
    for (int i = 0; i < held; ++i)
      hands.push_back(small.hand("hand" + std::to_string(i), cubes[static_cast<std::size_t>(i)]));
    for (std::size_t i = 0; i < cubes.size(); ++i) {
      small.pair(cubes[i], floor);
      for (std::size_t j = 0; j < i; ++j) small.pair(cubes[i], cubes[j]);
    }
    scene = small.build();
  }

  static HandOffset offsetOf(std::size_t hand, Tick tick) {
    constexpr Tick kPeriod = 1600;
    const double x = triangleWave(tick + 160 * hand, kPeriod);
    const double y = triangleWave(tick + 160 * hand + kPeriod / 4, kPeriod);
    return {Vector3(0.01 * x, 0.01 * y, tick < 20 ? 0.0 : -0.01), 0.1 * x};
  }

  std::vector<ObjectId> cubes;
};

}  // namespace tenon::test
