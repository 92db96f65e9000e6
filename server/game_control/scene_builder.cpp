#include <algorithm>
#include <cmath>
#include <utility>

#include "server/game_control/quantity_text.h"
#include "server/game_control/scenario.h"
#include "server/game_control/scenario_moments.h"

namespace tenon::game_control {
namespace {

using StructuresByObject = std::vector<std::shared_ptr<const structures::HapticStructures>>;

constexpr double kDilationPerClearance = 0.25;  // [-] on each side of the part
constexpr double kEdgeError = 0.2;              // [voxels] of a solid at an edge, where it has no dilation
constexpr double kRounding = 1e-9;              // [-] relative: a typed number equal to a limit is within it
constexpr double kTargetMargin = 1.0;    // [m] a target farther outside the scene is taken for a mistake
constexpr double kFarthestOrigin = 1e3;  // [m] of a frame: coordinates in it keep their micrometres

ObjectId otherObject(const ScenarioPair& pair, ObjectId object) { return pair.a == object ? pair.b : pair.a; }

/// Whether `field` has refined voxels where the other object of the pair is mounted.
bool isRefined(const ScenarioFile& scenario, const ScenarioPair& pair, ObjectId field) {
  return !scenario.objects[field.value].structures.refine.empty() || sdfSideByTarget(scenario, pair) == field;
}

/// [m] Edge of the voxels of `field` where a part with a clearance is mounted.
double mountingVoxel(const ScenarioFile& scenario, const ScenarioPair& pair, ObjectId field) {
  const StructureSettings& settings = scenario.objects[field.value].structures;
  return isRefined(scenario, pair, field) ? settings.voxel / settings.refinement : settings.voxel;
}

/// `needed` [m]: the smallest clearance that the field resolves.
std::string clearanceTooSmall(const ScenarioFile& scenario, const ScenarioPair& pair, ObjectId field,
                              double needed) {
  const StructureSettings& settings = scenario.objects[field.value].structures;
  const double voxel = mountingVoxel(scenario, pair, field);
  const double fraction = pair.clearance / needed;
  // two significant digits, rounded down: the advised voxel passes this check
  const double exact_mm = settings.voxel * fraction * 1e3;
  const double step_mm = std::pow(10.0, std::floor(std::log10(exact_mm)) - 1.0);
  const double advised = std::floor(exact_mm / step_mm + kRounding) * step_mm * 1e-3;
  // a refinement that is not set yet, and a box for it where there is none
  const bool refined = isRefined(scenario, pair, field);
  std::string refinement;
  for (const int factor : {2, 4, 8}) {
    const double finer = needed / voxel * settings.voxel / factor;
    const bool helps = finer <= pair.clearance && (!refined || factor > settings.refinement);
    if (!refinement.empty() || !helps) continue;
    refinement = " or " + std::string(refined ? "" : "a box in 'refine' around the place, with ") +
                 "refinement " + std::to_string(factor);
  }
  const std::string divided = voxel < settings.voxel ? " / " + std::to_string(settings.refinement) : "";
  return "clearance of " + scenario.objects[pair.a.value].name + "-" + scenario.objects[pair.b.value].name +
         " (" + inMillimetres(pair.clearance) + ") is smaller than the field of '" +
         scenario.objects[field.value].name + "' can resolve (voxel " + inMillimetres(settings.voxel) +
         divided + " needs " + inMillimetres(needed) + " there); use voxel " + inMillimetres(advised) +
         refinement;
}

Eigen::AlignedBox3d boxIn(const Pose& X_AB, const Eigen::AlignedBox3d& box_B) {
  Eigen::AlignedBox3d box_A;
  for (int corner = 0; corner < 8; ++corner) {
    box_A.extend(X_AB * Vector3(box_B.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner))));
  }
  return box_A;
}

bool isAlwaysPointshell(const ScenarioObject& object) {
  return object.kind == "pointer" || object.kind == "assistant";
}

/// The SDF side of a pair: what a part is mounted into, never a pointer or assistant, else the larger object.
ObjectId sdfSideOf(const ScenarioFile& scenario, const ScenarioPair& pair,
                   const StructuresByObject& structures) {
  const ObjectId by_target = sdfSideByTarget(scenario, pair);
  if (by_target.valid()) return by_target;
  const bool a_is_pointshell = isAlwaysPointshell(scenario.objects[pair.a.value]);
  const bool b_is_pointshell = isAlwaysPointshell(scenario.objects[pair.b.value]);
  if (a_is_pointshell != b_is_pointshell) return a_is_pointshell ? pair.b : pair.a;
  const auto size = [&](ObjectId object) { return structures[object.value]->info.box_M.diagonal().norm(); };
  return size(pair.a) > size(pair.b) ? pair.a : pair.b;
}

std::string fileAndLine(const ScenarioFile& scenario, int line) {
  return scenario.path.string() + ":" + std::to_string(line) + ": ";
}

Result<void> checkStructures(const ScenarioFile& scenario, const StructuresByObject& structures) {
  if (structures.size() != scenario.objects.size()) {
    return fail(scenario.path.string() + ": " + std::to_string(structures.size()) + " structures for " +
                std::to_string(scenario.objects.size()) + " objects");
  }
  for (std::size_t i = 0; i < structures.size(); ++i) {
    const ScenarioObject& object = scenario.objects[i];
    if (object.collidable && !structures[i]) {
      return fail(fileAndLine(scenario, object.line) + "object '" + object.name +
                  "' has no haptic structures, expected them baked or 'collidable: false'");
    }
  }
  return {};
}

/// The boxes of `field`, in its frame, in which the other object of a pair is mounted: of the given ones
/// those at its targets, and one around each target that none of these intersects.
std::vector<Eigen::AlignedBox3d> mountingBoxes(const ScenarioFile& scenario,
                                               const std::vector<SceneMoment>& moments,
                                               const ScenarioPair& pair, ObjectId field,
                                               const StructuresByObject& structures) {
  std::vector<Eigen::AlignedBox3d> boxes;
  const StructureSettings& settings = scenario.objects[field.value].structures;
  const ObjectId part = otherObject(pair, field);
  if (part.value >= structures.size() || !structures[part.value]) return boxes;
  for (std::size_t i = 0; i < scenario.states.size(); ++i) {
    const ScenarioState& state = scenario.states[i];
    if (state.object != part || !state.X_WG) continue;
    const Pose X_OW = moments[i].X_WO[field.value].inverse();
    Eigen::AlignedBox3d box_O = boxIn(X_OW * *state.X_WG, structures[part.value]->info.box_M);
    bool covered = false;
    for (const Eigen::AlignedBox3d& given_O : settings.refine) {
      if (!given_O.intersects(box_O)) continue;
      boxes.push_back(given_O);
      covered = true;
    }
    if (covered) continue;
    // from the target back along the approach
    const Vector3 back_O = X_OW.rotation() * Vector3(-state.approach_W * state.approach_distance);
    box_O.extend(box_O.translated(back_O));
    const Vector3 margin = Vector3::Constant(pair.clearance + 2.0 * settings.voxel);
    boxes.emplace_back(box_O.min() - margin, box_O.max() + margin);
  }
  return boxes;
}

/// A pose that the scenario gives to an object.
struct GivenPose {
  ObjectId object;
  Pose X_WO;
  int line = 0;
  std::string what;  ///< "the target of state 'mount'"
  bool is_target = false;
};

std::vector<GivenPose> givenPoses(const ScenarioFile& scenario) {
  std::vector<GivenPose> poses;
  for (std::uint32_t i = 0; i < scenario.objects.size(); ++i) {
    const ScenarioObject& object = scenario.objects[i];
    poses.push_back({ObjectId{i}, object.X_WO, object.line, "the start of object '" + object.name + "'"});
  }
  for (const ScenarioState& state : scenario.states) {
    const std::string of = " of state '" + state.name + "'";
    for (const Placement& placement : state.placements) {
      if (!placement.X_WO) continue;
      const std::string& name = scenario.objects[placement.object.value].name;
      poses.push_back(
          {placement.object, *placement.X_WO, state.line, "the place of '" + name + "' at the begin" + of});
    }
    if (state.X_WG) poses.push_back({state.object, *state.X_WG, state.line, "the target" + of, true});
  }
  return poses;
}

}  // namespace

ObjectId sdfSideByTarget(const ScenarioFile& scenario, const ScenarioPair& pair) {
  if (pair.clearance <= 0.0) return {};
  const auto a = firstTarget(scenario, pair.a);
  const auto b = firstTarget(scenario, pair.b);
  if (!a && !b) return {};
  // in a chain, what is mounted first is there when the other one comes
  return !a || (b && *a < *b) ? pair.a : pair.b;
}

std::vector<ObjectId> bakeOrder(const ScenarioFile& scenario) {
  std::vector<ObjectId> order;
  for (std::uint32_t i = 0; i < scenario.objects.size(); ++i) order.push_back(ObjectId{i});
  // an empty target is less than any: last
  std::stable_sort(order.begin(), order.end(), [&](ObjectId one, ObjectId other) {
    return firstTarget(scenario, one) > firstTarget(scenario, other);
  });
  return order;
}

std::vector<Eigen::AlignedBox3d> refineBoxes(const ScenarioFile& scenario, ObjectId object,
                                             const StructuresByObject& structures) {
  std::vector<Eigen::AlignedBox3d> boxes = scenario.objects[object.value].structures.refine;
  const std::vector<SceneMoment> moments = momentsOf(scenario);
  for (const ScenarioPair& pair : scenario.pairs) {
    if (sdfSideByTarget(scenario, pair) != object) continue;
    for (const Eigen::AlignedBox3d& box_O : mountingBoxes(scenario, moments, pair, object, structures)) {
      const bool given =
          std::any_of(boxes.begin(), boxes.end(), [&](const auto& one_O) { return one_O.isApprox(box_O); });
      if (!given) boxes.push_back(box_O);
    }
  }
  return boxes;
}

Result<void> checkClearance(const ScenarioFile& scenario, const std::vector<SceneMoment>& moments,
                            const ScenarioPair& pair, ObjectId field, const StructuresByObject& structures) {
  if (pair.clearance <= 0.0) return {};
  std::vector<Eigen::AlignedBox3d> places = mountingBoxes(scenario, moments, pair, field, structures);
  if (places.empty()) places = scenario.objects[field.value].structures.refine;
  if (places.empty()) places.push_back(structures[field.value]->field.box());
  double proud = kEdgeError * mountingVoxel(scenario, pair, field);
  for (const Eigen::AlignedBox3d& place : places)
    proud = std::max(proud, structures[field.value]->field.largestDilation(place));
  const double needed = proud / kDilationPerClearance;
  if (needed <= pair.clearance * (1.0 + kRounding)) return {};
  return fail(fileAndLine(scenario, pair.line) + clearanceTooSmall(scenario, pair, field, needed));
}

std::vector<Misplacement> misplacedObjects(const ScenarioFile& scenario,
                                           const StructuresByObject& structures) {
  Eigen::AlignedBox3d scene_W;
  for (std::size_t i = 0; i < structures.size(); ++i)
    if (structures[i]) scene_W.extend(boxIn(scenario.objects[i].X_WO, structures[i]->info.box_M));
  std::vector<Misplacement> misplaced;
  for (const GivenPose& pose : givenPoses(scenario)) {
    const Vector3 p_WQ = pose.X_WO * simulation::boundingSphereOf(structures[pose.object.value].get()).p_OQ_O;
    const double outside = scene_W.isEmpty() ? 0.0 : scene_W.exteriorDistance(p_WQ);
    const auto add = [&](double distance, const std::string& problem) {
      misplaced.push_back({pose.object, p_WQ, distance, pose.line, pose.what + problem});
    };
    if (pose.X_WO.translation().norm() > kFarthestOrigin) {
      add(pose.X_WO.translation().norm(),
          " has its 'at' more than 1 km from the world's origin, expected a mesh with its origin nearer to "
          "the part");
    } else if (p_WQ.norm() > scenario.reach) {
      add(p_WQ.norm(), " is " + inMillimetres(p_WQ.norm()) +
                           " from the world's origin, expected at most 'reach', " +
                           inMillimetres(scenario.reach));
    } else if (pose.is_target && outside > kTargetMargin) {
      add(outside, " is " + inMillimetres(outside) + " outside the box of all objects, expected it within " +
                       inMillimetres(kTargetMargin));
    }
  }
  return misplaced;
}

Result<std::shared_ptr<const simulation::Scene>> makeScene(const ScenarioFile& scenario,
                                                           StructuresByObject structures) {
  if (const auto checked = checkStructures(scenario, structures); !checked)
    return tl::unexpected(checked.error());
  if (const auto misplaced = misplacedObjects(scenario, structures); !misplaced.empty())
    return fail(fileAndLine(scenario, misplaced.front().line) + misplaced.front().what);
  auto scene = std::make_shared<simulation::Scene>();
  scene->gravity_W = scenario.gravity_W;

  for (std::size_t i = 0; i < structures.size(); ++i) {
    const ScenarioObject& object = scenario.objects[i];
    simulation::ObjectSpec spec;
    spec.name = object.name;
    spec.title = object.title.front().text;
    spec.titles = object.title;
    spec.kind = object.kind;
    spec.color = object.color;
    spec.group = object.group;
    spec.X_WO = object.X_WO;
    spec.status = object.status;
    spec.structures = object.collidable ? structures[i] : nullptr;
    spec.stiffness = object.stiffness;
    if (object.body) {
      const auto body = bodyOf(object, *structures[i]);
      if (!body) return fail(fileAndLine(scenario, object.body->line) + body.error().what);
      spec.body = *body;
    }
    scene->objects.push_back(std::move(spec));
  }
  const std::vector<SceneMoment> moments = momentsOf(scenario);
  for (const ScenarioPair& pair : scenario.pairs) {
    const ObjectId field = sdfSideOf(scenario, pair, structures);
    if (const auto checked = checkClearance(scenario, moments, pair, field, structures); !checked)
      return tl::unexpected(checked.error());
    simulation::PairSpec spec{otherObject(pair, field), field, pair.enabled, pair.sensing, pair.friction};
    if (pair.clearance > 0.0) spec.most_dilation_a = kDilationPerClearance * pair.clearance;
    scene->pairs.push_back(spec);
  }
  for (const ScenarioHand& hand : scenario.hands) {
    simulation::HandSpec& spec = scene->hands.emplace_back();
    spec.name = hand.name;
    spec.role = hand.role;
    spec.kind = hand.kind;
    spec.object = hand.object;
    if (hand.stiffness > 0.0) spec.stiffness = hand.stiffness;
    if (hand.rotational_stiffness > 0.0) spec.rotational_stiffness = hand.rotational_stiffness;
  }
  return std::shared_ptr<const simulation::Scene>(std::move(scene));
}

}  // namespace tenon::game_control
