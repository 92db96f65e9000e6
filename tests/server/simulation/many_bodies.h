#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "tests/server/simulation/small_scene.h"
#include "tests/server/simulation/wave.h"

namespace tenon::test {

/// `count` cubes on a grid, each may meet each and the floor under all; some are held by hands that press
/// them into the floor and stir them.
struct ManyBodies {
  ManyBodies(int count, int held, double spacing = 0.1) {
    const int side = static_cast<int>(std::ceil(std::sqrt(count)));
    floor = small.object("floor", floorStructures(spacing * side + 0.2, 0.02), Vector3::Zero());
    for (int i = 0; i < count; ++i) {
      const Vector3 p_WO(spacing * (i % side - 0.5 * side), spacing * (i / side - 0.5 * side),
                         0.5 * kCubeEdge + 0.001);
      cubes.push_back(small.object("cube" + std::to_string(i), cubeShape(), p_WO));
      places.push_back(p_WO);
    }
    for (int i = 0; i < held; ++i)
      hands.push_back(small.hand("hand" + std::to_string(i), cubes[static_cast<std::size_t>(i)]));
    for (std::size_t i = 0; i < cubes.size(); ++i) {
      small.pair(cubes[i], floor);
      for (std::size_t j = 0; j < i; ++j) small.pair(cubes[i], cubes[j]);
    }
    scene = small.build();
  }

  /// What people do in this tick; depends on nothing but the tick.
  void act(Environment& environment, Tick tick) const {
    for (std::size_t i = 0; i < hands.size(); ++i) {
      if (tick == 1) environment.setHandPresent(hands[i], true);
      constexpr Tick kRound = 1600;
      const double x = wave(tick + 160 * i, kRound);
      const double y = wave(tick + 160 * i + kRound / 4, kRound);
      const Vector3 p(0.01 * x, 0.01 * y, tick < 20 ? 0.0 : -0.01);
      environment.setHandPose(hands[i], Pose(places[i] + p, expRotation({0.0, 0.0, 0.1 * x})), {});
    }
  }
  void step(Environment& environment) const {
    act(environment, environment.tick() + 1);
    environment.step();
  }

  SmallScene small;
  std::shared_ptr<const Scene> scene;
  ObjectId floor;
  std::vector<ObjectId> cubes;
  std::vector<Vector3> places;
  std::vector<HandId> hands;
};

}  // namespace tenon::test
