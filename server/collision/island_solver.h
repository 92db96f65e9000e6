#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "server/collision/motion_solver.h"
#include "server/collision/pair_query.h"

namespace tenon {

/// How a held body is kept out of others.
enum class ContactMethod : std::uint8_t {
  kIsland,    ///< one quadratic programme per contact island (the default)
  kBlocking,  ///< the paper's god-object heuristic, as baseline: block what opposes the penalty wrench
  kPenalty,   ///< the paper's penalty force alone, as baseline: bodies follow their hands into each other
};

/// Coulomb's coefficients of a pair; none by default.
struct Friction {
  double at_rest = 0.0;
  double sliding = 0.0;  ///< not above `at_rest`
};

/// Where a pair's bodies were when its shell's tree was walked to list its contacts.
struct WalkedAt {
  bool done = false;
  Pose X_WA, X_WB;
  std::uint32_t levels = 0;          ///< of the shell that were asked for
  std::uint32_t used = 0xFFFFFFFFU;  ///< that the budget was enough for; a solve's later walks use no more
};

/// What came out for a pair, at the final poses.
struct IslandPairResult {
  PairQueryResult query;
  std::vector<double> multipliers;  ///< [N] a contact of query.contacts; sized kMaxPairContacts at start
  Wrench F_Ao_W;                    ///< of B on A, about A's origin
  WalkedAt walked;
  std::uint32_t flanks = 0;  ///< so many at the list's end are not the shell's: sharp hollows
  bool slides = false;       ///< against friction, in this solve
  bool slid = false;         ///< and in the last one
};

/// Two bodies of an island that may touch. Indices into the island's bodies; kStatic bodies stand at
/// X_W*_static.
struct IslandPair {
  std::int32_t body_a = GapRow::kStatic;  ///< asked as a shell
  std::int32_t body_b = GapRow::kStatic;  ///< asked as a field
  const Pointshell* shell_A = nullptr;
  const DistanceField* field_B = nullptr;
  Pose X_WA_static;
  Pose X_WB_static;
  double dilation = 0.0;
  Friction friction;
  // of every walk, as in PairQuery; a level that one walk of a solve leaves out is left out to its end
  std::uint32_t levels = 0xFFFFFFFFU;
  std::uint32_t budget = 0xFFFFFFFFU;
  std::span<const std::uint32_t> first = {};
  /// Of the last solve, if nothing jumped since: while the bodies are near where they were when its list was
  /// made, that list serves again. May be the result that is to be filled.
  const IslandPairResult* last = nullptr;
};

struct SolveLimits {
  std::uint32_t substeps = 8;
  double substep_travel = 0.0005;  ///< [m] any point of a body moves at most, per sub-step
  double contact_margin = 0.0005;  ///< [m] on top of the sub-step's travel, contacts are listed
  ContactMethod method = ContactMethod::kIsland;
  double penalty_stiffness = 1000.0;  ///< [N/m] for the baselines
  /// So many points may be tested: when that is spent, the rest of the way goes into the next tick.
  std::uint64_t points = std::numeric_limits<std::uint64_t>::max();
};

/// Two surfaces this close [m] touch: less is what interpolation and a cut-off sub-step leave. A row that
/// will bind only farther along the way has no force yet.
inline constexpr double kTouchGap = 5e-5;

struct SolveReport {
  std::uint32_t substeps = 0;  ///< that moved something
  std::uint32_t iterations = 0;
  std::uint32_t queries = 0;         ///< walks of a pair's tree, over all sub-steps
  std::uint32_t resamplings = 0;     ///< of a pair's listed points, likewise
  std::uint64_t points_visited = 0;  ///< by both
  bool conflicting = false;
  bool travel_capped = false;  ///< the rest of the way goes into the next tick
};

/// Moves the bodies of one contact island towards their springs' goals without letting them into each other
/// (DESIGN "god object"; paper §3.1): sub-step by sub-step, query the pairs at the current poses, solve for
/// poses, project first and clamp then, move. A body on a surface that has less than kSettled to go stays
/// where it is, so that a still hand means a still body.
///
/// Threads: one at a time (a worker owns one); keeps nothing from solve to solve. Real-time: solve.
class IslandSolver {
 public:
  IslandSolver(std::size_t max_bodies, std::size_t max_pairs);

  /// Moves bodies[i].X_WB; fills results[i] for pairs[i].
  SolveReport solve(std::span<MovableBody> bodies, std::span<const IslandPair> pairs,
                    const SolveLimits& limits, std::span<IslandPairResult> results) noexcept;

 private:
  struct Job;  ///< the arguments of solve

  /// What holds a body in about one direction, rubbed as one thing at the centre of its load. Turning about
  /// its normal is free.
  struct Patch {
    std::size_t pair = 0;
    double load = 0.0;  ///< [N]
    Vector3 n_W = Vector3::Zero();
    Vector3 p_WP = Vector3::Zero();
    Vector3 push_W = Vector3::Zero(), at_W = Vector3::Zero();  ///< sums over its rows, weighted by force
    Vector3 along_W = Vector3::Zero();                         ///< in which it drags A, while it slides
    std::size_t first_row = 0;                                 ///< of those that hold it, while it sticks
    bool slides = false;
    bool stuck_again = false;
  };
  void solveIsland(const Job& job, SolveReport& report);
  void solveBlocking(const Job& job, SolveReport& report);
  void solvePenalty(const Job& job, SolveReport& report);

  static void queryPairs(const Job& job, double margin, SolveReport& report);
  /// Lists what may be met within a sub-step: again from the shell's tree when the bodies have gone too far
  /// since it was last walked, else the same points at the new poses.
  void lookAround(const Job& job, SolveReport& report);
  /// True when its list has the same points as before.
  bool lookAtPair(const Job& job, std::size_t pair, SolveReport& report);
  /// Takes over the lists of the last solve, and what held then.
  void takeLast(const Job& job);
  void walkPair(const Job& job, std::size_t pair, SolveReport& report);
  /// Once its bodies have `gone` so far [m] towards each other.
  [[nodiscard]] static bool mustWalk(const Job& job, std::size_t pair, double gone);
  /// [m] no point of one came nearer to the other by more, since the walk.
  [[nodiscard]] static double approach(const Job& job, std::size_t pair);
  void buildRows(const Job& job);
  /// [m] a sub-step may go this far without meeting contacts that had no room in the lists.
  [[nodiscard]] static double knownReach(const Job& job);
  /// `unchanged`: so many of the rows, and all poses, are as in the call before.
  void solveMotions(const Job& job, SolveReport& report, std::size_t unchanged = 0);
  /// [m] the farthest that any point of any body goes.
  [[nodiscard]] double travel(const Job& job) const;
  /// Nobody has more to go than is left to the next tick: `slack` times its `settled`.
  [[nodiscard]] bool arrived(const Job& job, double slack) const;
  /// Of the motions that takes nobody beyond its reach.
  [[nodiscard]] double shareWithinReach(const Job& job) const;
  void pinWhatHasGoneItsReach(const Job& job) const;
  void move(const Job& job, double share);
  void goBackToBest(const Job& job);
  /// [J] how good a place is: the springs' energy, and a price on what is too deep that no spring can pay.
  [[nodiscard]] static double merit(const Job& job);
  /// True when a body is on its way back from where it has just gone; then it is braked along that way.
  [[nodiscard]] bool brakeOvershoot(const Job& job);
  /// Finds what the bodies can do at their places.
  void look(const Job& job, SolveReport& report);
  /// Gives the bodies the curves of what holds them, and rows for the flanks of what is too sharp to be a
  /// curve;
  /// true when there are any.
  bool findCurves(const Job& job);
  [[nodiscard]] bool curvesAreOfHeld() const;
  // borders of cells (island_kinks.cpp)
  /// A field's slope jumps from cell to cell. On a bulge a point may go on as soon as one of both sides lets
  /// it: held points at a border get the side that is in their way least. True when another one.
  bool passKinks(const Job& job, SolveReport& report);
  bool findKink(const Job& job, std::size_t pair, std::size_t contact, std::size_t row);
  /// Of A's point over B.
  [[nodiscard]] static Vector3 relativeMotion(const Job& job, std::span<const Displacement> motions,
                                              const IslandPair& pair, const Vector3& p_WP);
  void blockMotions(const Job& job);
  // friction (island_friction.cpp)
  void rub(const Job& job, SolveReport& report);
  bool loadPatches(const Job& job);
  void setFriction(const Job& job);
  bool judgePatches(const Job& job);
  [[nodiscard]] Vector3 frictionOf(const Job& job, const Patch& patch) const;
  void fillFriction(const Job& job) const;
  [[nodiscard]] static std::size_t pairOfRow(const Job& job, std::size_t row);

  void fillForces(const Job& job) const;
  static void fillForce(const Job& job, std::size_t pair, std::size_t contact, double multiplier);
  static void fillPenalties(const Job& job);

  /// A contact, of no area, that the look at a place has added to those of the pair.
  struct Flank {
    std::size_t pair = 0;
    Contact contact;
  };

  /// A held contact at a border, with the planes of the surface beyond it.
  struct Kink {
    struct Side {
      Vector3 n_W = Vector3::Zero();
      double gap = 0.0;
    };
    std::size_t pair = 0, contact = 0, row = 0;
    FixedVector<Side, 4> sides;
  };

  MotionSolver motion_;
  static constexpr std::size_t kMaxKinks = 24;
  FixedVector<Kink, kMaxKinks> kinks_;
  static constexpr std::size_t kMaxFlanks = 64;
  std::array<Flank, kMaxFlanks> flanks_;
  std::size_t flank_count_ = 0;
  static constexpr std::size_t kMaxPatches = 16;
  static constexpr std::size_t kPatchRows = 4;  ///< to both sides along two tangents
  FixedVector<Patch, kMaxPatches> patches_;
  std::size_t first_patch_row_ = 0;
  std::vector<std::uint32_t> held_;  ///< rows that held in the last solve, while the lists are the same
  std::vector<std::pair<std::size_t, double>> kept_;  ///< of those, by new number, with their forces [N]
  std::vector<std::uint32_t> curved_;                 ///< rows whose curves the bodies have
  std::size_t listed_ = 0;  ///< rows of listed contacts; those of the flanks are behind them
  std::vector<GapRow> rows_;
  std::vector<double> multipliers_;
  std::vector<Displacement> motions_;
  std::vector<Displacement> free_motions_;  ///< if what is at a border did not hold
  std::vector<Displacement> gone_;          ///< in the last sub-step
  std::vector<Pose> best_;                  ///< of the places of this solve
  std::vector<Pose> start_;                 ///< of this solve
  std::vector<Wrench> wrenches_;            ///< for kBlocking: penalties on a body, about its origin
  std::vector<double> depths_;              ///< for kBlocking: the deepest of a body's contacts
  std::vector<std::uint8_t> touched_;       ///< a row holds the body back
};

}  // namespace tenon
