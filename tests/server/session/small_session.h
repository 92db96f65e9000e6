#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/session/exercise.h"
#include "server/session/scene_loader.h"
#include "tests/server/game_control/exercise.h"
#include "tests/server/game_control/scenario_text.h"

namespace tenon::test {

inline constexpr HandId kRightHand{0}, kTeacherHand{1}, kLeftHand{2};

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

inline LoadedScene smallSession(const std::string& text = twoHandedScenario()) {
  const auto scenario =
      std::make_shared<const ScenarioFile>(parseScenario(text, "small/scenario.yaml").value());
  std::vector<StructuresPtr> structures = smallStructures();
  if (scenario->objects.size() > structures.size()) structures.push_back(structures[2]);
  return {scenario, makeScene(*scenario, std::move(structures)).value()};
}

/// Its exercise, and people whose hands are where the test says.
class Stage {
 public:
  explicit Stage(unsigned workers = 1, std::vector<HandId> needed = {})
      : loaded_(smallSession()), exercise_(makeExercise(loaded_, workers, std::move(needed))) {
    output_ = exercise_.makeOutput();
  }
  static tenon::Exercise makeExercise(const LoadedScene& loaded, unsigned workers = 1,
                                      std::vector<HandId> needed = {}) {
    ExerciseOptions options;
    options.environment.workers = workers;
    options.needed_hands = std::move(needed);
    return {loaded.scenario, loaded.scene, options};
  }

  void attach(HandId hand, const Vector3& p_WH) {
    change({.kind = ChangeKind::kAttach, .hand = hand});
    speaking_.push_back({.hand = hand, .X_WH = Pose(p_WH)});
  }
  void move(HandId hand, const Vector3& p_WH) { reading(hand).X_WH = Pose(p_WH); }
  HandReading& reading(HandId hand) {
    for (HandReading& reading : speaking_)
      if (reading.hand == hand) return reading;
    return speaking_.emplace_back(HandReading{.hand = hand});
  }
  /// Its link is cut: no more readings.
  void silence(HandId hand) {
    std::erase_if(speaking_, [&](const HandReading& reading) { return reading.hand == hand; });
  }
  void change(const Change& change) { input_.changes.push_back(change); }

  const TickOutput& tick(int ticks = 1) {
    for (int i = 0; i < ticks; ++i) {
      input_.tick = exercise_.now() + 1;
      for (HandReading& reading : speaking_) {
        reading.seq = static_cast<std::uint32_t>(input_.tick);
        input_.readings.push_back(reading);
      }
      exercise_.tick(input_);
      exercise_.fill(output_);
      input_.readings.clear();
      input_.changes.clear();
    }
    return output_;
  }

  tenon::Exercise& exercise() { return exercise_; }
  [[nodiscard]] const TickOutput& output() const { return output_; }
  [[nodiscard]] const LoadedScene& loaded() const { return loaded_; }
  [[nodiscard]] const HandMotion& hand(HandId hand) const {
    return exercise_.environment().hands()[hand.value];
  }
  [[nodiscard]] const ObjectMotion& object(const std::string& name) const {
    return exercise_.environment().objects()[loaded_.scenario->objectNamed(name).value];
  }

 private:
  LoadedScene loaded_;
  tenon::Exercise exercise_;
  std::vector<HandReading> speaking_;
  TickInput input_;
  TickOutput output_;
};

/// The same whole exercise every time: the right hand touches the part, takes it, meets the socket's wall on
/// the way and mounts it within kPlayTicks, while the teacher's cube runs into the left pointer.
///
///   1        240     700      800        1500              1650              1800
///   above -> touch, wait  ->  lift  ->  over the socket -> at its wall  -> down
inline constexpr Tick kPlayTicks = 2100;

inline TickInput play(Tick tick) {
  struct Waypoint {
    double tick;
    Vector3 p_WH;
  };
  static const std::vector<Waypoint> right{{0, {0.2, 0, 0.2}},        {240, {0.2, 0, 0.129}},
                                           {700, {0.2, 0, 0.129}},    {800, {0.2, 0, 0.18}},
                                           {1500, {0.0015, 0, 0.08}}, {1650, {0.0015, 0, 0.04}},
                                           {1800, {0.001, 0, 0.009}}, {9000, {0.001, 0, 0.009}}};
  static const std::vector<Waypoint> teacher{
      {0, {0.3, 0.2, 0.2}}, {1000, {0.48, 0, 0.2}}, {9000, {0.48, 0, 0.2}}};
  static const std::vector<Waypoint> left{{0, {0.5, 0, 0.2}}, {9000, {0.5, 0.01, 0.2}}};
  const auto at = [&](const std::vector<Waypoint>& way) {
    const auto now = static_cast<double>(tick);
    std::size_t i = 1;
    while (i + 1 < way.size() && way[i].tick < now) ++i;
    const double share = (now - way[i - 1].tick) / (way[i].tick - way[i - 1].tick);
    return Vector3(way[i - 1].p_WH + (way[i].p_WH - way[i - 1].p_WH) * share);
  };
  TickInput input;
  input.tick = tick;
  const auto add = [&](HandId hand, const std::vector<Waypoint>& way) {
    if (tick == 1) input.changes.push_back({.kind = ChangeKind::kAttach, .hand = hand});
    input.readings.push_back({.hand = hand, .seq = static_cast<std::uint32_t>(tick), .X_WH = Pose(at(way))});
  };
  add(kRightHand, right);
  add(kTeacherHand, teacher);
  add(kLeftHand, left);
  return input;
}

}  // namespace tenon::test
