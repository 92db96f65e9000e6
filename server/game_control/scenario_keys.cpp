#include "server/game_control/scenario_keys.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <numeric>
#include <vector>

namespace tenon::game_control {
namespace {

using Key = std::string_view;

constexpr std::array<Key, 10> kScenario{"title",   "language", "parts", "reach",     "gravity",
                                        "objects", "hands",    "pairs", "pairs_off", "states"};
constexpr std::array<Key, 12> kObject{"name",       "title",      "kind",  "color",  "group",     "meshes",
                                      "collidable", "structures", "start", "status", "stiffness", "body"};
constexpr std::array<Key, 7> kBody{"mass", "density", "centre", "inertia", "floating", "damping", "friction"};
constexpr std::array<Key, 9> kMesh{"part", "file", "unit", "box", "sphere", "cylinder", "at", "turn", "q"};
constexpr std::array<Key, 3> kSphere{"radius", "diameter", "deviation"};
constexpr std::array<Key, 4> kCylinder{"radius", "diameter", "length", "deviation"};
constexpr std::array<Key, 5> kStructures{"voxel", "refinement", "points", "spacing", "refine"};
constexpr std::array<Key, 2> kBox{"from", "to"};
constexpr std::array<Key, 3> kPose{"at", "turn", "q"};
constexpr std::array<Key, 2> kTurn{"axis", "deg"};
constexpr std::array<Key, 6> kHand{"name", "role", "kind", "object", "stiffness", "rotational_stiffness"};
constexpr std::array<Key, 6> kPair{"between", "clearance", "sensing",
                                   "enabled", "friction",  "sliding_friction"};
constexpr std::array<Key, 24> kState{"name",       "title",   "instruction", "part", "hands",    "show",
                                     "hide",       "place",   "fix",         "free", "pairs_on", "pairs_off",
                                     "object",     "hand",    "touch",       "for",  "target",   "approach",
                                     "conditions", "timeout", "on_timeout",  "snap", "may_take", "groups"};
constexpr std::array<Key, 6> kTarget{"at", "turn", "q", "within", "angle", "dwell"};
constexpr std::array<Key, 2> kApproach{"direction", "distance"};
constexpr std::array<Key, 10> kCondition{"all",     "any",          "when",    "pose",   "force",
                                         "contact", "contact_time", "command", "signal", "dwell"};
constexpr std::array<Key, 4> kPoseCondition{"object", "target", "within", "angle"};
constexpr std::array<Key, 5> kForceCondition{"object", "above", "below", "target", "within"};
constexpr std::array<Key, 3> kContactCondition{"between", "for", "lapse"};
constexpr std::array<Key, 2> kContactTimeCondition{"object", "at_least"};

constexpr std::array kMappings{
    ScenarioMapping{"scenario", kScenario},
    ScenarioMapping{"object", kObject},
    ScenarioMapping{"body", kBody},
    ScenarioMapping{"mesh", kMesh},
    ScenarioMapping{"sphere", kSphere},
    ScenarioMapping{"cylinder", kCylinder},
    ScenarioMapping{"structures", kStructures},
    ScenarioMapping{"box", kBox},
    ScenarioMapping{"pose", kPose},
    ScenarioMapping{"turn", kTurn},
    ScenarioMapping{"hand", kHand},
    ScenarioMapping{"pair", kPair},
    ScenarioMapping{"state", kState},
    ScenarioMapping{"target", kTarget},
    ScenarioMapping{"approach", kApproach},
    ScenarioMapping{"condition", kCondition},
    ScenarioMapping{"pose_condition", kPoseCondition},
    ScenarioMapping{"force_condition", kForceCondition},
    ScenarioMapping{"contact_condition", kContactCondition},
    ScenarioMapping{"contact_time_condition", kContactTimeCondition},
};

/// Levenshtein distance: insertions, deletions and substitutions of letters that turn one word into the
/// other.
std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({substituted, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

std::span<const ScenarioMapping> scenarioMappings() { return kMappings; }

const ScenarioMapping& scenarioMapping(std::string_view name) {
  const auto found = std::find_if(kMappings.begin(), kMappings.end(),
                                  [&](const ScenarioMapping& mapping) { return mapping.name == name; });
  assert(found != kMappings.end());
  return *found;
}

std::string_view renamedKey(std::string_view mapping, std::string_view key) {
  return mapping == "object" && key == "felt" ? "collidable" : std::string_view{};
}

std::string_view removedKey(std::string_view mapping, std::string_view key) {
  const bool dilation = key == "dilation" && (mapping == "pair" || mapping == "structures");
  return dilation
             ? "thin walls are kept solid where they are; leave it out, and give 'refine' boxes where they "
               "must be thinner"
             : std::string_view{};
}

std::string suggestion(std::string_view word, std::span<const std::string_view> candidates) {
  constexpr std::size_t kLongestWord = 64;  // the distance takes quadratic time
  if (word.size() > kLongestWord) return {};
  std::string_view nearest;
  std::size_t smallest = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string_view candidate : candidates) {
    const std::size_t distance = editDistance(word, candidate);
    if (distance < smallest) {
      smallest = distance;
      nearest = candidate;
    }
  }
  return nearest.empty() ? std::string{} : "did you mean '" + std::string(nearest) + "'?";
}

}  // namespace tenon::game_control
