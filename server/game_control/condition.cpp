#include "server/game_control/condition.h"

#include <algorithm>
#include <cassert>

namespace tenon::game_control {
namespace {

bool anyCommand(std::span<const GameCommand> commands, CommandKind kind, std::uint32_t signal) noexcept {
  return std::any_of(commands.begin(), commands.end(), [&](const GameCommand& command) {
    return command.kind == kind && (kind != CommandKind::kSignal || command.signal == signal);
  });
}

double seconds(std::uint32_t ticks) noexcept { return ticks * kTickSeconds; }

}  // namespace

double limitOf(std::span<const Condition> tree, std::size_t node) noexcept {
  const Condition& condition = tree[node];
  switch (condition.kind) {
    case ConditionKind::kPose:
    case ConditionKind::kForceTarget:
      return condition.within;
    case ConditionKind::kForce:
      return condition.above > 0.0 ? condition.above : condition.below;
    case ConditionKind::kContact:
    case ConditionKind::kContactTime:
      return seconds(condition.limit_ticks);
    case ConditionKind::kAll: {
      double children = 0.0;
      for (std::size_t i = node + 1; i < tree.size(); ++i) children += tree[i].parent == node ? 1.0 : 0.0;
      return children;
    }
    case ConditionKind::kFulfilled:
    case ConditionKind::kSignal:
    case ConditionKind::kAny:
      break;
  }
  return 1.0;
}

double angleBetween(const Quaternion& q_WA, const Quaternion& q_WB) noexcept {
  return logRotation(q_WB * q_WA.conjugate()).norm();
}

double positionError(const SceneView& scene, ObjectId object, const Pose& X_WG) noexcept {
  const Vector3 p_OQ_O = scene.centre(object);
  return (scene.pose(object) * p_OQ_O - X_WG * p_OQ_O).norm();
}

bool ConditionProgress::isMetNow(const Condition& condition, Node& node, const SceneView& scene,
                                 std::span<const GameCommand> commands, std::uint32_t ticks) noexcept {
  ConditionReading& reading = node.reading;
  switch (condition.kind) {
    case ConditionKind::kPose:
      reading.value = positionError(scene, condition.object, condition.X_WG);
      reading.limit = condition.within;
      return reading.value <= condition.within && angleBetween(scene.pose(condition.object).rotation(),
                                                               condition.X_WG.rotation()) <= condition.angle;
    case ConditionKind::kForce:
      reading.value = scene.force(condition.object).norm();
      reading.limit = condition.above > 0.0 ? condition.above : condition.below;
      return reading.value >= condition.above && reading.value <= condition.below;
    case ConditionKind::kForceTarget:
      reading.value = (scene.force(condition.object) - condition.F_W).norm();
      reading.limit = condition.within;
      return reading.value <= condition.within;
    case ConditionKind::kContact:
      node.contact.step(scene.inContact(condition.object, condition.other), condition.lapse, ticks);
      reading.value = seconds(node.contact.contact_ticks);
      reading.limit = seconds(condition.limit_ticks);
      return node.contact.contact_ticks >= std::max(condition.limit_ticks, 1U);
    case ConditionKind::kContactTime:
      if (scene.inAnyContact(condition.object)) node.contact.contact_ticks += ticks;
      reading.value = seconds(node.contact.contact_ticks);
      reading.limit = seconds(condition.limit_ticks);
      return node.contact.contact_ticks >= condition.limit_ticks;
    case ConditionKind::kFulfilled:
    case ConditionKind::kSignal: {
      const bool fulfilled = condition.kind == ConditionKind::kFulfilled;
      const bool received =
          anyCommand(commands, fulfilled ? CommandKind::kFulfilled : CommandKind::kSignal, condition.signal);
      reading.value = received ? 1.0 : 0.0;
      reading.limit = 1.0;
      return received;
    }
    case ConditionKind::kAll:
    case ConditionKind::kAny:
      break;
  }
  return false;
}

bool ConditionProgress::step(std::span<const Condition> tree, const SceneView& scene,
                             std::span<const GameCommand> commands, std::uint32_t ticks) noexcept {
  assert(tree.size() <= kMaxConditions);
  // parents precede their children: in reverse order a group is evaluated after all of its children
  std::array<std::uint32_t, kMaxConditions> children{};
  std::array<std::uint32_t, kMaxConditions> met_children{};
  for (std::size_t i = tree.size(); i-- > 0;) {
    const Condition& condition = tree[i];
    Node& node = nodes_[i];
    bool met = false;
    if (isGroup(condition.kind)) {
      met = condition.kind == ConditionKind::kAll ? met_children[i] == children[i] : met_children[i] > 0;
      node.reading.value = met_children[i];
      node.reading.limit = condition.kind == ConditionKind::kAll ? children[i] : 1.0;
    } else {
      met = isMetNow(condition, node, scene, commands, ticks);
    }
    node.held_ticks = met ? node.held_ticks + ticks : 0;
    met = met && node.held_ticks >= condition.dwell;
    if (i > 0 && tree[condition.parent].latched) {
      node.latched = node.latched || met;
      met = node.latched;
    }
    node.reading.met = met;
    if (i > 0) {
      ++children[condition.parent];
      met_children[condition.parent] += met ? 1 : 0;
    }
  }
  return !tree.empty() && nodes_[0].reading.met;
}

}  // namespace tenon::game_control
