#include "server/game_control/scenario_reader.h"

#include <algorithm>
#include <array>
#include <system_error>

#include "idl/types/hash.h"
#include "server/game_control/named_values.h"
#include "server/game_control/scenario_state_reader.h"
#include "server/game_control/text_limits.h"
#include "server/structures/voxel_limits.h"

namespace tenon::game_control {
namespace {

constexpr std::size_t kMaxScenarioObjects = 64;
constexpr std::size_t kMaxScenarioHands = 16;

constexpr NamedValues<ObjectStatus, 6> kStatuses{{{"hidden", ObjectStatus::kHidden},
                                                  {"parked", ObjectStatus::kParked},
                                                  {"held", ObjectStatus::kHeld},
                                                  {"tracked", ObjectStatus::kTracked},
                                                  {"fixed", ObjectStatus::kFixed},
                                                  {"free", ObjectStatus::kFree}}};
constexpr NamedValues<Role, 2> kRoles{{{"trainee", Role::kTrainee}, {"instructor", Role::kInstructor}}};
constexpr NamedValues<simulation::HandKind, 2> kHandKinds{
    {{"coupled", simulation::HandKind::kCoupled}, {"tracked", simulation::HandKind::kTracked}}};
constexpr std::array<std::string_view, 7> kObjectKinds{"part",    "tool", "pointer", "assistant",
                                                       "forearm", "head", "scene"};

bool isColor(const std::string& word) {
  return (word.size() == 7 || word.size() == 9) && word[0] == '#' &&
         word.find_first_not_of("0123456789abcdefABCDEF", 1) == std::string::npos;
}

}  // namespace

ScenarioReader::ScenarioReader(const std::filesystem::path& path, const ReadOptions& options)
    : yaml_(path.string()), options_(options), names_(yaml_, scenario_) {
  scenario_.path = path;
  std::error_code unknown;
  scenario_.name = std::filesystem::absolute(path, unknown).parent_path().filename().string();
}

Result<ScenarioFile> ScenarioReader::read(std::string_view text) {
  StateHash hash;
  hash.add(text);
  scenario_.text_hash = hash.value();
  try {
    readScenario(YAML::Load(std::string(text)));
  } catch (const YAML::Exception& problem) {
    const int line = problem.mark.is_null() ? 1 : problem.mark.line + 1;
    yaml_.failAt(line, "not valid YAML: " + problem.msg);
  }
  if (yaml_.failed()) return tl::unexpected(yaml_.error());
  return std::move(scenario_);
}

void ScenarioReader::readScenario(const YAML::Node& root) {
  if (!yaml_.openMapping(root, "scenario", "a scenario")) return;
  if (root["language"].IsDefined()) scenario_.language = yaml_.text(root["language"], "'language'");
  scenario_.title = names_.texts(root["title"], "'title'", kMaxTitle);
  if (root["parts"].IsDefined()) {
    scenario_.part_set = yaml_.text(root["parts"], "'parts'");
    scenario_.part_set_line = yaml_.lineOf(root["parts"]);
  }
  if (scenario_.title.empty()) scenario_.title.push_back({scenario_.language, scenario_.name});
  scenario_.reach =
      yaml_.numberOr(root["reach"], Quantity::kLength, "'reach'", 0.01, 1000.0, scenario_.reach);
  if (root["gravity"].IsDefined()) {
    constexpr double kMaxGravity = 100.0;  // [m/s^2] ten times that of the earth
    scenario_.gravity_W = yaml_.vector(root["gravity"], Quantity::kPlain, "'gravity'");
    if (scenario_.gravity_W.norm() > kMaxGravity)
      yaml_.fail(root["gravity"], "'gravity' is more than 100 m/s^2");
  }

  if (!yaml_.checkList(root["objects"], "'objects'", kMaxScenarioObjects)) return;
  for (const auto& object : root["objects"]) readObject(object);
  if (scenario_.objects.empty())
    yaml_.fail(root["objects"], "'objects' is empty, expected at least one object");
  if (yaml_.failed() || !yaml_.checkList(root["hands"], "'hands'", kMaxScenarioHands)) return;
  for (const auto& hand : root["hands"]) readHand(hand);
  if (scenario_.hands.empty()) yaml_.fail(root["hands"], "'hands' is empty, expected at least one hand");
  if (yaml_.failed() || options_.only_names) return;

  std::erase_if(options_.taken, [this](const HandAssignment& take) {
    return take.hand.value >= scenario_.hands.size() || take.object.value >= scenario_.objects.size();
  });
  listPairs(root["states"]);
  if (root["pairs"].IsDefined() && yaml_.checkList(root["pairs"], "'pairs'")) {
    for (const auto& pair : root["pairs"]) readPair(pair);
  }
  if (root["pairs_off"].IsDefined() && yaml_.checkList(root["pairs_off"], "'pairs_off'")) {
    for (const auto& pair : root["pairs_off"]) readDisabledPair(pair);
  }
  if (yaml_.failed()) return;
  ScenarioStateReader states(yaml_, scenario_, options_.taken);
  if (options_.needs_states || root["states"].IsDefined()) {
    states.read(root["states"]);
  } else {
    states.addEndlessState();
  }
}

void ScenarioReader::readObject(const YAML::Node& node) {
  if (yaml_.failed() || !yaml_.openMapping(node, "object", "an object")) return;
  ScenarioObject object;
  object.line = yaml_.lineOf(node);
  object.name = yaml_.text(node["name"], "'name' of an object", kMaxObjectName);
  const std::string of = " of object '" + object.name + "'";
  if (const ObjectId other = scenario_.objectNamed(object.name); other.valid()) {
    yaml_.fail(node["name"], "two objects are named '" + object.name + "', the first in line " +
                                 std::to_string(scenario_.objects[other.value].line));
    return;
  }
  object.title = names_.texts(node["title"], "'title'" + of, kMaxTitle);
  if (object.title.empty()) object.title.push_back({scenario_.language, object.name});
  if (node["kind"].IsDefined()) object.kind = yaml_.text(node["kind"], "'kind'" + of, kMaxKind);
  if (std::find(kObjectKinds.begin(), kObjectKinds.end(), object.kind) == kObjectKinds.end()) {
    yaml_.fail(node["kind"], "'kind'" + of + " is '" + object.kind +
                                 "', expected one of: part, tool, pointer, assistant, forearm, head, scene");
  }
  if (node["color"].IsDefined()) object.color = yaml_.text(node["color"], "'color'" + of);
  if (!isColor(object.color)) {
    yaml_.fail(node["color"],
               "'color'" + of + " is '" + object.color + "', expected '#rrggbb' or '#rrggbbaa'");
  }
  if (node["group"].IsDefined()) object.group = names_.group(node["group"], "'group'" + of);
  object.collidable = yaml_.boolean(node["collidable"], "'collidable'" + of, true);
  object.stiffness =
      yaml_.numberOr(node["stiffness"], Quantity::kStiffness, "'stiffness'" + of, 1.0, 1e6, object.stiffness);
  if (node["body"].IsDefined()) readBody(node["body"], object);
  object.status = oneOf(yaml_, node["status"], "'status'" + of, kStatuses,
                        object.body ? ObjectStatus::kFree : ObjectStatus::kParked);
  if (object.status == ObjectStatus::kFree && !object.body)
    yaml_.fail(node["status"],
               "object '" + object.name + "' is free but has no 'body', expected one with its mass");
  if (node["start"].IsDefined() && yaml_.openMapping(node["start"], "pose", "'start'" + of)) {
    object.X_WO = yaml_.pose(node["start"], "'start'" + of);
  }
  readMeshes(node["meshes"], object);
  if (node["structures"].IsDefined()) readStructures(node["structures"], object);
  scenario_.objects.push_back(std::move(object));
}

void ScenarioReader::readStructures(const YAML::Node& node, ScenarioObject& object) {
  const std::string of = "of 'structures' of object '" + object.name + "'";
  if (!yaml_.openMapping(node, "structures", "'structures' of object '" + object.name + "'")) return;
  StructureSettings& settings = object.structures;
  settings.voxel = yaml_.numberOr(node["voxel"], Quantity::kLength, "'voxel' " + of,
                                  structures::kSmallestVoxel, structures::kLargestVoxel, settings.voxel);
  settings.refinement = static_cast<std::int32_t>(
      yaml_.integer(node["refinement"], "'refinement' " + of, 1, 8, settings.refinement));
  if ((settings.refinement & (settings.refinement - 1)) != 0) {
    yaml_.fail(node["refinement"], "'refinement' " + of + " must be 1, 2, 4 or 8");
  }
  settings.points = static_cast<std::uint32_t>(
      yaml_.integer(node["points"], "'points' " + of, 10, 10'000'000, settings.points));
  settings.spacing = yaml_.numberOr(node["spacing"], Quantity::kLength, "'spacing' " + of, 1e-5, 1.0, 0.0);
  const YAML::Node boxes = node["refine"];
  if (!boxes.IsDefined() || !yaml_.checkList(boxes, "'refine' " + of)) return;
  for (const auto& entry : boxes) {
    if (!yaml_.openMapping(entry, "box", "a box " + of)) return;
    const Vector3 from = yaml_.vector(entry["from"], Quantity::kLength, "'from' of a box " + of);
    const Vector3 to = yaml_.vector(entry["to"], Quantity::kLength, "'to' of a box " + of);
    if (!(from.array() < to.array()).all()) {
      yaml_.fail(entry, "a box " + of + " is empty, expected 'from' below 'to' in x, y and z");
    }
    settings.refine.emplace_back(from, to);
  }
}

void ScenarioReader::readHand(const YAML::Node& node) {
  if (yaml_.failed() || !yaml_.openMapping(node, "hand", "a hand")) return;
  ScenarioHand hand;
  hand.line = yaml_.lineOf(node);
  hand.name = yaml_.text(node["name"], "'name' of a hand", kMaxHandName);
  const std::string of = " of hand '" + hand.name + "'";
  if (const HandId other = scenario_.handNamed(hand.name); other.valid()) {
    yaml_.fail(node["name"], "two hands are named '" + hand.name + "', the first in line " +
                                 std::to_string(scenario_.hands[other.value].line));
  }
  hand.role = oneOf(yaml_, node["role"], "'role'" + of, kRoles, Role::kTrainee);
  hand.kind = oneOf(yaml_, node["kind"], "'kind'" + of, kHandKinds, simulation::HandKind::kCoupled);
  hand.object = names_.object(node["object"], "'object'" + of);
  hand.stiffness =
      yaml_.numberOr(node["stiffness"], Quantity::kStiffness, "'stiffness'" + of, 1.0, 1e5, hand.stiffness);
  hand.rotational_stiffness =
      yaml_.numberOr(node["rotational_stiffness"], Quantity::kRotationalStiffness,
                     "'rotational_stiffness'" + of, 0.01, 1e4, hand.rotational_stiffness);
  for (const ScenarioHand& other : scenario_.hands) {
    if (hand.object.valid() && other.object == hand.object) {
      yaml_.fail(node["object"], "hands '" + other.name + "' and '" + hand.name + "' have the same object '" +
                                     names_.nameOf(hand.object) + "'");
    }
  }
  if (!yaml_.failed()) scenario_.hands.push_back(hand);
}

}  // namespace tenon::game_control
