#pragma once

#include <string>
#include <vector>

#include "tests/server/simulation/disturbed_scene.h"
#include "tests/server/simulation/wave.h"

namespace tenon::test {

/// A finely sampled block, 10 x 6 x 4 cm: about 25,000 points, a quarter of them on its underside.
inline StructuresPtr fineBlockShape() {
  static const StructuresPtr shape = boxStructures({0.1, 0.06, 0.04}, 0.002, 0.001);
  return shape;
}

/// More work than fits into a tick: blocks lie flat on a floor, pressed down and moved by hands, each with
/// thousands of points in contact all the time.
struct Overload : DisturbedScene {
  explicit Overload(int blocks) : DisturbedScene(offsetOf) {
    floor = small.object("floor", floorStructures(1.4, 0.01), Vector3::Zero());
    for (int i = 0; i < blocks; ++i) {
      const Vector3 p_WO(0.15 * (i % 8) - 0.55, 0.12 * (i / 8) - 0.5, 0.021);
      positions.push_back(p_WO);
      parts.push_back(small.object("block" + std::to_string(i), fineBlockShape(), p_WO));
      hands.push_back(small.hand("hand" + std::to_string(i), parts.back()));
      pairs.push_back(small.pair(parts.back(), floor));
    }
    scene = small.build();
  }

  static HandOffset offsetOf(std::size_t hand, Tick tick) {
    const double x = 0.01 * triangleWave(tick + 37 * hand, 400);
    const double y = 0.01 * triangleWave(tick + 91 * hand, 700);
    return {Vector3(x, y, tick < 20 ? 0.0 : -0.004), 0.1 * triangleWave(tick, 900)};
  }

  std::vector<ObjectId> parts;
  std::vector<std::size_t> pairs;
};

}  // namespace tenon::test
