#include "tests/bench/stability/situation.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "server/simulation/compiled_scene.h"

namespace tenon::bench {
namespace {

constexpr double kReach = 0.02;      // [m] the arm's intent beyond the contact
constexpr double kKick = 0.005;      // [m] either side of it
constexpr double kDepth = 1e-3;      // [m] mean depth of a device whose motion is given
constexpr double kStroke = 0.05;     // [m] of the moving part
constexpr double kSpeed = 0.1;       // [m/s] of the moving part
constexpr double kReversal = 0.05;   // [s] that its reversals take
constexpr double kMovesFrom = 2.7;   // [s]
constexpr double kMovesUntil = 3.7;  // [s] in the held contact: then it stands still
constexpr double kSettling = 0.2;    // [s] after a reversal until motion counts as steady
constexpr int kTurnPhases = 5;       // of turns in the period of slow answers

/// [-] From 0 at `from` to 1 at `to`, without a jerk.
double ease(double t, double from, double to) {
  const double s = std::clamp((t - from) / (to - from), 0.0, 1.0);
  return s * s * s * (10.0 + s * (6.0 * s - 15.0));
}

double wave(double t, double frequency) {
  return std::sin(2.0 * std::numbers::pi * frequency * (t - kPressed));
}

/// From `clearance` [m] before a contact whose normal is `normal` to beyond it, with a kick.
HandPath pressing(const Vector3& normal, double clearance) {
  return [=](double t) {
    const double kick = t < kKickAt ? -kKick : kKick;
    return Pose(Vector3(-ease(t, kPressAt, kPressed) * (clearance + kReach + kick) * normal));
  };
}

/// As pressing(), to kDepth; then about it, along the surfaces, and with small turns.
HandPath probing(const Vector3& normal, const Vector3& along, double turn, double clearance) {
  return [=](double t) {
    const double s = ease(t, kPressAt, kPressed);
    const double depth = kDepth * (1.0 + 0.5 * wave(t, 1.0) * s);
    return Pose(Vector3(-s * (clearance + depth) * normal + 0.003 * s * wave(t, 0.7) * along),
                expRotation(turn * s * wave(t, 1.3) * along));
  };
}

/// [m] Place of a part that goes to and fro at kSpeed from kMovesFrom to `until`, from the middle.
double strokeAt(double t, double until) {
  const double period = 2.0 * kStroke / kSpeed;
  const auto triangle = [&](double time) {
    const double phase = std::fmod(std::max(0.0, time) / period + 0.25, 1.0);
    return kStroke * (phase < 0.5 ? 2.0 * phase - 0.5 : 1.5 - 2.0 * phase);
  };
  // the mean over kReversal of a triangle turns with constant acceleration
  constexpr int kSamples = 25;
  double sum = 0.0;
  for (int i = 0; i < kSamples; ++i)
    sum += triangle(std::min(t, until) - kMovesFrom + kReversal * ((i + 0.5) / kSamples - 1.0));
  return sum / kSamples;
}

bool strokeIsSteady(double t) {
  const double half = kStroke / kSpeed;
  const double since = std::fmod(t - kMovesFrom + 0.5 * half, half);
  return t > kMovesFrom + 0.5 * half && since > kSettling + kReversal;
}

/// Along y, as strokeAt().
Vector3 carriedTo(double t, double until) { return {0.0, strokeAt(t, until), 0.0}; }

std::string fixedBox(const char* name, const Vector3& size, const Vector3& at) {
  return fmt::format(
      "  - name: {}\n    kind: scene\n    meshes: [{{box: [{} m, {} m, {} m]}}]\n"
      "    structures: {{voxel: 2 mm, spacing: 5 mm, refinement: 1}}\n    start: {{at: [{}, {}, {}]}}\n"
      "    status: fixed\n",
      name, size.x(), size.y(), size.z(), at.x(), at.y(), at.z());
}

/// A box that a hand moves: its pointer, or what `more` makes of it.
std::string movedBox(const char* name, const Vector3& size, const Vector3& at, const char* more) {
  return fmt::format(
      "  - name: {}\n    meshes: [{{box: [{} m, {} m, {} m]}}]\n"
      "    structures: {{voxel: 2 mm, spacing: 2 mm, refinement: 1}}\n    start: {{at: [{}, {}, {}]}}\n{}",
      name, size.x(), size.y(), size.z(), at.x(), at.y(), at.z(), more);
}

constexpr const char* kPointer = "    kind: pointer\n";

Result<session::LoadedScene> load(const std::string& name, const std::string& objects,
                                  const std::string& rest, const std::filesystem::path& cache) {
  const std::string text = fmt::format("title: {}\nreach: 2 m\nobjects:\n{}{}", name, objects, rest);
  game_control::ReadOptions read;
  read.needs_states = false;
  auto parsed = game_control::parseScenario(text, name + ".yaml", read);
  if (!parsed) return fail(parsed.error().what);
  auto scenario = std::make_shared<const game_control::ScenarioFile>(std::move(*parsed));
  auto loaded = session::loadStructures(scenario, {.cache = cache, .read = read});
  if (!loaded) return fail(loaded.error().what);
  auto scene = game_control::makeScene(*scenario, loaded->structures);
  if (!scene) return fail(scene.error().what);
  return session::LoadedScene{scenario, *scene};
}

constexpr const char* kOneHand = "hands:\n  - {name: right, object: block}\n";
constexpr double kClearance = 0.01;  // [m] before a contact, where a hand begins

RigSituation wall() {
  const Vector3 up = Vector3::UnitZ();
  return {.name = "wall",
          .title = "wall",
          .hands = {{"right", Vector3(0.0, 0.0, 0.02 + kClearance), pressing(up, kClearance),
                     probing(up, Vector3::UnitX(), 0.0, kClearance)}}};
}
std::string wallObjects() {
  return fixedBox("floor", {0.4, 0.4, 0.05}, {0.0, 0.0, -0.025}) +
         movedBox("block", {0.08, 0.08, 0.04}, {0.0, 0.0, 0.2}, kPointer);
}

//   y |wall|           the block's corner goes into that of floor and walls
//     |    |  .--.
//     |    |  '--'
//     |    '---------- wall
RigSituation corner() {
  const Vector3 out = Vector3(1.0, 1.0, 1.0);
  constexpr double kAway = 0.006;  // [m] along each axis
  return {.name = "corner",
          .title = "inner corner",
          .hands = {{"right", Vector3::Constant(0.03 + kAway), pressing(out, kAway),
                     probing(out, Vector3::Zero(), 0.0, kAway)}}};
}
std::string cornerObjects() {
  return fixedBox("floor", {0.3, 0.3, 0.05}, {0.1, 0.1, -0.025}) +
         fixedBox("wall_x", {0.05, 0.3, 0.3}, {-0.025, 0.1, 0.1}) +
         fixedBox("wall_y", {0.3, 0.05, 0.3}, {0.1, -0.025, 0.1}) +
         movedBox("block", {0.06, 0.06, 0.06}, {0.2, 0.2, 0.3}, kPointer);
}

constexpr double kPeg = 0.02;   // [m] its edge
constexpr double kPlay = 4e-4;  // [m] both sides together
//   |   | peg |   |   the peg stands in the hole, 5 mm above its ground
//   |   |     |   |
//   |   '-----'   |
//   '-------------'
RigSituation peg() {
  const Vector3 out = Vector3(1.0, 0.5, 1.0);
  constexpr double kAway = 0.005;
  return {.name = "peg",
          .title = "peg in hole",
          .hands = {{"right", Vector3(0.0, 0.0, 0.02 + kAway), pressing(out, kAway), [](double t) {
                       const double s = ease(t, kPressAt, kPressed);
                       const double side = kDepth + 0.5 * kPlay;
                       return Pose(Vector3(s * side * wave(t, 1.0), s * side * std::cos(6.28 * t),
                                           -s * (kAway + kDepth)),
                                   expRotation(Vector3(0.02 * s * wave(t, 1.3), 0.0, 0.0)));
                     }}}};
}
std::string pegObjects() {
  constexpr double kWall = 0.03, kHeight = 0.05;
  const double inner = 0.5 * (kPeg + kPlay), at = inner + 0.5 * kWall, outer = 2.0 * inner + 2.0 * kWall;
  return fixedBox("ground", {outer, outer, 0.03}, {0.0, 0.0, -0.015}) +
         fixedBox("east", {kWall, outer, kHeight}, {at, 0.0, 0.5 * kHeight}) +
         fixedBox("west", {kWall, outer, kHeight}, {-at, 0.0, 0.5 * kHeight}) +
         fixedBox("north", {outer, kWall, kHeight}, {0.0, at, 0.5 * kHeight}) +
         fixedBox("south", {outer, kWall, kHeight}, {0.0, -at, 0.5 * kHeight}) +
         movedBox("block", {kPeg, kPeg, 0.04}, {0.0, 0.0, 0.025}, kPointer);
}

constexpr double kBlock = 0.06;  // [m] edge of blocks that meet along x
//    carrier <-> |part||block| hand        both move by kStroke along x
RigSituation movingPart() {
  const Vector3 out = Vector3::UnitX();
  const auto partAt = [](double t) { return Vector3(strokeAt(t, kMovesUntil), 0.0, 0.0); };
  const auto always = [](double t) { return Vector3(strokeAt(t, kHeldUntil), 0.0, 0.0); };
  constexpr double kAway = 0.005;
  const HandPath press = pressing(out, kAway);
  const HandPath path = [=](double t) {
    return Pose(Vector3(always(t) - ease(t, kPressAt, 2.6) * (kAway + kDepth) * out));
  };
  RigSituation situation{
      .name = "moving",
      .title = "another's moving part",
      .hands = {{"right", Vector3(kBlock + kAway, 0.0, 0.0),
                 [=](double t) { return Pose(press(t).translation() + partAt(t)); }, path}},
      .carrier = RigHand{"left", Vector3::Zero(), [=](double t) { return Pose(partAt(t)); },
                         [=](double t) { return Pose(always(t)); }},
      .phases = kTurnPhases,
      .steady = strokeIsSteady};
  return situation;
}
std::string movingObjects() {
  return movedBox("block", {kBlock, kBlock, kBlock}, {0.3, 0.0, 0.0}, kPointer) +
         movedBox("part", {kBlock, 0.1, 0.1}, {-0.3, 0.0, 0.0}, kPointer);
}

//    left -> |  part  | <- right       both hold it, in free air, and carry it to and fro across that
RigSituation twoPeople() {
  const auto towards = [](double sign) {
    const HandPath press = pressing(sign * Vector3::UnitX(), 0.0);
    return std::pair<HandPath, HandPath>{
        [=](double t) { return Pose(Vector3(press(t).translation() + carriedTo(t, kMovesUntil))); },
        [=](double t) {
          const double s = ease(t, kPressAt, kPressed);
          const Vector3 squeeze(-sign * s * kDepth * (1.0 + 0.5 * wave(t, 1.0)), 0.0, 0.0);
          return Pose(Vector3(squeeze + carriedTo(t, kHeldUntil)));
        }};
  };
  const auto [right, right_path] = towards(1.0);
  const auto [left, left_path] = towards(-1.0);
  return {.name = "two_people",
          .title = "two people on one part",
          .hands = {{"right", Vector3(0.05, 0.0, 0.0), right, right_path},
                    {"left", Vector3(-0.05, 0.0, 0.0), left, left_path}},
          .phases = kTurnPhases,
          .steady = strokeIsSteady};
}
std::string sharedObjects() {
  return movedBox("part", {0.1, 0.06, 0.06}, {0.0, 0.0, 0.0}, "") +
         movedBox("tip_right", {0.01, 0.01, 0.01}, {0.3, 0.0, 0.0}, kPointer) +
         movedBox("tip_left", {0.01, 0.01, 0.01}, {-0.3, 0.0, 0.0}, kPointer) +
         fixedBox("post", {0.02, 0.02, 0.02}, {0.0, 0.0, 0.5});
}
constexpr const char* kTwoHands =
    "hands:\n  - {name: right, object: tip_right}\n  - {name: left, object: tip_left}\n"
    "states:\n  - {name: hold, title: Hold, instruction: Hold, hands: {right: part, left: part}, "
    "touch: post, object: part}\n";

//    hand -> |block||free part|      it floats in a medium: damping x mass x speed = 1 N at 0.1 m/s
RigSituation freePart() {
  constexpr double kWay = 0.06, kAway = 0.005, kStart = 2.3;
  const HandPath path = [](double t) {
    // kSpeed, after an acceleration over kReversal
    const double since = std::max(0.0, t - kStart);
    const double way =
        since < kReversal ? 0.5 * kSpeed / kReversal * since * since : kSpeed * (since - 0.5 * kReversal);
    return Pose(Vector3(std::min(way, kAway + kWay) - 0.03, 0.0, 0.0));
  };
  return {.name = "free_part",
          .title = "pushing a free part",
          .hands = {{"right", Vector3(-kBlock - kAway, 0.0, 0.0), path, path}},
          .is_held = false,
          .steady = [](double t) { return t > kPressed && t < kStart + 0.6; }};
}
std::string freeObjects() {
  return movedBox("block", {kBlock, kBlock, kBlock}, {-0.3, 0.0, 0.0}, kPointer) +
         movedBox("part", {kBlock, 0.1, 0.1}, {-0.03, 0.0, 0.0},
                  "    status: free\n    body: {mass: 1 kg, floating: true, damping: 10}\n");
}

}  // namespace

Result<std::vector<RigSituation>> makeSituations(const std::filesystem::path& cache) {
  struct Entry {
    RigSituation situation;
    std::string objects;
    const char* rest;
  };
  const char* const two = "hands:\n  - {name: right, object: block}\n  - {name: left, object: part}\n";
  std::vector<Entry> entries;
  entries.push_back({wall(), wallObjects(), kOneHand});
  entries.push_back({corner(), cornerObjects(), kOneHand});
  entries.push_back({peg(), pegObjects(), kOneHand});
  entries.push_back({movingPart(), movingObjects(), two});
  entries.push_back({twoPeople(), sharedObjects(), kTwoHands});
  entries.push_back({freePart(), freeObjects(), kOneHand});
  std::vector<RigSituation> situations;
  for (Entry& entry : entries) {
    auto loaded = load(entry.situation.name, entry.objects, entry.rest, cache);
    if (!loaded) return fail(loaded.error().what);
    const auto bytes = simulation::sceneBytes(*loaded->scene);
    if (!bytes) return fail(bytes.error().what);
    auto compiled = simulation::readScene(*bytes);
    if (!compiled) return fail(compiled.error().what);
    entry.situation.loaded = std::move(*loaded);
    entry.situation.compiled = std::move(*compiled);
    if (!entry.situation.steady) entry.situation.steady = [](double) { return true; };
    situations.push_back(std::move(entry.situation));
  }
  return situations;
}

}  // namespace tenon::bench
