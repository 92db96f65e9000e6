#pragma once

#include <memory>
#include <vector>

#include "tests/server/simulation/small_scene.h"

namespace tenon::test {

/// Things lie on a floor, and hands press them into it and stir them.
class StirredScene {
 public:
  /// What people do in this tick; depends on nothing but the tick.
  void act(Environment& environment, Tick tick) const {
    for (std::size_t i = 0; i < hands.size(); ++i) {
      if (tick == 1) environment.setHandPresent(hands[i], true);
      const Stir stir = stir_(i, tick);
      const Pose X_WH(places[i] + stir.way, expRotation({0.0, 0.0, stir.turn}));
      environment.setHandPose(hands[i], X_WH, {});
    }
  }
  void step(Environment& environment) const {
    act(environment, environment.tick() + 1);
    environment.step();
  }

  SmallScene small;
  std::shared_ptr<const Scene> scene;
  ObjectId floor;
  std::vector<Vector3> places;  ///< of the things, those that hands hold first
  std::vector<HandId> hands;

 protected:
  /// From a hand's place: about z, [rad].
  struct Stir {
    Vector3 way;
    double turn = 0.0;
  };
  explicit StirredScene(Stir (*stir)(std::size_t hand, Tick tick)) : stir_(stir) {}

 private:
  Stir (*stir_)(std::size_t hand, Tick tick);
};

}  // namespace tenon::test
