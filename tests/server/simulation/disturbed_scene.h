#pragma once

#include <memory>
#include <vector>

#include "tests/server/simulation/small_scene.h"

namespace tenon::test {

/// Objects on a floor, some of them held by hands that press them into the floor and move them.
class DisturbedScene {
 public:
  /// Hand inputs of this tick; a function of the tick only.
  void act(simulation::Environment& environment, Tick tick) const {
    for (std::size_t i = 0; i < hands.size(); ++i) {
      if (tick == 1) environment.setHandPresent(hands[i], true);
      const HandOffset offset = offset_of_(i, tick);
      const Pose X_WH(positions[i] + offset.p_W, expRotation({0.0, 0.0, offset.angle}));
      environment.setHandPose(hands[i], X_WH, {});
    }
  }
  void step(simulation::Environment& environment) const {
    act(environment, environment.tick() + 1);
    environment.step();
  }

  SmallScene small;
  std::shared_ptr<const simulation::Scene> scene;
  ObjectId floor;
  std::vector<Vector3> positions;  ///< [m] initial, of the objects; held ones first
  std::vector<HandId> hands;

 protected:
  /// From a hand's initial pose.
  struct HandOffset {
    Vector3 p_W;         ///< [m]
    double angle = 0.0;  ///< [rad] about z
  };
  explicit DisturbedScene(HandOffset (*offset_of)(std::size_t hand, Tick tick)) : offset_of_(offset_of) {}

 private:
  HandOffset (*offset_of_)(std::size_t hand, Tick tick);
};

}  // namespace tenon::test
