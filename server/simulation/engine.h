#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/simulation/broad_phase.h"
#include "server/simulation/coll_pair.h"
#include "server/simulation/contact_list_pool.h"
#include "server/simulation/environment.h"
#include "server/simulation/force_buffer.h"
#include "server/simulation/island_work.h"
#include "server/simulation/islands.h"
#include "server/simulation/rigid_body.h"
#include "server/simulation/work_budget.h"
#include "server/simulation/worker_pool.h"

namespace tenon::simulation {

/// Bounds of an object's surface.
struct ObjectSize {
  Vector3 p_OQ_O = Vector3::Zero();  ///< [m] centre of the bounding sphere
  double ball_radius = 0.0;          ///< [m] of the bounding sphere
  double radius = 0.0;               ///< [m] that, but not 0, as it scales rotations
};

/// [m/s] upper bound of the speed of any point of a body whose points are within `radius` [m] of its centre
/// Q.
[[nodiscard]] inline double maxPointSpeed(const Twist& V_WQ, double radius) {
  return V_WQ.linear.norm() + V_WQ.angular.norm() * radius;
}

/// The parts of an Environment that its header does not show, sized at the start: state of pairs and force
/// buffers, constants derived from the scene, and work space of a tick.
///
/// Threads: as Environment. Real-time: everything but the constructor.
struct Environment::Engine {
  Engine(const Scene& scene, const EnvironmentOptions& options);

  /// Cell of the ForceBuffer of `object` for the coupling of `hand`, and for gravity; pairs come before them.
  [[nodiscard]] std::size_t couplingCell(ObjectId object, HandId hand) const {
    return pair_cells[object.value] + hand.value;
  }

  [[nodiscard]] std::size_t gravityCell(ObjectId object) const {
    return pair_cells[object.value] + hand_count;
  }

  /// [m] accumulated path lengths of both objects of a pair.
  [[nodiscard]] double pathLengthOf(const PairSpec& pair) const {
    return path_lengths[pair.a.value] + path_lengths[pair.b.value];
  }
  /// `motion`: of the object's centre.
  void addPathLength(ObjectId object, const Displacement& motion) {
    path_lengths[object.value] += maxPointMotion(motion, sizes[object.value].radius);
  }

  /// [m] What two objects approach each other in this tick at most, whose points move by `travel_a` and
  /// `travel_b` [m] at most: in an island each moves as far as the one that moves most.
  [[nodiscard]] double largestApproach(double travel_a, double travel_b) const {
    return std::min(travel_a, largest_reach) + std::min(travel_b, largest_reach);
  }

  /// Indices of the pairs of an object.
  [[nodiscard]] std::span<const std::uint32_t> pairsOf(std::size_t object) const {
    return std::span(incident_pairs)
        .subspan(incident_begin[object], incident_begin[object + 1] - incident_begin[object]);
  }
  /// Both objects are in one group and therefore never collide.
  [[nodiscard]] bool inOneGroup(std::size_t pair) const noexcept {
    const PairSpec& spec = pairs[pair].spec();
    return groups[spec.a.value] != 0 && groups[spec.a.value] == groups[spec.b.value];
  }
  /// Counted in active_pairs: enabled, possible, not in one group, and neither object hidden (by `hidden`,
  /// which is updated at the end of a tick).
  [[nodiscard]] bool countsAsActive(std::size_t pair) const noexcept;
  void setEnabled(std::size_t pair, bool enabled) noexcept;
  /// The pair may have begun to collide since the last step.
  void noteSwitched(std::uint32_t pair) noexcept {
    if (is_switched[pair] == 0) switched.push_back(pair);
    is_switched[pair] = 1;
  }

  struct FreeBody {
    RigidBody rigid;
    // work space
    Twist V_WC;  ///< of the centre of mass: predicted without contacts, after the solve the actual one
    Matrix3 inverse_inertia_W = Matrix3::Identity();  ///< [1/(kg m^2)] about the centre of mass
  };

  /// A contact with a free body, for friction by sequential impulses.
  struct FrictionContact {
    ObjectId a, b;
    Vector3 p_WP, n_W;
    double max_impulse = 0.0;  ///< [N s] coefficient times normal force times tick
    Vector3 impulse_W;         ///< [N s] accumulated, on a
  };

  /// Resets the work space to its state before the first tick.
  void resetWorkspace() noexcept;

  // state
  std::vector<CollPair> pairs;
  std::vector<std::uint64_t> enabled_bits;  ///< bit per pair, 64 pairs per word; as in the checkpoint
  std::vector<std::uint32_t> groups;        ///< by object; 0: none
  std::vector<std::uint32_t> near;  ///< found by the broad phase; other pairs only have an enabled bit
  ContactListPool contact_lists;
  std::vector<double> path_lengths;  ///< [m] by object: bound of any point's path, without discontinuities
  std::vector<ForceBuffer> forces;   ///< by object; cells: its pairs, the couplings of all hands, gravity

  // constants
  std::vector<std::size_t> pair_cells;            ///< by object: number of its pairs
  std::vector<std::size_t> cell_in_a, cell_in_b;  ///< by pair: its cell in the buffers of its two objects
  std::vector<ObjectSize> sizes;                  ///< by object
  std::vector<std::uint32_t> incident_pairs;      ///< by object, concatenated: indices of its pairs
  std::vector<std::size_t> incident_begin;  ///< by object: first entry in incident_pairs; one more at the end
  std::vector<std::optional<FreeBody>> bodies;  ///< by object; none without a mass
  std::size_t hand_count = 0;
  collision::SolveLimits limits;  ///< of an island; its SQP steps at contacts keep to 1 m/s
  double max_margin = 0.0;        ///< [m] largest contact margin of any query in a tick

  /// Two movable bodies that may meet in this tick.
  struct Neighbours {
    ObjectId a, b;
    double gap = 0.0;  ///< [m] lower bound at the tick's start
  };

  // work space
  std::vector<std::uint32_t> switched;    ///< pairs of noteSwitched(), each once
  std::vector<std::uint8_t> is_switched;  ///< by pair
  std::vector<std::uint32_t> epochs;      ///< by object: at the start of the last step
  BroadPhase broad_phase;
  std::vector<std::uint32_t> separated;            ///< pairs that were near until the tick before
  std::vector<std::uint32_t> due;                  ///< near pairs to be queried in this tick, ascending
  std::vector<std::uint32_t> non_island;           ///< slots (positions in `due`) of pairs in no island
  std::vector<CollPair::TouchingPoints> touching;  ///< by slot, with limited work only
  WorkBudget budget;
  std::vector<std::uint8_t> queried;  ///< by pair: in this tick
  std::vector<FrictionContact> friction_contacts;
  std::uint32_t without_list = 0;         ///< due pairs that got no contact list
  std::vector<std::uint8_t> movable;      ///< by object: moved by couplings or as a free body
  std::vector<std::uint8_t> solved;       ///< by object: movable, and all its due pairs can be queried
  std::vector<std::uint8_t> has_contact;  ///< by object: in contact in this tick
  /// [m] by object: at most how far any point of it goes in this tick when only its own hands, or its
  /// inertia, move it; of the leader of an island the largest of all its bodies
  std::vector<double> reach;
  double largest_reach = 0.0;          ///< [m] of all objects
  std::vector<Neighbours> neighbours;  ///< in ascending order of pairs
  collision::PairQueryResult gap_query;
  std::uint64_t gap_points = 0;      ///< points tested to find neighbours
  std::vector<std::uint8_t> hidden;  ///< by object, as counted in active_pairs
  std::uint32_t active_pairs = 0;
  bool recount = true;  ///< count active_pairs anew
  IslandPartition partition;
  IslandWork islands;
  std::vector<collision::FeatureScratch> feature_scratch;  ///< by worker, for pairs in no island
  WorkerPool pool;
};

/// [-] A traversal may test the pair's budget divided by this: in one tick the solver may traverse again when
/// a body moves far, resamples the listed points after each SQP step, and may reject a step.
inline constexpr std::uint32_t kTraversalsPerTick = 3;

/// [ticks] Contacts are listed for clients within the distance that their object moves in this time: the
/// round trip of a LAN and a tick.
inline constexpr double kLookAheadTicks = 8.0;
/// [m] Limit of that distance: with more, a peg would list all points of its hole.
inline constexpr double kMaxLookAhead = 2e-3;

/// The wrench F_P_W about point P, expressed about point Q.
[[nodiscard]] inline Wrench shifted(const Wrench& F_P_W, const Vector3& p_PQ_W) {
  return {F_P_W.force, F_P_W.torque - p_PQ_W.cross(F_P_W.force)};
}

}  // namespace tenon::simulation
