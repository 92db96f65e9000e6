#include "server/game_control/condition_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "server/game_control/text_limits.h"

namespace tenon::game_control {
namespace {

constexpr int kMaxNesting = 8;         // groups in groups; a YAML alias can make a group contain itself
constexpr double kLargestForce = 1e4;  // [N]

constexpr std::array<std::pair<std::string_view, ConditionKind>, 8> kKinds{{
    {"all", ConditionKind::kAll},
    {"any", ConditionKind::kAny},
    {"pose", ConditionKind::kPose},
    {"force", ConditionKind::kForce},
    {"contact", ConditionKind::kContact},
    {"contact_time", ConditionKind::kContactTime},
    {"command", ConditionKind::kFulfilled},
    {"signal", ConditionKind::kSignal},
}};

}  // namespace

std::uint32_t toTicks(double seconds) {
  return static_cast<std::uint32_t>(std::floor(seconds / kTickSeconds + 0.5));
}

std::vector<Condition> ConditionReader::read(const YAML::Node& node) {
  tree_.clear();
  if (node.IsSequence()) {
    addGroup(node, node, Condition{}, 0);
  } else {
    add(node, 0, 0);
  }
  return std::move(tree_);
}

void ConditionReader::add(const YAML::Node& node, std::uint32_t parent, int depth) {
  if (yaml_.failed() || !yaml_.openMapping(node, "condition", "a condition")) return;
  if (tree_.size() == kMaxConditions) {
    yaml_.fail(node,
               "state '" + state_.name + "' has more than " + std::to_string(kMaxConditions) + " conditions");
    return;
  }
  Condition condition;
  condition.parent = parent;
  int kinds = 0;
  YAML::Node given;
  for (const auto& [word, kind] : kKinds) {
    const YAML::Node value = node[std::string(word)];
    if (!value.IsDefined()) continue;
    ++kinds;
    condition.kind = kind;
    given.reset(value);
  }
  if (kinds != 1) {
    yaml_.fail(node, "a condition has " + std::to_string(kinds) +
                         " of 'all', 'any', 'pose', 'force', 'contact', 'contact_time', 'command', 'signal', "
                         "expected one");
    return;
  }
  const bool is_event =
      condition.kind == ConditionKind::kFulfilled || condition.kind == ConditionKind::kSignal;
  if (is_event && node["dwell"].IsDefined()) {
    yaml_.fail(node["dwell"], "a command or signal lasts one tick, it cannot have a 'dwell'");
  }
  if (!isGroup(condition.kind) && node["when"].IsDefined()) {
    yaml_.fail(node["when"], "'when' belongs to 'all' or 'any'");
  }
  condition.dwell =
      readTicks(node["dwell"], "'dwell'", condition.kind == ConditionKind::kPose ? kPoseDwell : 0.0);
  switch (condition.kind) {
    case ConditionKind::kAll:
    case ConditionKind::kAny:
      addGroup(node, given, condition, depth);
      return;
    case ConditionKind::kPose:
      readPose(given, condition);
      break;
    case ConditionKind::kForce:
    case ConditionKind::kForceTarget:
      readForce(given, condition);
      break;
    case ConditionKind::kContact:
      readContact(given, condition);
      break;
    case ConditionKind::kContactTime:
      readContactTime(given, condition);
      break;
    case ConditionKind::kFulfilled:
      readCommand(given, condition);
      break;
    case ConditionKind::kSignal:
      readSignal(given, condition);
      break;
  }
  tree_.push_back(condition);
}

void ConditionReader::addGroup(const YAML::Node& node, const YAML::Node& children, Condition condition,
                               int depth) {
  if (depth == kMaxNesting) {
    yaml_.fail(children, "conditions are nested more than " + std::to_string(kMaxNesting) + " deep");
    return;
  }
  if (!yaml_.checkList(children, "'all' or 'any'", kMaxConditions)) return;
  if (children.size() == 0) {
    yaml_.fail(children, "'all' or 'any' is empty, expected at least one condition");
    return;
  }
  if (node.IsMap() && node["when"].IsDefined()) {
    const std::string when = yaml_.text(node["when"], "'when'");
    if (when != "together" && when != "latched") {
      yaml_.fail(node["when"], "'when' is '" + when + "', expected 'together' or 'latched'");
    }
    condition.latched = when == "latched";
  }
  const auto group = static_cast<std::uint32_t>(tree_.size());
  tree_.push_back(condition);
  for (const auto& child : children) add(child, group, depth + 1);
}

void ConditionReader::readPose(const YAML::Node& node, Condition& condition) {
  // short form `pose: target`: the state's object at the state's target
  const bool short_form = node.IsScalar() && node.Scalar() == "target";
  if (!short_form && !yaml_.openMapping(node, "pose_condition", "a pose condition")) return;
  const YAML::Node nothing(YAML::NodeType::Undefined);
  const YAML::Node target = short_form ? nothing : YAML::Node(node["target"]);
  condition.object =
      short_form ? state_.object : objectOrDefault(node["object"], "'object' of a pose condition");
  condition.within = state_.tolerance;
  condition.angle = state_.angle_tolerance;
  if (!short_form) {
    condition.within = yaml_.numberOr(node["within"], Quantity::kLength, "'within'", kSmallestTolerance, 1e3,
                                      state_.tolerance);
    condition.angle = yaml_.numberOr(node["angle"], Quantity::kAngle, "'angle'", kSmallestTolerance,
                                     std::numbers::pi, state_.angle_tolerance);
  }
  const bool own_target = !target.IsDefined() || (target.IsScalar() && target.Scalar() == "target");
  if (own_target) {
    if (!state_.X_WG) {
      yaml_.fail(node, "state '" + state_.name + "' has a pose condition, but no target pose");
    } else if (condition.object.valid() && condition.object != state_.object) {
      yaml_.fail(node, "the target pose of state '" + state_.name + "' is not that of '" +
                           names_.nameOf(condition.object) + "', expected a 'target' of its own");
    } else {
      condition.X_WG = *state_.X_WG;
    }
  } else if (yaml_.openMapping(target, "pose", "'target' of a pose condition")) {
    condition.X_WG = yaml_.pose(target, "'target' of a pose condition");
  }
  if (!condition.object.valid())
    yaml_.fail(node, "a pose condition of state '" + state_.name + "' has no object");
}

void ConditionReader::readForce(const YAML::Node& node, Condition& condition) {
  if (!yaml_.openMapping(node, "force_condition", "a force condition")) return;
  condition.object = objectOrDefault(node["object"], "'object' of a force condition");
  if (!condition.object.valid())
    yaml_.fail(node, "a force condition of state '" + state_.name + "' has no object");
  const bool bounds = node["above"].IsDefined() || node["below"].IsDefined();
  const bool target = node["target"].IsDefined();
  if (bounds == target) {
    yaml_.fail(node, "a force condition needs either 'above' and/or 'below', or 'target' and 'within'");
    return;
  }
  if (target) {
    condition.kind = ConditionKind::kForceTarget;
    condition.F_W = yaml_.vector(node["target"], Quantity::kForce, "'target' of a force condition");
    condition.within = yaml_.number(node["within"], Quantity::kForce, "'within' of a force condition",
                                    kSmallestTolerance, kLargestForce);
    return;
  }
  condition.above =
      yaml_.numberOr(node["above"], Quantity::kForce, "'above'", 0.0, kLargestForce, condition.above);
  condition.below =
      yaml_.numberOr(node["below"], Quantity::kForce, "'below'", 0.0, kLargestForce, condition.below);
  if (condition.above >= condition.below) {
    yaml_.fail(node, "no force is within these limits, expected 'above' < 'below'");
  }
}

void ConditionReader::readContact(const YAML::Node& node, Condition& condition) {
  if (!yaml_.openMapping(node, "contact_condition", "a contact condition")) return;
  const auto objects = names_.twoObjects(node["between"], "'between' of a contact condition");
  if (!objects || !names_.pair(node["between"], "'between' of a contact condition")) return;
  condition.object = objects->first;
  condition.other = objects->second;
  condition.limit_ticks = readTicks(node["for"], "'for'", 0.0);
  condition.lapse = readTicks(node["lapse"], "'lapse'", kContactLapse);
}

void ConditionReader::readContactTime(const YAML::Node& node, Condition& condition) {
  if (!yaml_.openMapping(node, "contact_time_condition", "a contact time condition")) return;
  condition.object = objectOrDefault(node["object"], "'object' of a contact time condition");
  if (!condition.object.valid())
    yaml_.fail(node, "a contact time of state '" + state_.name + "' has no object");
  if (!node["at_least"].IsDefined())
    yaml_.fail(node, "a contact time condition needs 'at_least', such as 0.5 s");
  condition.limit_ticks = readTicks(node["at_least"], "'at_least'", 0.0);
}

void ConditionReader::readCommand(const YAML::Node& node, Condition& /*condition*/) {
  const std::string command = yaml_.text(node, "'command'");
  if (command != "fulfilled") yaml_.fail(node, "'command' is '" + command + "', expected 'fulfilled'");
}

void ConditionReader::readSignal(const YAML::Node& node, Condition& condition) {
  const std::string name = yaml_.text(node, "'signal'", kMaxSignalName);
  const auto found = std::find(signals_.begin(), signals_.end(), name);
  condition.signal = static_cast<std::uint32_t>(found - signals_.begin());
  if (found == signals_.end()) signals_.push_back(name);
}

ObjectId ConditionReader::objectOrDefault(const YAML::Node& node, const std::string& what) {
  return node.IsDefined() ? names_.object(node, what) : state_.object;
}

std::uint32_t ConditionReader::readTicks(const YAML::Node& node, const std::string& what,
                                         double default_value) {
  return toTicks(yaml_.numberOr(node, Quantity::kTime, what, 0.0, kLongestTime, default_value));
}

}  // namespace tenon::game_control
