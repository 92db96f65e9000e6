#pragma once

#include <string>
#include <utility>
#include <vector>

#include "clients/haptic/mover.h"
#include "clients/simulated_person/motor_intent.h"
#include "clients/station/hand_trajectory.h"

namespace tenon::station {

/// The file that a hand's arm follows.
struct HandScript {
  std::string hand;  ///< its name; empty: the station's first one
  HandTrajectory trajectory;
};

/// Moves arms by files: each intends the pose of its file, braced, from the station's first millisecond in
/// the session on. What the devices reach of it is up to contacts, safety and the arm's impedance.
///
/// Threads: one. Real-time: step.
class ScriptMover final : public haptic::Mover {
 public:
  explicit ScriptMover(std::vector<HandScript> scripts) : scripts_(std::move(scripts)) {}

  void begin(std::span<const SceneObject> objects, std::span<const haptic::MovedHand> hands) override;
  void step(std::span<haptic::MovedHand> hands, const haptic::WorldView& world) noexcept override;
  [[nodiscard]] const char* activity() const noexcept override { return "follows a file"; }

 private:
  struct Follower {
    const HandTrajectory* trajectory = nullptr;  // null: the arm stays where it is
    simulated_person::MotorIntent intent;
  };
  std::vector<HandScript> scripts_;
  std::vector<Follower> followers_;  // of each hand
  Tick steps_ = 0;
};

}  // namespace tenon::station
