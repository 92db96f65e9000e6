#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "server/game_control/scenario.h"

namespace tenon::game_control {
namespace {

using StructuresByObject = std::vector<std::shared_ptr<const structures::HapticStructures>>;

constexpr double kDilationPerVoxel = 0.87;      // [-] sqrt(3)/2 rounded up: half the diagonal of a voxel
constexpr double kDilationPerClearance = 0.25;  // [-]
constexpr double kRounding = 1e-9;              // [-] relative: a typed number equal to a limit is within it
constexpr double kTargetMargin = 1.0;    // [m] a target farther outside the scene is taken for a mistake
constexpr double kFarthestOrigin = 1e3;  // [m] of a frame: coordinates in it keep their micrometres

/// "2.6 mm", three significant digits.
std::string inMillimetres(double metres) {
  std::array<char, 32> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%.3g mm", metres * 1e3);
  return buffer.data();
}

bool hasTarget(const ScenarioFile& scenario, ObjectId object) {
  return std::any_of(scenario.states.begin(), scenario.states.end(),
                     [&](const ScenarioState& state) { return state.object == object && state.X_WG; });
}

ObjectId otherObject(const ScenarioPair& pair, ObjectId object) { return pair.a == object ? pair.b : pair.a; }

/// [m] Edge of the voxels of `field` where a part with a clearance is mounted.
double mountingVoxel(const ScenarioFile& scenario, const ScenarioPair& pair, ObjectId field) {
  const StructureSettings& settings = scenario.objects[field.value].structures;
  const bool refined = !settings.refine.empty() || sdfSideByTarget(scenario, pair) == field;
  return refined ? settings.voxel / settings.refinement : settings.voxel;
}

std::string clearanceTooSmall(const ScenarioFile& scenario, const ScenarioPair& pair, ObjectId field) {
  const StructureSettings& settings = scenario.objects[field.value].structures;
  const double voxel = mountingVoxel(scenario, pair, field);
  const double needed = kDilationPerVoxel / kDilationPerClearance * voxel;
  const double fraction = pair.clearance / needed;
  // two significant digits, rounded down: the advised voxel passes this check
  const double exact_mm = settings.voxel * fraction * 1e3;
  const double step_mm = std::pow(10.0, std::floor(std::log10(exact_mm)) - 1.0);
  const double advised = std::floor(exact_mm / step_mm + kRounding) * step_mm * 1e-3;
  std::string refinement;
  for (const int factor : {2, 4, 8}) {
    const double finer = kDilationPerVoxel / kDilationPerClearance * settings.voxel / factor;
    if (refinement.empty() && finer <= pair.clearance)
      refinement = " or refinement " + std::to_string(factor);
  }
  const std::string divided = voxel < settings.voxel ? " / " + std::to_string(settings.refinement) : "";
  return "clearance of " + scenario.objects[pair.a.value].name + "-" + scenario.objects[pair.b.value].name +
         " (" + inMillimetres(pair.clearance) + ") is smaller than the field of '" +
         scenario.objects[field.value].name + "' can resolve (voxel " + inMillimetres(settings.voxel) +
         divided + " needs " + inMillimetres(needed) + "); use voxel " + inMillimetres(advised) + refinement;
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

/// All given poses put their objects' centres within reach. Where the frames' origins are does not matter.
Result<void> checkReach(const ScenarioFile& scenario, const StructuresByObject& structures) {
  const auto check = [&](ObjectId object, const Pose& X_WO, int line,
                         const std::string& what) -> Result<void> {
    const Vector3 p_OQ_O = simulation::boundingSphereOf(structures[object.value].get()).p_OQ_O;
    const double distance = (X_WO * p_OQ_O).norm();
    if (X_WO.translation().norm() > kFarthestOrigin)
      return fail(fileAndLine(scenario, line) + what +
                  " has its 'at' more than 1 km from the world's origin, " +
                  "expected a mesh with its origin nearer to the part");
    if (distance <= scenario.reach) return {};
    return fail(fileAndLine(scenario, line) + what + " is " + inMillimetres(distance) +
                " from the world's origin, expected at most 'reach', " + inMillimetres(scenario.reach));
  };
  for (std::uint32_t i = 0; i < scenario.objects.size(); ++i) {
    const ScenarioObject& object = scenario.objects[i];
    const auto checked =
        check(ObjectId{i}, object.X_WO, object.line, "the start of object '" + object.name + "'");
    if (!checked) return checked;
  }
  for (const ScenarioState& state : scenario.states) {
    const std::string of = " of state '" + state.name + "'";
    for (const Placement& placement : state.placements) {
      if (!placement.X_WO) continue;
      const std::string what =
          "the place of '" + scenario.objects[placement.object.value].name + "' at the begin" + of;
      if (const auto checked = check(placement.object, *placement.X_WO, state.line, what); !checked)
        return checked;
    }
    if (!state.X_WG) continue;
    if (const auto checked = check(state.object, *state.X_WG, state.line, "the target" + of); !checked)
      return checked;
  }
  return {};
}

Result<void> checkTargets(const ScenarioFile& scenario, const StructuresByObject& structures) {
  Eigen::AlignedBox3d scene_W;
  for (std::size_t i = 0; i < structures.size(); ++i) {
    if (structures[i]) scene_W.extend(boxIn(scenario.objects[i].X_WO, structures[i]->info.box_M));
  }
  if (scene_W.isEmpty()) return {};
  for (const ScenarioState& state : scenario.states) {
    if (!state.X_WG) continue;
    const Vector3 p_OQ_O = simulation::boundingSphereOf(structures[state.object.value].get()).p_OQ_O;
    const double outside = scene_W.exteriorDistance(Vector3(*state.X_WG * p_OQ_O));
    if (outside <= kTargetMargin) continue;
    return fail(fileAndLine(scenario, state.line) + "the target of state '" + state.name + "' is " +
                inMillimetres(outside) + " outside the box of all objects, expected it within " +
                inMillimetres(kTargetMargin));
  }
  return {};
}

}  // namespace

ObjectId sdfSideByTarget(const ScenarioFile& scenario, const ScenarioPair& pair) {
  if (pair.clearance <= 0.0) return {};
  const bool a_has_target = hasTarget(scenario, pair.a);
  const bool b_has_target = hasTarget(scenario, pair.b);
  if (a_has_target == b_has_target) return {};
  return a_has_target ? pair.b : pair.a;
}

std::vector<ObjectId> bakeOrder(const ScenarioFile& scenario) {
  const std::size_t count = scenario.objects.size();
  std::vector<ObjectId> order;
  std::vector<bool> ordered(count, false);
  const auto waitsForPart = [&](ObjectId object) {
    return std::any_of(scenario.pairs.begin(), scenario.pairs.end(), [&](const ScenarioPair& pair) {
      return sdfSideByTarget(scenario, pair) == object && !ordered[otherObject(pair, object).value];
    });
  };
  while (order.size() < count) {
    const std::size_t before = order.size();
    ObjectId first_remaining;
    for (std::uint32_t i = 0; i < count; ++i) {
      if (ordered[i]) continue;
      if (!first_remaining.valid()) first_remaining = ObjectId{i};
      if (waitsForPart(ObjectId{i})) continue;
      ordered[i] = true;
      order.push_back(ObjectId{i});
    }
    // parts that are mounted into each other: the one with the smallest id first
    if (order.size() == before) {
      ordered[first_remaining.value] = true;
      order.push_back(first_remaining);
    }
  }
  return order;
}

std::vector<Eigen::AlignedBox3d> refineBoxes(const ScenarioFile& scenario, ObjectId object,
                                             const StructuresByObject& structures) {
  const ScenarioObject& spec = scenario.objects[object.value];
  std::vector<Eigen::AlignedBox3d> boxes = spec.structures.refine;
  const Pose X_OW = spec.X_WO.inverse();
  for (const ScenarioPair& pair : scenario.pairs) {
    if (sdfSideByTarget(scenario, pair) != object) continue;
    const ObjectId part = otherObject(pair, object);
    if (part.value >= structures.size() || !structures[part.value]) continue;
    for (const ScenarioState& state : scenario.states) {
      if (state.object != part || !state.X_WG) continue;
      const Pose X_OG = X_OW * *state.X_WG;
      Eigen::AlignedBox3d box_O = boxIn(X_OG, structures[part.value]->info.box_M);
      const bool covered =
          std::any_of(spec.structures.refine.begin(), spec.structures.refine.end(),
                      [&](const Eigen::AlignedBox3d& refined_O) { return refined_O.intersects(box_O); });
      if (covered) continue;
      // from the target back along the approach
      const Vector3 back_O = X_OW.rotation() * Vector3(-state.approach_W * state.approach_distance);
      box_O.extend(box_O.translated(back_O));
      const Vector3 margin = Vector3::Constant(pair.clearance + 2.0 * spec.structures.voxel);
      boxes.emplace_back(box_O.min() - margin, box_O.max() + margin);
    }
  }
  return boxes;
}

Result<double> dilationOf(const ScenarioFile& scenario, const ScenarioPair& pair, ObjectId field) {
  const double voxel = scenario.objects[field.value].structures.voxel;
  if (pair.clearance <= 0.0) return pair.dilation.value_or(kDilationPerVoxel * voxel);
  const double min_dilation = kDilationPerVoxel * mountingVoxel(scenario, pair, field);
  const double max_dilation = kDilationPerClearance * pair.clearance;
  if (min_dilation > max_dilation * (1.0 + kRounding)) return fail(clearanceTooSmall(scenario, pair, field));
  const double dilation = pair.dilation.value_or(min_dilation);
  if (dilation < min_dilation * (1.0 - kRounding) || dilation > max_dilation * (1.0 + kRounding)) {
    return fail("dilation of " + scenario.objects[pair.a.value].name + "-" +
                scenario.objects[pair.b.value].name + " (" + inMillimetres(dilation) + ") must be between " +
                inMillimetres(min_dilation) + " (0.87 voxels) and " + inMillimetres(max_dilation) +
                " (a quarter of the clearance)");
  }
  return dilation;
}

Result<std::shared_ptr<const simulation::Scene>> makeScene(const ScenarioFile& scenario,
                                                           StructuresByObject structures) {
  if (const auto checked = checkStructures(scenario, structures); !checked)
    return tl::unexpected(checked.error());
  if (const auto checked = checkReach(scenario, structures); !checked) return tl::unexpected(checked.error());
  if (const auto checked = checkTargets(scenario, structures); !checked)
    return tl::unexpected(checked.error());
  auto scene = std::make_shared<simulation::Scene>();
  scene->gravity_W = scenario.gravity_W;

  for (std::size_t i = 0; i < structures.size(); ++i) {
    const ScenarioObject& object = scenario.objects[i];
    simulation::ObjectSpec spec;
    spec.name = object.name;
    spec.title = object.title.front().text;
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
  for (const ScenarioPair& pair : scenario.pairs) {
    const ObjectId field = sdfSideOf(scenario, pair, structures);
    const auto dilation = dilationOf(scenario, pair, field);
    if (!dilation) return fail(fileAndLine(scenario, pair.line) + dilation.error().what);
    scene->pairs.push_back(
        {otherObject(pair, field), field, *dilation, pair.enabled, pair.sensing, pair.friction});
  }
  for (const ScenarioHand& hand : scenario.hands) {
    scene->hands.push_back(
        {hand.name, hand.role, hand.kind, hand.object, hand.stiffness, hand.rotational_stiffness});
  }
  return std::shared_ptr<const simulation::Scene>(std::move(scene));
}

}  // namespace tenon::game_control
