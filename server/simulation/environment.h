#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "idl/types/hash.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/objects.h"
#include "idl/types/result.h"
#include "server/collision/island_solver.h"
#include "server/simulation/force_buffer.h"
#include "server/simulation/scene.h"
#include "server/simulation/work_limits.h"

namespace tenon::simulation {

/// State of an object. Index = ObjectId.
struct ObjectMotion {
  Pose X_WO;
  Twist V_WO;
  std::uint32_t epoch = 1;  ///< incremented at each discontinuity of the pose
  ObjectStatus status = ObjectStatus::kParked;
  HandId holder;  ///< the first hand that holds it; invalid when none does
  bool in_contact = false;
  bool asleep = false;    ///< free body at rest: not integrated until it is woken
  bool emerging = false;  ///< appeared at its hand inside another object: without contacts until it is out
  std::uint32_t rest_ticks = 0;  ///< [ticks] a free body has been below the sleep speed
};

/// State of a hand. Index = HandId.
struct HandMotion {
  bool present = false;     ///< a client controls it
  bool frozen = false;      ///< its coupling exerts no force
  ObjectId object;          ///< the object it moves; invalid: none
  Pose X_WH;                ///< newest device pose
  Twist V_WH;               ///< newest device twist
  Pose X_WH_before;         ///< device pose of the last tick
  Pose X_HO;                ///< of the object in the hand, constant while held
  Wrench F_Ho_W;            ///< of the coupling on the hand, about the hand's origin
  HandStiffness stiffness;  ///< of the coupling, while no other hand holds the object
  double round_trip = 0.0;  ///< [s] of the link of the hand's station
  double share = 1.0;       ///< [-] of `stiffness` that is in force, see limitSharedCouplings()
  ObjectId default_object;  ///< moved while the hand holds no other: pointer, drill, cube, forearm
  /// R: where the default object returns to, fixed to the held object O since that was grabbed.
  Pose X_OR;
  bool has_pose = false;             ///< a pose has been received since the hand is present
  bool attached = false;             ///< `object` follows the hand; false: from the hand's first pose on
  std::uint32_t rejected_poses = 0;  ///< invalid poses (not finite, not unit, out of range), ignored
};

/// What the last tick did with a pair. Index as in Scene::pairs.
struct PairMotion {
  bool enabled = true;
  bool queried = false;              ///< in that tick; else skipped by coherence
  std::uint32_t skipped_levels = 0;  ///< finest shell levels that the last query skipped
  Tick due = 0;                      ///< next tick with a query (spatio-temporal coherence)
  const collision::IslandPairResult* result = nullptr;  ///< of the last query; null: no contacts
};

struct EnvironmentOptions {
  unsigned workers = 1;  ///< threads that solve islands, the caller included; no influence on results
  collision::SolveLimits limits;
  /// Caps of a held object: no point of it is faster than max_speed plus max_turn_rate times its distance
  /// from the centre of the bounding sphere. A faster hand is ahead of its object.
  double max_speed = 4.0;       ///< [m/s]
  double max_turn_rate = 12.0;  ///< [rad/s]
  double max_free_speed = 3.0;  ///< [m/s] cap for any point of a free body: reached after falling 0.46 m
  /// False: every near pair with a moving object is queried in every tick; changes results only with limited
  /// work.
  bool coherence = true;
  WorkLimits work;  ///< at the start; setBudget changes it
  /// Most pairs that may be queried in a tick or have contacts; about 80 kB each, and 100 kB per worker.
  std::size_t contact_lists = 256;
};

/// The simulation state and its step (paper §3.2). One tick: move tracked objects to their trackers, find
/// near (broad phase) and due (coherence) pairs, solve the contact islands for the poses of held objects and
/// free bodies, query the due pairs in no island, sum forces.
///
/// An island is made of the bodies that may meet in this tick: each one's reach is bounded by its hands'
/// goals or its velocity, and nothing takes it farther. So no body feels what those do that it cannot meet,
/// and in free air an object takes the pose of its hand in full, up to the caps of EnvironmentOptions.
///
/// A free body enters its island's problem as a spring: inertia over the tick squared, towards the pose it
/// would have without contacts. Hands, held objects and free bodies are thus one problem, and contact forces
/// on both sides are equal and opposite. The velocity of a free body is its displacement per tick after the
/// solve, so impacts are inelastic (restitution 0); velocities are scaled down where an island would have
/// more energy than before the tick plus the work of its hands.
///
/// Of the near pairs only the due ones are queried. A query needs a contact list; when there are fewer than
/// due pairs, pairs with contacts keep theirs and the movable objects of the pairs without a list stand still
/// for the tick, so that none passes through another. With a point budget, pairs skip the finest shell levels
/// and islands end early; the rest of a held object's motion is made in later ticks.
///
/// The whole state is in here, all constants are in the Scene: from equal states, equal inputs give bit-equal
/// states for any number of workers.
///
/// Threads: one caller; its own workers inside step(). Real-time: everything but constructor, save, restore,
/// maxSavedBytes; append when the capacity suffices.
class Environment {
 public:
  Environment(std::shared_ptr<const Scene> scene, const EnvironmentOptions& options);
  ~Environment();

  /// Gives the workers the scheduling class, priority and permitted CPUs of the calling thread, which is to
  /// call step(). Returns what the operating system did not grant, or an empty string. Not real-time.
  [[nodiscard]] std::string shareScheduling();

  // inputs, between ticks; unknown ids are ignored
  /// A hand that is no longer present leaves its object kParked, and resumes holding it when it is back.
  void setHandPresent(HandId hand, bool present) noexcept;
  /// Invalid poses are ignored and counted in HandMotion::rejected_poses.
  void setHandPose(HandId hand, const Pose& X_WH, const Twist& V_WH) noexcept;
  /// Of the coupling of a hand whose station has just joined, with a link of its own. Numbers that are 0 or
  /// not finite: that of HandSpec.
  void setHandStiffness(HandId hand, const HandStiffness& stiffness) noexcept;
  /// `round_trip` [s] of the link of the hand's station: how stiff its coupling is to an object that another
  /// hand holds, too. Clamped to 0 to 1 s; 0 if it is no number.
  void setHandRoundTrip(HandId hand, double round_trip) noexcept;
  /// Of the hand's coupling, in the last tick.
  [[nodiscard]] HandStiffness couplingOf(HandId hand) const noexcept;
  /// While frozen, the hand's coupling exerts no force, and its object keeps its pose unless another hand
  /// moves it; then the hand holds it afterwards where it is, without a stretch of its coupling.
  void setHandFrozen(HandId hand, bool frozen) noexcept;
  /// While paused, free bodies keep their poses; they continue from rest.
  void setFreeBodiesPaused(bool paused) noexcept;
  /// From now on `hand` moves `object`, with X_HO as it is. The object moved before is let go as in
  /// release(); the hand's default object (a pointer) is hidden while the hand holds another one. When it
  /// returns, it has the pose relative to the held object that it had at the grab, so it is not inside that
  /// object.
  void grab(HandId hand, ObjectId object) noexcept;
  /// The hand moves its default object again. The object it held is parked, or is a free body if it has a
  /// mass.
  void release(HandId hand) noexcept;
  /// Exchanges the held and the default objects of two hands; the poses of the objects are discontinuous.
  void swapHands(HandId one, HandId other) noexcept;
  /// Sets the pose of an object discontinuously. Hands that hold it let go and move no object until grab or
  /// release; with status kHeld they keep it, with X_HO for the new pose. Ignored for an invalid pose.
  /// Without a hand kHeld and kTracked become kParked, and so does kFree without a mass.
  void place(ObjectId object, const Pose& X_WO, ObjectStatus status) noexcept;
  /// A held object that begins to collide with one in which it lies, by this, setGroup or place, has a new
  /// epoch from the next step on. Which pairs began is not saved: checkpoints are taken after a step.
  void setPairEnabled(std::size_t pair, bool enabled) noexcept;
  /// Objects of one group never collide; 0: no group.
  void setGroup(ObjectId object, std::uint32_t group) noexcept;
  [[nodiscard]] std::uint32_t groupOf(ObjectId object) const noexcept;
  /// Differs after each change of which pairs may collide; no part of the state.
  [[nodiscard]] std::uint32_t pairRevision() const noexcept { return pair_revision_; }
  /// Point budget from the next tick on; 0: unlimited.
  void setBudget(std::uint64_t points) noexcept { work_limits_.points = points; }
  /// A wrench of a source other than contacts and couplings, about the object's origin; see
  /// ForceBuffer::contribute for validation, clamping (about the object's centre) and expiry. A rejected one
  /// is ignored.
  void contribute(ObjectId object, std::uint32_t source, const Wrench& F_Oo_W,
                  std::uint32_t lifetime_ticks) noexcept;

  // a copy of another Environment, after what is heard of that one (environment_copy.cpp)
  /// Moves an object that neither a hand nor dynamics move, without a jump: others meet it where it is now.
  /// Ignored for other objects.
  void follow(ObjectId object, const Pose& X_WO, const Twist& V_WO) noexcept;
  /// Sets pose and velocity of a free body, without a jump. Ignored for other objects.
  void correct(ObjectId object, const Pose& X_WO, const Twist& V_WO) noexcept;
  /// `hand` is present and holds `object` as it does there; the object's pose is discontinuous. Without
  /// contacts until it is outside of all others, as in the other Environment.
  void hold(HandId hand, ObjectId object, const Pose& X_HO, const Pose& X_WO) noexcept;
  /// `hand` is present and pulls `object` from where that is, alone or beside others, without a jump and at
  /// first without a force; also one that was frozen. A hidden object appears as by hold().
  void grasp(HandId hand, ObjectId object, const Pose& X_HO) noexcept;

  /// One tick of kTickSeconds.
  void step() noexcept;

  [[nodiscard]] const Scene& scene() const { return *scene_; }
  [[nodiscard]] Tick tick() const { return tick_; }
  [[nodiscard]] std::span<const ObjectMotion> objects() const { return objects_; }
  [[nodiscard]] std::span<const HandMotion> hands() const { return hands_; }
  [[nodiscard]] std::span<const PairMotion> pairs() const { return pairs_; }
  [[nodiscard]] const WorkLimits& workLimits() const { return work_limits_; }
  /// Indices of the pairs found by the broad phase, ascending: only these can be in contact.
  [[nodiscard]] std::span<const std::uint32_t> nearPairs() const noexcept;
  /// Most pairs that can have contacts.
  [[nodiscard]] std::size_t contactListCapacity() const noexcept;
  /// [m] p_OQ_O: the object's centre, that of its bounding sphere; the origin without structures. What is
  /// judged or limited of an object's place and motion is that of Q, wherever its mesh has the origin.
  [[nodiscard]] const Vector3& centreOf(ObjectId object) const noexcept;
  /// The wrench about the object's centre that displays, conditions and reports call its force: of a held
  /// object the sum of its couplings, else the total of its ForceBuffer.
  [[nodiscard]] Wrench forceOn(ObjectId object) const noexcept;
  [[nodiscard]] bool inContact(ObjectId a, ObjectId b) const noexcept;
  /// The manifold of a hand's object for the local model of its client; server_epoch, answers_seq and
  /// step_revision are left to the caller. It has at most kManifoldContacts contacts; validity_radius is at
  /// most the gap of any contact that none of them represents. It has at most kOtherPulls couplings of other
  /// hands. An unknown hand leaves `out` as it is.
  void manifold(HandId hand, HandManifold& out) const noexcept;
  /// Contact summary of a pair for publication; `pair` must be an index of Scene::pairs.
  void pairContact(std::size_t pair, PairContact& out) const noexcept;
  /// Work of the last tick, counted.
  struct Work {
    std::uint32_t active_pairs = 0;   ///< may collide, near or not
    std::uint32_t queried_pairs = 0;  ///< near and due, with a contact list
    std::uint32_t steps = 0;          ///< SQP steps of all islands
    std::uint32_t iterations = 0;     ///< of the active-set method, in all islands
    std::uint64_t points_visited = 0;
    std::uint64_t solve_work = 0;       ///< of all islands: collision::SolveReport::work
    std::uint32_t limited_islands = 0;  ///< left a step to the next tick: SolveReport::work_limited
    std::uint32_t near_pairs = 0;       ///< found by the broad phase
    std::uint32_t deferred_pairs = 0;  ///< due, but without a contact list: their movable objects stood still
    std::uint32_t limited_pairs = 0;   ///< queried with skipped levels
    /// that the lists of queried pairs did not take: collision::QueryCounts::contacts_dropped
    std::uint32_t contacts_dropped = 0;
    double load_percent = 0.0;  ///< [%] largest load of a pair
    bool infeasible = false;    ///< of any island: collision::SolveReport::infeasible
  };
  [[nodiscard]] const Work& work() const { return work_; }

  /// Hash of the state: everything that influences the next tick.
  [[nodiscard]] std::uint64_t hash() const noexcept;
  [[nodiscard]] std::vector<std::uint8_t> save() const;
  /// Appends what save() returns; allocates only when the capacity of `bytes` is too small.
  void append(std::vector<std::uint8_t>& bytes) const;
  /// [bytes] Positions in save() of all its floating-point numbers: none of them may be infinite or NaN.
  [[nodiscard]] std::vector<std::size_t> savedDoubles() const;
  /// Fails and changes nothing when `bytes` are no valid checkpoint of this scene and build.
  [[nodiscard]] Result<void> restore(std::span<const std::uint8_t> bytes);
  /// [bytes] upper bound of what append() adds, for any state of this scene.
  [[nodiscard]] std::size_t maxSavedBytes() const;

 private:
  struct Engine;

  // hands and objects (environment_hands.cpp)
  void attachHand(HandId hand) noexcept;
  void detachHand(HandId hand) noexcept;
  [[nodiscard]] Pose returnPose(const HandMotion& hand) const noexcept;
  void park(ObjectId object, ObjectStatus status) noexcept;
  void updateHolder(ObjectId object) noexcept;
  [[nodiscard]] bool isMovedByAnother(HandId hand) const noexcept;
  void attachAt(HandId hand, ObjectId object, const Pose& X_HO, const Pose& X_WO) noexcept;
  void beginEpoch(ObjectId object) noexcept;
  void markDirty(ObjectId object) noexcept;
  // two hands on one object (environment_shared.cpp)
  void limitSharedCouplings() noexcept;
  [[nodiscard]] double shareFor(HandId hand) const noexcept;
  // free bodies and sleeping (environment_bodies.cpp)
  [[nodiscard]] bool isDynamic(ObjectId object) const noexcept;
  [[nodiscard]] bool moves(ObjectId object) const noexcept;
  void wake(ObjectId object) noexcept;
  void wakeNeighbours(ObjectId object) noexcept;
  void wakeTouchedBodies() noexcept;
  [[nodiscard]] bool mayTouch(std::size_t pair) const noexcept;
  void integrateFreeMotion() noexcept;
  [[nodiscard]] Twist twistOfCentre(ObjectId object) const noexcept;
  [[nodiscard]] collision::MovableBody freeBody(ObjectId object) noexcept;
  void setStepLimits(std::size_t island) noexcept;
  [[nodiscard]] double ownWay(ObjectId object) noexcept;
  [[nodiscard]] double travelCap(ObjectId object) const noexcept;
  void updateVelocities(std::size_t island) noexcept;
  void updateSleep(std::size_t island) noexcept;
  // friction of free bodies (environment_friction.cpp)
  void applyFreeBodyFriction() noexcept;
  [[nodiscard]] double frictionOf(const PairSpec& pair) const noexcept;
  [[nodiscard]] Vector3 velocityOf(ObjectId object, const Vector3& p_WP) const noexcept;
  [[nodiscard]] double inverseEffectiveMass(ObjectId object, const Vector3& p_WP,
                                            const Vector3& t_W) const noexcept;
  void applyImpulse(ObjectId object, const Vector3& p_WP, const Vector3& impulse_W) noexcept;

  [[nodiscard]] bool engaged(const HandMotion& hand) const noexcept { return hand.present && hand.attached; }
  /// The hand's coupling acts on the object.
  [[nodiscard]] bool pulls(HandId hand, ObjectId object) const noexcept {
    const HandMotion& motion = hands_[hand.value];
    return scene_->hands[hand.value].kind == HandKind::kCoupled && motion.object == object &&
           engaged(motion) && !motion.frozen;
  }
  [[nodiscard]] bool isPulled(ObjectId object) const noexcept;
  [[nodiscard]] bool isHand(HandId hand) const noexcept { return hand.value < hands_.size(); }
  [[nodiscard]] bool isObject(ObjectId object) const noexcept { return object.value < objects_.size(); }

  // the tick (environment.cpp)
  void declareOverlaps() noexcept;
  void noteEpochs() noexcept;
  void followTrackers() noexcept;
  void findMovable() noexcept;
  void findEmerged() noexcept;
  [[nodiscard]] bool isInsideAnother(ObjectId object) noexcept;
  void findReach() noexcept;
  void findNearPairs() noexcept;
  void findDuePairs() noexcept;
  void countActivePairs() noexcept;
  void distributeBudget() noexcept;
  void findNeighbours() noexcept;
  [[nodiscard]] double reachOf(ObjectId object) noexcept;
  void buildIslands() noexcept;
  void addIsland(std::int32_t island) noexcept;
  void applyIslandResults() noexcept;
  void queryNonIslandPairs() noexcept;
  void sumForces() noexcept;
  void writeGravity() noexcept;
  void updateContactFlags() noexcept;
  void countWork() noexcept;
  void updatePairMotion(std::uint32_t pair) noexcept;
  void listContacts(ObjectId object, HandManifold& out) const noexcept;
  void listOtherCouplings(HandId hand, HandManifold& out) const noexcept;
  void listNeighbours(HandId hand, HandManifold& out) const noexcept;
  [[nodiscard]] HandPull pullOf(HandId hand) const noexcept;
  [[nodiscard]] bool active(std::size_t pair) const noexcept;
  [[nodiscard]] collision::MovableBody movableBody(ObjectId object) noexcept;
  [[nodiscard]] collision::MovableBody heldBody(ObjectId object) const noexcept;
  [[nodiscard]] collision::Spring springOf(HandId hand) const noexcept;
  [[nodiscard]] double speedCap(ObjectId object) const noexcept;
  [[nodiscard]] double speedOf(ObjectId object) const noexcept;
  [[nodiscard]] Vector3 toCentre(ObjectId object) const noexcept;
  [[nodiscard]] Twist twistOver(const Displacement& motion, ObjectId object) const noexcept;

  /// Of a state whose numbers are finite.
  [[nodiscard]] bool isValid() const noexcept;

  /// Writes, reads or hashes the whole state.
  template <typename Archive, typename Self>
  static void archive(Archive& archive, Self& self);
  template <typename Archive>
  void archiveWithHeader(Archive& to) const;

  std::shared_ptr<const Scene> scene_;
  EnvironmentOptions options_;
  std::vector<ObjectMotion> objects_;
  std::vector<HandMotion> hands_;
  std::vector<PairMotion> pairs_;
  std::unique_ptr<Engine> engine_;
  WorkLimits work_limits_;
  bool free_bodies_paused_ = false;
  std::uint32_t pair_revision_ = 1;
  Work work_;
  Tick tick_ = 0;
};

}  // namespace tenon::simulation
