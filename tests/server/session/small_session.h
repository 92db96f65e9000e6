#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/session/scene_loader.h"
#include "server/session/session_simulation.h"
#include "tests/server/game_control/scenario_fixture.h"
#include "tests/server/game_control/scenario_text.h"

namespace tenon::test {

inline constexpr HandId kRightHand{0}, kInstructorHand{1}, kLeftHand{2};

/// The small scenario with a left hand, its own pointer and a signal.
inline std::string twoHandedScenario() {
  std::string text = smallScenario();
  text = with(std::move(text), "hands:\n",
              "  - {name: spare, kind: pointer, meshes: [{part: spare}], structures: {voxel: 2 mm}, "
              "start: {at: [0.5, 0, 0.2]}}\nhands:\n");
  text = with(std::move(text), "pairs:\n", "  - {name: left, object: spare}\npairs:\n");
  return with(std::move(text), "    touch: part\n    for: 0.1 s\n",
              "    touch: part\n    conditions:\n      - any:\n"
              "          - {contact: {between: [pointer, part], for: 0.1 s}}\n"
              "          - {signal: bell}\n");
}

inline session::LoadedScene smallSession(const std::string& text = twoHandedScenario()) {
  const auto scenario = std::make_shared<const game_control::ScenarioFile>(
      game_control::parseScenario(text, "small/scenario.yaml").value());
  std::vector<StructuresPtr> structures = smallStructures();
  if (scenario->objects.size() > structures.size()) structures.push_back(structures[2]);
  return {scenario, game_control::makeScene(*scenario, std::move(structures)).value()};
}

/// A SessionSimulation of the small scenario with hands whose inputs the test sets.
class SessionRig {
 public:
  explicit SessionRig(unsigned workers = 1, std::vector<HandId> needed = {},
                      const std::string& text = twoHandedScenario())
      : loaded_(smallSession(text)), simulation_(makeSimulation(loaded_, workers, std::move(needed))) {
    output_ = simulation_.makeOutput();
  }
  static session::SessionSimulation makeSimulation(const session::LoadedScene& loaded, unsigned workers = 1,
                                                   std::vector<HandId> needed = {}) {
    session::SessionSimulationOptions options;
    options.environment.workers = workers;
    options.needed_hands = std::move(needed);
    return {loaded.scenario, loaded.scene, options};
  }

  void attach(HandId hand, const Vector3& p_WH) {
    change({.kind = session::ChangeKind::kAttach, .hand = hand});
    readings_.push_back({.hand = hand, .X_WH = Pose(p_WH)});
  }
  void move(HandId hand, const Vector3& p_WH) { reading(hand).X_WH = Pose(p_WH); }
  session::HandReading& reading(HandId hand) {
    for (session::HandReading& reading : readings_)
      if (reading.hand == hand) return reading;
    return readings_.emplace_back(session::HandReading{.hand = hand});
  }
  /// No more samples of this hand, as after a lost link.
  void loseLink(HandId hand) {
    std::erase_if(readings_, [&](const session::HandReading& reading) { return reading.hand == hand; });
  }
  void change(const session::Change& change) { input_.changes.push_back(change); }

  const session::TickOutput& tick(int ticks = 1) {
    for (int i = 0; i < ticks; ++i) {
      input_.tick = simulation_.now() + 1;
      for (session::HandReading& reading : readings_) {
        reading.seq = static_cast<std::uint32_t>(input_.tick);
        input_.readings.push_back(reading);
      }
      simulation_.tick(input_);
      simulation_.fill(output_);
      input_.readings.clear();
      input_.changes.clear();
    }
    return output_;
  }

  session::SessionSimulation& simulation() { return simulation_; }
  [[nodiscard]] const session::TickOutput& output() const { return output_; }
  [[nodiscard]] const session::LoadedScene& loaded() const { return loaded_; }
  [[nodiscard]] const simulation::HandMotion& hand(HandId hand) const {
    return simulation_.environment().hands()[hand.value];
  }
  [[nodiscard]] const simulation::ObjectMotion& object(const std::string& name) const {
    return simulation_.environment().objects()[loaded_.scenario->objectNamed(name).value];
  }

 private:
  session::LoadedScene loaded_;
  session::SessionSimulation simulation_;
  std::vector<session::HandReading> readings_;
  session::TickInput input_;
  session::TickOutput output_;
};

/// Scripted inputs of a whole session: the right hand touches the part, takes it, meets the wall of the
/// socket and mounts the part within kPlayTicks, while the instructor's cube runs into the left pointer.
///
///   1        240     700      800        1500              1650              1800
///   above -> touch, wait  ->  lift  ->  over the socket -> at its wall  -> down
inline constexpr Tick kPlayTicks = 2100;

inline session::TickInput playInput(Tick tick) {
  struct Waypoint {
    double tick;  // [ticks]
    Vector3 p_WH;
  };
  static const std::vector<Waypoint> right{{0, {0.2, 0, 0.2}},        {240, {0.2, 0, 0.129}},
                                           {700, {0.2, 0, 0.129}},    {800, {0.2, 0, 0.18}},
                                           {1500, {0.0015, 0, 0.08}}, {1650, {0.0015, 0, 0.04}},
                                           {1800, {0.001, 0, 0.009}}, {9000, {0.001, 0, 0.009}}};
  static const std::vector<Waypoint> instructor{
      {0, {0.3, 0.2, 0.2}}, {1000, {0.48, 0, 0.2}}, {9000, {0.48, 0, 0.2}}};
  static const std::vector<Waypoint> left{{0, {0.5, 0, 0.2}}, {9000, {0.5, 0.01, 0.2}}};
  const auto at = [&](const std::vector<Waypoint>& path) {
    const auto now = static_cast<double>(tick);
    std::size_t i = 1;
    while (i + 1 < path.size() && path[i].tick < now) ++i;
    const double fraction = (now - path[i - 1].tick) / (path[i].tick - path[i - 1].tick);
    return Vector3(path[i - 1].p_WH + (path[i].p_WH - path[i - 1].p_WH) * fraction);
  };
  session::TickInput input;
  input.tick = tick;
  const auto add = [&](HandId hand, const std::vector<Waypoint>& path) {
    if (tick == 1) input.changes.push_back({.kind = session::ChangeKind::kAttach, .hand = hand});
    input.readings.push_back({.hand = hand, .seq = static_cast<std::uint32_t>(tick), .X_WH = Pose(at(path))});
  };
  add(kRightHand, right);
  add(kInstructorHand, instructor);
  add(kLeftHand, left);
  return input;
}

}  // namespace tenon::test
