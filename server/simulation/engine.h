#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/simulation/broad_phase.h"
#include "server/simulation/coll_pair.h"
#include "server/simulation/contact_rooms.h"
#include "server/simulation/environment.h"
#include "server/simulation/force_buffer.h"
#include "server/simulation/island_work.h"
#include "server/simulation/islands.h"
#include "server/simulation/rigid_body.h"
#include "server/simulation/work_budget.h"
#include "server/simulation/worker_pool.h"

namespace tenon {

/// How large an object is: its skin lies in a ball about p_OC_O, and within `radius` of its origin [m].
struct ObjectSize {
  Vector3 p_OC_O = Vector3::Zero();
  double ball = 0.0;
  double radius = 0.0;
};

/// Speed of the fastest point of a body of `radius` about its origin, at most [m/s].
[[nodiscard]] inline double fastestPoint(const Twist& V_WB, double radius) {
  return V_WB.linear.norm() + V_WB.angular.norm() * radius;
}

/// What the tick works with, sized at start: the pairs' own states and force buffers (which matter for the
/// next tick) and work space (which does not).
///
/// Threads: as Environment. Real-time: everything but the constructor.
struct Environment::Engine {
  Engine(const Scene& scene, const EnvironmentOptions& options);

  [[nodiscard]] std::size_t couplingCell(ObjectId object, HandId hand) const {
    return pair_cells[object.value] + hand.value;
  }

  [[nodiscard]] std::size_t gravityCell(ObjectId object) const {
    return pair_cells[object.value] + hand_count;
  }

  [[nodiscard]] double travelledBy(const PairSpec& pair) const {
    return odometers[pair.a.value] + odometers[pair.b.value];
  }
  void addTravel(ObjectId object, const Displacement& way) {
    odometers[object.value] += fastestPoint(way, sizes[object.value].radius);
  }

  /// The pairs that an object is in.
  [[nodiscard]] std::span<const std::uint32_t> pairsOf(std::size_t object) const {
    return std::span(pairs_of).subspan(pairs_from[object], pairs_from[object + 1] - pairs_from[object]);
  }
  /// Its two objects are of one group.
  [[nodiscard]] bool grouped(std::size_t pair) const noexcept {
    const PairSpec& spec = pairs[pair].spec();
    return groups[spec.a.value] != 0 && groups[spec.a.value] == groups[spec.b.value];
  }
  /// On, possible, and nobody hidden when that was last looked at.
  [[nodiscard]] bool counts(std::size_t pair) const noexcept;
  void setEnabled(std::size_t pair, bool enabled) noexcept;

  struct FreeBody {
    RigidBody rigid;
    // work space
    Twist V_WC;                                       ///< how it wants to go in this tick, then how it went
    Matrix3 inverse_inertia_W = Matrix3::Identity();  ///< about the centre of mass
  };

  /// A contact of a free body that rubs.
  struct Rub {
    ObjectId a, b;
    Vector3 p_WP, n_W;
    double most = 0.0;  ///< [N s]
    Vector3 impulse_W;  ///< on a
  };

  /// Leaves the work space as before the first tick.
  void forgetTick() noexcept;

  // state
  std::vector<CollPair> pairs;
  std::vector<std::uint64_t> switches;  ///< 64 pairs a word: those that are on, for the hash
  std::vector<std::uint32_t> groups;    ///< by object; 0: none
  std::vector<std::uint32_t> near;  ///< pairs that may meet, in order; others have no state but their switch
  ContactRooms rooms;
  std::vector<double> odometers;    ///< by object: [m] its fastest point's way so far, jumps left out
  std::vector<ForceBuffer> forces;  ///< cells of an object: its pairs, then the couplings of all hands

  // what never changes
  std::vector<std::size_t> pair_cells;            ///< by object: how many of its cells are pairs
  std::vector<std::size_t> cell_in_a, cell_in_b;  ///< by pair: its cell in the buffers of its two objects
  std::vector<ObjectSize> sizes;                  ///< by object
  std::vector<std::uint32_t> pairs_of;            ///< object after object
  std::vector<std::size_t> pairs_from;            ///< by object: where its own begin, and one more
  std::vector<std::optional<FreeBody>> bodies;    ///< by object: those that have a mass
  std::size_t hand_count = 0;
  SolveLimits limits;  ///< sub-steps cut so that a tick keeps the travel cap
  double reach = 0.0;  ///< [m] the largest margin any query of a tick may use

  // work space
  BroadPhase broad_phase;
  std::vector<std::uint32_t> left;                 ///< pairs that were near until this tick
  std::vector<std::uint32_t> due;                  ///< near pairs to look at in this tick, in order
  std::vector<std::uint32_t> others;               ///< places in `due` of those that no island solves
  std::vector<CollPair::TouchingPoints> touching;  ///< by place in `due`, while work is limited
  WorkBudget budget;
  std::vector<std::uint8_t> looked_at;  ///< by pair, in this tick
  std::vector<Rub> rubs;
  std::uint32_t refused = 0;          ///< due pairs that found no room
  std::vector<std::uint8_t> movable;  ///< by object: a hand pulls at it
  std::vector<std::uint8_t> solved;   ///< by object: and it moves in this tick
  std::vector<std::uint8_t> at_rest;  ///< by object: touches something in this tick
  std::vector<std::uint8_t> meets;    ///< by object: of a near pair, looked at in this tick or not
  std::vector<std::uint8_t> hidden;   ///< by object, when active pairs were counted
  std::uint32_t active_pairs = 0;
  bool recount = true;
  IslandPartition partition;
  IslandWork islands;
  WorkerPool pool;
};

/// Contacts are listed for clients as far ahead as their object gets in this many ticks: a LAN's round trip
/// and a tick; never farther than kLookAheadReach [m], or a peg would list its whole slot.
inline constexpr double kLookAheadTicks = 8.0;
inline constexpr double kLookAheadReach = 2e-3;

/// The same wrench about another point: p_PQ_W leads from the old to the new one.
[[nodiscard]] inline Wrench shifted(const Wrench& F_P_W, const Vector3& p_PQ_W) {
  return {F_P_W.force, F_P_W.torque - p_PQ_W.cross(F_P_W.force)};
}

}  // namespace tenon
