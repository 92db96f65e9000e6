#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/game_control/state_machine.h"
#include "server/simulation/environment.h"
#include "tests/server/game_control/scenario_text.h"
#include "tests/support/analytic_structures.h"

namespace tenon::test {

//            |pointer
//            v
//          [part] 40 mm, starts at x = 0.2, z = 0.1
//   ___      ___ z = 0
//      |    |      a socket 44 mm wide, 42 mm deep; the target is 2 mm above its bottom
//      |____|
inline std::vector<StructuresPtr> smallStructures() {
  static const std::vector<StructuresPtr> structures{
      socketStructures(Vector3(0.044, 0.044, 0.042), 0.02, 0.001),
      boxStructures(Vector3::Constant(0.04), 0.002, 0.005), sphereStructures(0.012, 0.002, 0.003),
      boxStructures(Vector3::Constant(0.04), 0.002, 0.005)};
  return structures;
}

/// A scenario with its Environment and state machine; the test sets the poses of the right hand.
class ScenarioFixture {
 public:
  explicit ScenarioFixture(const std::string& text)
      : scenario_(std::make_shared<game_control::ScenarioFile>(
            game_control::parseScenario(text, "small/scenario.yaml").value())),
        environment_(game_control::makeScene(*scenario_, smallStructures()).value(),
                     simulation::EnvironmentOptions{}),
        machine_(scenario_) {
    environment_.setHandPresent(kRight, true);
    setHandPose(Pose(Vector3(0.2, 0, 0.2)));
    machine_.start(environment_);
  }

  void setHandPose(const Pose& X_WH) { environment_.setHandPose(kRight, X_WH, Twist{}); }
  void step(const std::vector<game_control::GameCommand>& commands = {}) {
    machine_.step(environment_, commands);
    environment_.step();
  }
  void step(int ticks) {
    for (int i = 0; i < ticks; ++i) step();
  }
  /// Moves the right hand in a straight line at 0.3 m/s.
  void moveTo(const Vector3& p_WH) {
    const Vector3 from = environment_.hands()[0].X_WH.translation();
    const int ticks = 1 + static_cast<int>((p_WH - from).norm() / 0.3e-3);
    for (int i = 1; i <= ticks; ++i) {
      setHandPose(Pose(from + (p_WH - from) * (static_cast<double>(i) / ticks)));
      step();
    }
  }
  void touchPart() {
    moveTo(Vector3(0.2, 0, 0.129));
    for (int i = 0; i < 500 && machine_.status().step == 0; ++i) step();
    step(2);
  }
  /// Moves the held part over the socket and down, 1 mm off centre, so that it meets the wall first.
  void insertPart() {
    const Vector3 p_PH = -environment_.hands()[0].X_HO.translation();
    moveTo(Vector3(0.2, 0, 0.15) + p_PH);
    moveTo(Vector3(0.001, 0, 0.05) + p_PH);
    moveTo(Vector3(0.001, 0, -0.02) + p_PH);
  }

  [[nodiscard]] const game_control::StepStatus& status() const { return machine_.status(); }
  [[nodiscard]] const simulation::ObjectMotion& object(const std::string& name) const {
    return environment_.objects()[scenario_->objectNamed(name).value];
  }
  [[nodiscard]] std::uint64_t hash() const {
    StateHash hash;
    hash.add(environment_.hash());
    machine_.addTo(hash);
    return hash.value();
  }
  simulation::Environment& environment() { return environment_; }
  game_control::StateMachine& machine() { return machine_; }
  [[nodiscard]] const game_control::ScenarioFile& scenario() const { return *scenario_; }

  static constexpr HandId kRight{0};

 private:
  std::shared_ptr<const game_control::ScenarioFile> scenario_;
  simulation::Environment environment_;
  game_control::StateMachine machine_;
};

}  // namespace tenon::test
