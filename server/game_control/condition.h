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

namespace tenon {

inline constexpr std::size_t kMaxConditions = 32;  ///< of one state, groups included

enum class ConditionKind : std::uint8_t {
  kAll,          ///< every child
  kAny,          ///< at least one child
  kPose,         ///< `object` is at X_WG within the tolerances
  kForce,        ///< |F| on `object` is between above and below
  kForceTarget,  ///< the force on `object` is F_W within the tolerance
  kContact,      ///< `object` and `other` have touched for `limit_ticks`, gaps shorter than `lapse` forgiven
  kContactTime,  ///< `object` has touched anything for `limit_ticks` in sum
  kFulfilled,    ///< somebody says so
  kSignal,       ///< an external program says so
};

/// A node of a condition tree (paper Fig. 4). Parents stand before their children; node 0 is the root.
struct Condition {
  ConditionKind kind = ConditionKind::kAll;
  std::uint32_t parent = 0;  ///< index in the tree; the root's is itself
  bool latched = false;  ///< of a group: a child once met stays met; else they must be met in the same tick
  std::uint32_t dwell = 0;  ///< [ticks] it must hold without a break before it counts
  ObjectId object;
  ObjectId other;
  Pose X_WG;
  double within = 0.0;                                     ///< [m] of kPose, [N] of kForceTarget
  double angle = 0.0;                                      ///< [rad]
  double above = 0.0;                                      ///< [N]
  double below = std::numeric_limits<double>::infinity();  ///< [N]
  Vector3 F_W = Vector3::Zero();
  std::uint32_t limit_ticks = 0;
  std::uint32_t lapse = 0;  ///< [ticks]
  std::uint32_t signal = 0;
};

[[nodiscard]] constexpr bool isGroup(ConditionKind kind) {
  return kind == ConditionKind::kAll || kind == ConditionKind::kAny;
}

/// What conditions ask of a scene: the Environment's answers, or a test's.
///
/// Threads: one caller. Real-time: all.
class SceneView {
 public:
  virtual ~SceneView() = default;
  [[nodiscard]] virtual Pose pose(ObjectId object) const noexcept = 0;      ///< X_WO
  [[nodiscard]] virtual Vector3 force(ObjectId object) const noexcept = 0;  ///< in W
  [[nodiscard]] virtual bool touching(ObjectId a, ObjectId b) const noexcept = 0;
  [[nodiscard]] virtual bool touchesAnything(ObjectId object) const noexcept = 0;
};

/// How far a condition is, for displays.
struct ConditionReading {
  double value = 0.0;  ///< pose: position error [m]; force: [N]; contact: [s]; command, signal: 0 or 1
  double limit = 0.0;
  bool met = false;
};

/// Counts for how long two things have touched; a hand trembles, so short gaps are forgiven (and not
/// counted).
struct ContactTimer {
  std::uint32_t touched = 0;  ///< [ticks]
  std::uint32_t away = 0;     ///< [ticks] since the last touch

  void step(bool touching, std::uint32_t lapse) noexcept {
    if (touching) {
      ++touched;
      away = 0;
    } else if (++away > lapse) {
      touched = 0;
    }
  }
};

/// Evaluates one condition tree tick by tick; all memory is counters of ticks, so a replay decides the same.
///
/// Threads: one caller. Real-time: all.
class ConditionProgress {
 public:
  void reset() noexcept { *this = {}; }

  /// One tick: true when the root is met. At most kMaxConditions nodes.
  bool step(std::span<const Condition> tree, const SceneView& scene,
            std::span<const GameCommand> commands) noexcept;

  /// Of a node, as of the last step.
  [[nodiscard]] const ConditionReading& reading(std::size_t node) const { return nodes_[node].reading; }

  /// Calls `visit(number)` with each number of its memory, in a fixed order: what is hashed, saved and
  /// restored.
  template <typename Visitor>
  void visitMemory(Visitor&& visit) {
    for (Node& node : nodes_) {
      visit(node.held);
      visit(node.contact.touched);
      visit(node.contact.away);
      visit(node.latched);
      visit(node.reading.value);
      visit(node.reading.limit);
      visit(node.reading.met);
    }
  }

 private:
  struct Node {
    std::uint32_t held = 0;  ///< [ticks] without a break
    ContactTimer contact;
    bool latched = false;  ///< met once under a latching group
    ConditionReading reading;
  };
  [[nodiscard]] static bool isMetNow(const Condition& condition, Node& node, const SceneView& scene,
                                     std::span<const GameCommand> commands) noexcept;

  std::array<Node, kMaxConditions> nodes_{};
};

/// The angle between two orientations [rad].
[[nodiscard]] double angleBetween(const Quaternion& q_WA, const Quaternion& q_WB) noexcept;

}  // namespace tenon
