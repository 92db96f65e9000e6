#pragma once

#include <memory>
#include <span>
#include <vector>

#include "idl/types/hash.h"
#include "idl/types/messages.h"
#include "idl/types/result.h"
#include "server/collision/island_solver.h"
#include "server/simulation/force_buffer.h"
#include "server/simulation/scene.h"
#include "server/simulation/work_limits.h"

namespace tenon {

/// What moves, per object. Index = ObjectId.
struct ObjectMotion {
  Pose X_WO;
  Twist V_WO;
  std::uint32_t epoch = 1;
  ObjectStatus status = ObjectStatus::kParked;
  HandId holder;  ///< the first of its holders, none when free
  bool in_contact = false;
  bool asleep = false;           ///< a free body that rests: it stands still until something stirs it
  std::uint32_t calm_ticks = 0;  ///< of a free body: it has hardly moved for so long
};

/// What a hand does, per hand. Index = HandId.
struct HandMotion {
  bool present = false;  ///< a client moves it
  bool frozen = false;   ///< its object is held still
  ObjectId object;       ///< what it moves now; none: nothing
  Pose X_WH;             ///< newest device pose
  Twist V_WH;
  Pose X_HO;                        ///< the object in the hand since it was taken
  Wrench F_Ho_W;                    ///< of the coupling on the hand, about the hand's origin
  ObjectId own;                     ///< its own first object: pointer, drill, cube, forearm
  Pose X_OR;                        ///< its own first object in the one it holds instead, since it took that
  bool posed = false;               ///< a pose was heard since it is present
  bool taken = false;               ///< moves `object`; false: will from its first pose on
  std::uint32_t refused_poses = 0;  ///< not finite, or no pose at all: ignored
};

/// What a pair did in the last tick. Index as in Scene::pairs.
struct PairMotion {
  bool enabled = true;
  bool queried = false;                      ///< in this tick; else skipped by coherence
  std::uint32_t left_out = 0;                ///< finest levels of the shell that the last look left out
  Tick due = 0;                              ///< next tick that has to look (spatio-temporal coherence)
  const IslandPairResult* result = nullptr;  ///< of the last query; null: no contacts
};

struct EnvironmentOptions {
  unsigned workers = 1;  ///< threads that solve islands, this one included; never changes the result
  SolveLimits limits;
  double max_speed = 1.0;       ///< [m/s] of any point of a held object (travel cap; the paper's v_max)
  double max_free_speed = 3.0;  ///< [m/s] of any point of a free body: half a metre's fall
  /// False: look at every pair in every tick; changes the result only where work is limited.
  bool coherence = true;
  WorkLimits work;  ///< at the start; setBudget changes it
  /// So many pairs may touch or be looked at in one tick: each costs some 120 kB.
  std::size_t rooms = 256;
  SendPolicy send_policy = SendPolicy::kEveryForce;
};

/// All objects, one tick (paper §3.2): follow the trackers, find the pairs that are near and due, solve the
/// contact islands for the poses of what is held or flies, look at the remaining due pairs, sum the forces.
///
/// A free body is one more pull in its island: its inertia, towards where it flies when nothing is in its
/// way. So a hand that pushes it, a stack of them and a held part are the same problem, and what a body is
/// pushed back by is the force on it. Its velocity is the way it went: impacts are inelastic, and an island
/// moves with no more energy than it had and its hands gave.
///
/// Far pairs cost nothing, near ones a glance, due ones a look. There is room for the looks of so many pairs;
/// when more are due, those that have contacts go first, and what a hand holds of the others stands still for
/// the tick: late, never through. Likewise a budget of points may be set for a tick; then pairs leave out the
/// finest levels of their shells, and motions the rest of their way.
///
/// Everything that moves is in here, everything else in the Scene: so a snapshot is the Environment, and
/// equal inputs from an equal snapshot give equal bits, for any number of workers.
///
/// Threads: one caller; its own workers inside step(). Real-time: everything but construction, save and
/// restore.
class Environment {
 public:
  Environment(std::shared_ptr<const Scene> scene, const EnvironmentOptions& options);
  ~Environment();

  // what people and the state machine decide, between ticks
  void setHandPresent(HandId hand, bool present) noexcept;
  void setHandPose(HandId hand, const Pose& X_WH, const Twist& V_WH) noexcept;
  void setHandFrozen(HandId hand, bool frozen) noexcept;
  /// Free bodies stand still where they are, and start from rest when they may go on: a pause.
  void setStill(bool still) noexcept;
  /// `hand` moves `object` from now on, which stays where it is in the hand. What it moved before it lets go
  /// of as in release(); a pointer (a hand's own first object) is hidden while the hand holds something else,
  /// and comes back on what it took, where it took it: outside, wherever the hand itself is.
  void grab(HandId hand, ObjectId object) noexcept;
  /// The hand moves its own first object again. What it held is parked, or flies on if it has a body.
  void release(HandId hand) noexcept;
  /// The two hands exchange what they hold and their own first objects; each object jumps to its other hand.
  void swapHands(HandId one, HandId other) noexcept;
  /// A declared jump. Whoever holds the object lets go of it (and then moves nothing, until grab or release),
  /// unless `status` is kHeld: then it stays in the hand at its new place.
  void place(ObjectId object, const Pose& X_WO, ObjectStatus status) noexcept;
  void setPairEnabled(std::size_t pair, bool enabled) noexcept;
  /// Objects of one group never touch; 0: no group.
  void setGroup(ObjectId object, std::uint32_t group) noexcept;
  [[nodiscard]] std::uint32_t groupOf(ObjectId object) const noexcept;
  /// A tick may test so many points from the next one on; 0: as many as there are.
  void setBudget(std::uint64_t points) noexcept { work_limits_.points = points; }
  /// The force of a source that is not a contact (client contribution, guidance): expires by itself.
  void contribute(ObjectId object, std::uint32_t source, const Wrench& F_Oo_W,
                  std::uint32_t lifetime_ticks) noexcept;

  void step() noexcept;

  [[nodiscard]] const Scene& scene() const { return *scene_; }
  [[nodiscard]] Tick tick() const { return tick_; }
  [[nodiscard]] std::span<const ObjectMotion> objects() const { return objects_; }
  [[nodiscard]] std::span<const HandMotion> hands() const { return hands_; }
  [[nodiscard]] std::span<const PairMotion> pairs() const { return pairs_; }
  [[nodiscard]] const WorkLimits& workLimits() const { return work_limits_; }
  /// The pairs whose balls are near each other, in order: only these can touch.
  [[nodiscard]] std::span<const std::uint32_t> nearPairs() const noexcept;
  /// So many pairs list contacts at most.
  [[nodiscard]] std::size_t contactRooms() const noexcept;
  /// "Force" as displays, conditions and reports mean it: of a held object its coupling's, else its
  /// ForceBuffer's.
  [[nodiscard]] Wrench forceOn(ObjectId object) const noexcept;
  [[nodiscard]] bool inContact(ObjectId a, ObjectId b) const noexcept;
  /// The contacts of a hand's object for its client (fills everything but client-side fields).
  void manifold(HandId hand, HandManifold& out) const noexcept;
  void pairContact(std::size_t pair, PairContact& out) const noexcept;
  /// Counted work of the last tick.
  struct Work {
    std::uint32_t active_pairs = 0, queried_pairs = 0, substeps = 0, iterations = 0;
    std::uint64_t points_visited = 0;
    std::uint32_t near_pairs = 0;     ///< whose balls are near each other
    std::uint32_t refused_pairs = 0;  ///< for want of room: what a hand holds of them stood still
    std::uint32_t limited_pairs = 0;  ///< whose look left out levels for want of budget
    double load_percent = 0.0;        ///< largest of the pairs
    bool conflicting = false;
  };
  [[nodiscard]] const Work& work() const { return work_; }

  /// Of all that moves and will matter for the next tick.
  [[nodiscard]] std::uint64_t hash() const noexcept;
  [[nodiscard]] std::vector<std::uint8_t> save() const;
  /// The same at the end of `bytes`: allocates nothing when there is room.
  void append(std::vector<std::uint8_t>& bytes) const;
  [[nodiscard]] Result<void> restore(std::span<const std::uint8_t> bytes);
  /// No state of this scene appends more bytes than these.
  [[nodiscard]] std::size_t mostSavedBytes() const;

 private:
  struct Engine;

  // hands and objects (environment_hands.cpp)
  void take(HandId hand) noexcept;
  void letGo(HandId hand) noexcept;
  [[nodiscard]] Pose returnPlace(const HandMotion& hand) const noexcept;
  void park(ObjectId object, ObjectStatus status) noexcept;
  void chooseHolder(ObjectId object) noexcept;
  void jump(ObjectId object) noexcept;
  void stir(ObjectId object) noexcept;
  // free bodies (environment_bodies.cpp)
  [[nodiscard]] bool flies(ObjectId object) const noexcept;
  [[nodiscard]] bool moves(ObjectId object) const noexcept;
  void wake(ObjectId object) noexcept;
  void wakeNeighbours(ObjectId object) noexcept;
  void wakeWhatIsTouched() noexcept;
  [[nodiscard]] bool mayBeTouched(std::size_t pair) const noexcept;
  void fly() noexcept;
  [[nodiscard]] MovableBody freeBody(ObjectId object) noexcept;
  void boundTravel(std::size_t island) noexcept;
  void landIsland(std::size_t island) noexcept;
  void restIsland(std::size_t island) noexcept;
  // their friction (environment_friction.cpp)
  void rub() noexcept;
  [[nodiscard]] double frictionOf(const PairSpec& pair) const noexcept;
  [[nodiscard]] Vector3 velocityOf(ObjectId object, const Vector3& p_WP) const noexcept;
  [[nodiscard]] double lightness(ObjectId object, const Vector3& p_WP, const Vector3& t_W) const noexcept;
  void strike(ObjectId object, const Vector3& p_WP, const Vector3& impulse_W) noexcept;

  [[nodiscard]] bool engaged(const HandMotion& hand) const noexcept { return hand.present && hand.taken; }
  [[nodiscard]] bool isHand(HandId hand) const noexcept { return hand.value < hands_.size(); }
  [[nodiscard]] bool isObject(ObjectId object) const noexcept { return object.value < objects_.size(); }

  // the tick (environment.cpp)
  void followTrackers() noexcept;
  void findMovable() noexcept;
  void findNearPairs() noexcept;
  void findDuePairs() noexcept;
  void countActivePairs() noexcept;
  void shareWork() noexcept;
  void planIslands() noexcept;
  void addIsland(std::int32_t island) noexcept;
  void takeIslands() noexcept;
  void lookAtOtherPairs() noexcept;
  void sumForces() noexcept;
  void sumWeights() noexcept;
  void judgeContacts() noexcept;
  void countWork() noexcept;
  void note(std::uint32_t pair) noexcept;
  void listContacts(ObjectId object, HandManifold& out) const noexcept;
  void listOtherPulls(HandId hand, HandManifold& out) const noexcept;
  [[nodiscard]] bool active(std::size_t pair) const noexcept;
  [[nodiscard]] MovableBody movableBody(ObjectId object) noexcept;
  [[nodiscard]] MovableBody heldBody(ObjectId object) const noexcept;
  [[nodiscard]] Spring springOf(HandId hand) const noexcept;
  [[nodiscard]] double speedCap(ObjectId object) const noexcept;
  [[nodiscard]] double speedOf(ObjectId object) const noexcept;

  [[nodiscard]] bool isSound() const noexcept;

  /// The one list of everything that moves: written, read and hashed by the same words.
  template <typename Archive, typename Self>
  static void archive(Archive& archive, Self& self);

  std::shared_ptr<const Scene> scene_;
  EnvironmentOptions options_;
  std::vector<ObjectMotion> objects_;
  std::vector<HandMotion> hands_;
  std::vector<PairMotion> pairs_;
  std::unique_ptr<Engine> engine_;
  WorkLimits work_limits_;
  bool still_ = false;  ///< nobody flies
  Work work_;
  Tick tick_ = 0;
};

}  // namespace tenon
