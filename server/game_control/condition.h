#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"
#include "server/game_control/game_command.h"

namespace tenon::game_control {

inline constexpr std::size_t kMaxConditions = 32;  ///< nodes of one state's condition tree, groups included

enum class ConditionKind : std::uint8_t {
  kAll,          ///< group: every child is met
  kAny,          ///< group: at least one child is met
  kPose,         ///< `object` is at X_WG: its centre within `within`, its orientation within `angle`
  kForce,        ///< the magnitude of the force on `object` is between `above` and `below`
  kForceTarget,  ///< the force on `object` differs from F_W by at most `within`
  kContact,      ///< `object` and `other` were in contact for `limit_ticks`, interrupted for `lapse` at most
  kContactTime,  ///< the accumulated time of `object` in contact with anything reaches `limit_ticks`
  kFulfilled,    ///< a person sends the command kFulfilled in this tick
  kSignal,       ///< an external program sends the signal number `signal` in this tick
};

/// A node of a condition tree (paper Fig. 4). Parents precede their children; node 0 is the root.
struct Condition {
  ConditionKind kind = ConditionKind::kAll;
  std::uint32_t parent = 0;  ///< index in the tree; the root is its own parent
  /// group: a child that was met once stays met; else all must be met in the same tick
  bool latched = false;
  std::uint32_t dwell = 0;  ///< [ticks] it must hold without interruption before it is met
  ObjectId object;
  ObjectId other;                                          ///< kContact
  Pose X_WG;                                               ///< kPose: target pose of `object`
  double within = 0.0;                                     ///< [m] of kPose, [N] of kForceTarget
  double angle = 0.0;                                      ///< [rad] kPose
  double above = 0.0;                                      ///< [N] kForce
  double below = std::numeric_limits<double>::infinity();  ///< [N] kForce
  Vector3 F_W = Vector3::Zero();                           ///< [N] kForceTarget
  std::uint32_t limit_ticks = 0;                           ///< [ticks] kContact, kContactTime
  std::uint32_t lapse = 0;   ///< [ticks] kContact: a longer interruption resets the time
  std::uint32_t signal = 0;  ///< kSignal: index into ScenarioFile::signals
};

[[nodiscard]] constexpr bool isGroup(ConditionKind kind) {
  return kind == ConditionKind::kAll || kind == ConditionKind::kAny;
}

/// Read access to the simulation state that conditions are evaluated on: an Environment, or a test's values.
///
/// Threads: one caller. Real-time: all.
class SceneView {
 public:
  virtual ~SceneView() = default;
  [[nodiscard]] virtual Pose pose(ObjectId object) const noexcept = 0;  ///< X_WO
  /// [m] p_OQ_O: of its bounding sphere; an object's position is that of its centre.
  [[nodiscard]] virtual Vector3 centre(ObjectId object) const noexcept = 0;
  /// [N] in W, as Environment::forceOn
  [[nodiscard]] virtual Vector3 force(ObjectId object) const noexcept = 0;
  [[nodiscard]] virtual bool inContact(ObjectId a, ObjectId b) const noexcept = 0;
  [[nodiscard]] virtual bool inAnyContact(ObjectId object) const noexcept = 0;
};

/// Progress of one condition, for displays.
struct ConditionReading {
  /// pose: position error [m]; force: [N]; contact: [s]; group, command, signal: count [-]
  double value = 0.0;
  double limit = 0.0;  ///< [unit of `value`] at which it is met, other parts of the condition aside
  bool met = false;
};

/// Measures how long two objects have been in contact. Interruptions up to a limit (tremor of the hand) do
/// not reset the time, but are not counted either.
struct ContactTimer {
  std::uint32_t contact_ticks = 0;  ///< [ticks] in contact
  std::uint32_t apart_ticks = 0;    ///< [ticks] since the last contact

  /// After `ticks` [ticks]; 0: nothing changes.
  void step(bool in_contact, std::uint32_t lapse, std::uint32_t ticks) noexcept {
    if (in_contact && ticks > 0) {
      contact_ticks += ticks;
      apart_ticks = 0;
    } else if (!in_contact && (apart_ticks += ticks) > lapse) {
      contact_ticks = 0;
    }
  }
};

/// [unit of the reading's value] The limit of a node of the tree, which is known before it is evaluated: of a
/// group how many of its children are to be met.
[[nodiscard]] double limitOf(std::span<const Condition> tree, std::size_t node) noexcept;

/// Evaluates one condition tree tick by tick. Its whole state is tick counters and the last readings, so a
/// re-simulation decides the same.
///
/// Threads: one caller. Real-time: all.
class ConditionProgress {
 public:
  void reset() noexcept { *this = {}; }

  /// After `ticks` [ticks], 0 or 1: true when the root is met, false for an empty tree. At most
  /// kMaxConditions nodes (assert).
  bool step(std::span<const Condition> tree, const SceneView& scene, std::span<const GameCommand> commands,
            std::uint32_t ticks = 1) noexcept;

  /// Progress of a node (index in the tree), as of the last step.
  [[nodiscard]] const ConditionReading& reading(std::size_t node) const { return nodes_[node].reading; }

  /// Calls `visit(number)` for each number of the mutable state in a fixed order, for hashing, saving and
  /// restoring.
  template <typename Visitor>
  void visitMemory(Visitor&& visit) {
    for (Node& node : nodes_) {
      visit(node.held_ticks);
      visit(node.contact.contact_ticks);
      visit(node.contact.apart_ticks);
      visit(node.latched);
      visit(node.reading.value);
      visit(node.reading.limit);
      visit(node.reading.met);
    }
  }

 private:
  struct Node {
    std::uint32_t held_ticks = 0;  ///< [ticks] it has held without interruption
    ContactTimer contact;
    bool latched = false;  ///< was met once under a latching group
    ConditionReading reading;
  };
  [[nodiscard]] static bool isMetNow(const Condition& condition, Node& node, const SceneView& scene,
                                     std::span<const GameCommand> commands, std::uint32_t ticks) noexcept;

  std::array<Node, kMaxConditions> nodes_{};
};

/// The angle [rad], 0 to pi, of the rotation between two orientations; q and -q are the same orientation.
[[nodiscard]] double angleBetween(const Quaternion& q_WA, const Quaternion& q_WB) noexcept;

/// [m] Distance of an object's centre from where it is with the object at X_WG.
[[nodiscard]] double positionError(const SceneView& scene, ObjectId object, const Pose& X_WG) noexcept;

}  // namespace tenon::game_control
