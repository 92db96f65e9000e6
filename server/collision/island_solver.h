#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "server/collision/feature_query.h"
#include "server/collision/motion_solver.h"
#include "server/collision/pair_query.h"

namespace tenon::collision {

/// How a held body is kept out of others.
enum class ContactMethod : std::uint8_t {
  kIsland,    ///< sequential quadratic programming, one programme per contact island (the default)
  kBlocking,  ///< baseline: the paper's god object, which removes the motion that opposes the penalty wrench
  kPenalty,   ///< baseline: the paper's penalty force alone, bodies follow their hands into each other
};

/// Coulomb friction coefficients of a pair; none by default.
struct Friction {
  double at_rest = 0.0;  ///< [-] static coefficient
  double sliding = 0.0;  ///< [-] dynamic coefficient, not above `at_rest`
};

/// The poses and levels of the traversal that listed a pair's contacts.
struct TraversalState {
  bool valid = false;  ///< false: the pair has no list yet, and the next evaluation traverses
  Pose X_WA, X_WB;
  double smallest_gap = 0.0;  ///< [m] lower bound over all points there, also those that a reduced list lacks
  std::uint32_t levels = 0;   ///< IslandPair::levels at that traversal
  /// that the budget allowed: later traversals use no more, until the pair starts without a list again
  std::uint32_t levels_used = 0xFFFFFFFFU;
};

/// What a solve found for a pair, at the final poses.
struct IslandPairResult {
  PairQueryResult query;
  /// [N] normal force of each contact of `query`, 0 above kTouchGap; sized kMaxPairContacts at start
  std::vector<double> multipliers;
  Wrench F_Ao_W;  ///< [N, Nm] of B on A, about A's origin; normal forces and friction
  TraversalState traversal;
  /// so many contacts at the list's end are secondary planes: not points of the pointshell, without area
  std::uint32_t secondary_planes = 0;
  bool slides = false;       ///< a friction patch of the pair slides in this solve
  bool slid_before = false;  ///< one slid in the last solve: the dynamic coefficient applies from the start
};

/// Two bodies of an island that may touch: A's pointshell against B's SDF, and the features of both. body_a
/// and body_b are indices into the island's bodies; a kStatic body is fixed at X_WA_static or X_WB_static.
struct IslandPair {
  std::int32_t body_a = ContactConstraint::kStatic;  ///< pointshell side
  std::int32_t body_b = ContactConstraint::kStatic;  ///< SDF side
  const structures::Pointshell* shell_A = nullptr;
  const structures::DistanceField* field_B = nullptr;
  Pose X_WA_static;
  Pose X_WB_static;
  PairFeatures features;  ///< none: one direction is asked
  Friction friction;
  // for every traversal, as in PairQuery
  std::uint32_t levels = 0xFFFFFFFFU;
  std::uint32_t budget = 0xFFFFFFFFU;  ///< [points]
  std::span<const std::uint32_t> priority_points = {};
  /// Result of the last solve, for the warm start: its list serves again while the bodies are near the poses
  /// of its traversal. Null after a jump of a pose. May be the result that is to be filled.
  const IslandPairResult* last = nullptr;

  /// [-] Gaps change by at most this times a motion.
  [[nodiscard]] double slope() const {
    return features.any() ? std::max(field_B->slope(), features.field_A->slope()) : field_B->slope();
  }
};

struct SolveLimits {
  std::uint32_t max_steps = 8;  ///< SQP steps in one solve
  /// Steps in free motion beside them: steps that end before a contact and are longer than the trust region.
  std::uint32_t max_free_steps = 16;
  double max_step_length = 0.0005;  ///< [m] of any point; the trust region's initial and largest radius
  double contact_margin = 0.0005;  ///< [m] contacts are listed up to this gap, and as far as a step may reach
  ContactMethod method = ContactMethod::kIsland;
  double penalty_stiffness = 1000.0;  ///< [N/m] of the baselines
  /// Work limit: points tested by the queries of one solve. At least one step is made.
  std::uint64_t points = std::numeric_limits<std::uint64_t>::max();
  /// Work limit in SolveReport::work: a step that would exceed it is left to the next solve, once the bodies
  /// are better off than at the start, without a new overlap. Until then up to kMostWork times of it is done.
  /// At least one step is made.
  std::uint64_t work = std::numeric_limits<std::uint64_t>::max();
};

/// [m] Contacts with a gap up to this touch. It covers what interpolation and an unconverged step leave. The
/// constraint of a larger gap limits the step, and has no force yet.
inline constexpr double kTouchGap = 5e-5;

struct SolveReport {
  std::uint32_t steps = 0;           ///< SQP steps that were taken
  std::uint32_t iterations = 0;      ///< of the active-set method, over all QPs of the solve
  std::uint32_t traversals = 0;      ///< queries that descended a pointshell's hierarchy, over all steps
  std::uint32_t resamplings = 0;     ///< queries that evaluated listed points again
  std::uint64_t points_visited = 0;  ///< by both kinds of queries
  /// All that took time, counted: in points of a traversal, which others are converted to
  std::uint64_t work = 0;
  bool work_limited = false;  ///< the solve ended because of SolveLimits::work
  bool infeasible = false;    ///< of the last QP: MotionResult::infeasible
  /// Steps or points ran out with a step of more than 1 um left: the bodies are at the best iterate, and the
  /// next tick continues from there.
  bool unconverged = false;
};

/// God object of one contact island (paper §3.1): moves its bodies as near to their springs' goals as the
/// contacts permit, by sequential quadratic programming over their poses.
///
/// Each iteration evaluates gaps and gradients at the iterate, solves the QP of the linearised problem for a
/// step (MotionSolver), and takes as much of it as the trust region allows. All contacts are constraints of
/// one problem: blocking what opposes the sum of their forces, as the paper does, is wrong by millimetres in
/// corners.
///
/// * Merit function: the energy of the springs, and a penalty on the deepest overlap. A step that does not
///   lower it halves the trust region; after a second one in a row the solver returns to the best iterate.
/// * Trust region: no point of a body that may reach a contact in a step moves by more than its radius, at
///   most `max_step_length`.
/// * Restoration: where a step has led into an overlap, as at a jump of the interpolated distance in a
///   concave corner, the fraction of the next one that the trust region allows would hardly leave it. The
///   smallest step out of it is taken first, else the bodies would be held by nothing that touches (D-083).
///   Not in a solve that begins with an overlap, as in a tight fit.
/// * Free motion: the gap of a pair is a lower bound of what its bodies may approach each other before any
///   point of one meets the other (conservative advancement about the centres of their bounding spheres). A
///   step within it is not limited by the trust region: a body far from others takes its goal in one step.
/// * Step fractions: bodies share one only as far as a pair of them may meet in the step; between two
///   feasible iterates of the QP every iterate is feasible.
/// * Second order: curvature of concave surfaces at active contacts, secondary planes where they are too
///   sharp for a curvature, overshoot damping.
/// * Seams: the gradient of an interpolated field jumps at cell borders. Free space outside a convex surface
///   is the union of the half-spaces of both sides, so a contact there gets the side that restricts the
///   step least. So does a point at an edge, which may be outside of either face.
/// * Convergence: the step of every body in contact is shorter than its `tolerance`. The step is then not
///   taken, so that a hand at rest means a body at rest.
///
/// When steps or points run out, the bodies are at the best iterate (SolveReport::unconverged); when the
/// constraints of a QP contradict each other, see MotionResult::infeasible. Skipped without a report are
/// * contacts beyond kMaxPairContacts of a pair, those with the largest gaps. Steps are shortened so as not
///   to reach them, but not below a quarter of `max_step_length`;
/// * seams beyond kMaxSeams (64), those with the largest gaps: these contacts keep the normal of their own
///   cell, and may hold the body back;
/// * secondary planes beyond kMaxSecondaryPlanes (64): a step may overlap there, the next iterate corrects
///   it. Where a pair's list is full, their force is missing in its F_Ao_W;
/// * friction patches beyond kMaxPatches (16): the contacts of the others are frictionless.
///
/// Threads: one at a time (a worker owns one). Keeps nothing from solve to solve: what a warm start needs is
/// in the results. Real-time: solve.
class IslandSolver {
 public:
  IslandSolver(std::size_t max_bodies, std::size_t max_pairs);

  /// Updates bodies[i].X_WB, and fills results[i] for pairs[i]. At most as many bodies and pairs as given at
  /// construction (assert).
  SolveReport solve(std::span<MovableBody> bodies, std::span<const IslandPair> pairs,
                    const SolveLimits& limits, std::span<IslandPairResult> results) noexcept;

 private:
  struct Job;  ///< the arguments of solve

  /// Planes to both sides along two tangents, or of a wedge.
  using SeamSides = FixedVector<ContactSide, 4>;

  /// A contact at a cell border or an edge, with the tangent planes beyond it.
  struct Seam {
    std::size_t pair = 0, contact = 0, row = 0;
    SeamSides sides;
  };

  /// Active contacts of a pair with about one normal, treated as one frictional contact at the centre of
  /// their normal forces. It transmits no moment about the normal.
  struct FrictionPatch {
    std::size_t pair = 0;
    double load = 0.0;  ///< [N] sum of the normal forces
    Vector3 n_W = Vector3::Zero();
    Vector3 p_WP = Vector3::Zero();
    Vector3 normal_force_W = Vector3::Zero();  ///< [N] sum over its rows
    Vector3 weighted_p_W = Vector3::Zero();    ///< [N m] sum of force times position over its rows
    Vector3 direction_W = Vector3::Zero();     ///< [-] of the friction force on A, while it slides
    std::size_t first_row = 0;                 ///< of its kPatchRows tangential rows, while it sticks
    bool slides = false;
    bool stuck_again = false;  ///< it slid and returned to sticking in this solve, and stays so
  };
  void solveIsland(const Job& job, SolveReport& report);
  void solveBlocking(const Job& job, SolveReport& report);
  void solvePenalty(const Job& job, SolveReport& report);

  // contact lists (island_lists.cpp)
  /// Traverses all pairs, up to a gap of `margin` [m].
  static void queryPairs(const Job& job, double margin, SolveReport& report);
  /// Takes over the lists and the active rows of the last solve.
  void warmStart(const Job& job);
  /// Brings the lists to the iterate: by a traversal when the bodies have moved too far since the last one,
  /// else by resampling.
  void updateContacts(const Job& job, SolveReport& report);
  /// True when the pair's list has the same points as before.
  bool updatePair(const Job& job, std::size_t pair, SolveReport& report);
  void traversePair(const Job& job, std::size_t pair, SolveReport& report);
  /// `approach` [m]: approachSinceTraversal.
  [[nodiscard]] static bool mustTraverse(const Job& job, std::size_t pair, double approach);
  /// [m] Upper bound of how much the gap of any point became smaller since the last traversal.
  [[nodiscard]] static double approachSinceTraversal(const Job& job, std::size_t pair);
  void buildConstraints(const Job& job);
  /// [m] Validity radius of the linearised problem: a step of this length reaches no contact that was dropped
  /// from a full list.
  [[nodiscard]] static double validityRadius(const Job& job);
  [[nodiscard]] static std::size_t pairOfRow(const Job& job, std::size_t row);

  // SQP (island_solver.cpp)
  /// Evaluates the constraints and their second-order terms at the iterate, and solves for step_.
  void computeStep(const Job& job, SolveReport& report);
  /// Gaps and gradients at the iterate.
  void evaluateConstraints(const Job& job, SolveReport& report);
  /// `unchanged`: so many leading rows, and all poses, are those of the last call.
  void solveQp(const Job& job, SolveReport& report, std::size_t unchanged = 0);
  /// [m] The longest displacement in step_ of any point of any body.
  [[nodiscard]] double stepLength(const Job& job) const;
  /// Every body's step is shorter than `slack` [-] times its tolerance; without any contact, than
  /// kStepTolerance.
  [[nodiscard]] bool converged(const Job& job, double slack) const;
  /// Whether SolveLimits::work leaves no further step, which would take as much as the last evaluation,
  /// `last` [work]. `certified`: the iterate is better than the initial poses and has no new overlap.
  [[nodiscard]] static bool isWorkSpent(const Job& job, const SolveReport& report, std::uint64_t last,
                                        bool certified);
  /// Sets fractions_ for a trust region of `trust` [m]. True for a step in free motion: bodies stop before
  /// contacts, none because of the trust region.
  bool limitStep(const Job& job, double trust);
  /// [m] By so much the bodies of a pair may approach each other from the iterate before anything touches, at
  /// least 0.
  [[nodiscard]] static double clearanceOf(const Job& job, std::size_t pair);
  /// Fraction of step_ with which a body does not exceed its max_displacement.
  [[nodiscard]] double fractionWithinLimit(const MovableBody& body, std::size_t i) const;
  void pinBodiesAtLimit(const Job& job) const;
  /// Takes step_, of every body its fraction.
  void takeStep(const Job& job);
  /// The body that stands for those which share a step fraction with body `i`.
  [[nodiscard]] std::size_t leaderOf(std::size_t i) const;
  void restoreBestIterate(const Job& job);
  /// [J] Merit function at the iterate: lower is better.
  [[nodiscard]] static double merit(const Job& job);
  /// [m] At the iterate; 0 without an overlap.
  [[nodiscard]] static double deepestOverlap(const Job& job);
  /// Sets step_ to the smallest one that leaves all overlaps, by the linearised gaps.
  void computeRestoration(const Job& job, SolveReport& report);
  /// Stiffens bodies whose step goes back along the last one. False when there is none.
  [[nodiscard]] bool dampOvershoot(const Job& job);
  void fillForces(const Job& job) const;
  /// Adds a contact's normal force of `multiplier` [N] to the pair's result.
  static void addForce(const Job& job, std::size_t pair, std::size_t contact, double multiplier);

  // second order (island_curvature.cpp)
  /// Gives the bodies the curvatures at their active contacts, and adds rows for secondary planes. False when
  /// there are none.
  bool evaluateCurvature(const Job& job);
  /// Whether the active contact rows are still those that evaluateCurvature used.
  [[nodiscard]] bool curvatureIsOfActiveRows() const;

  // cell borders and edges (island_seams.cpp)
  enum class SeamKind : std::uint8_t { kBorder, kEdge };
  /// Gives active contacts at seams the normal of the side that restricts the step least, and solves again.
  /// False when no normal changed.
  bool relaxSeamNormals(const Job& job, SeamKind kind, SolveReport& report);
  /// Gives a contact at a seam the side with the largest slack at the end of `step`, if that is more than the
  /// slack of its own by `least` [m]. True when it is another one.
  bool takeSideWithSlack(const Job& job, const Seam& seam, std::span<const Displacement> step, double least);
  /// A point that is outside of one side of a seam is not held by another: active contacts of seams_ that
  /// have slack at another side at the end of step_ get that one, and step_ is solved again. step_ keeps all
  /// constraints and one that held is gone, so the energy falls. False when there is none.
  bool releaseSeams(const Job& job, SolveReport& report);
  /// Sets seams_: where an active contact is at a convex border between cells, or at an edge, all that touch
  /// at one. As far as there is capacity: the active ones first, then those with the smallest gaps.
  void findSeams(const Job& job, SeamKind kind, SolveReport& report);
  /// Adds a contact when it is at a seam. When there is no room it displaces the one with the largest gap
  /// behind the `active` first ones, if its own gap is smaller.
  void addSeam(const Job& job, Seam seam, SeamKind kind, std::size_t active, SolveReport& report);
  [[nodiscard]] static SeamSides sidesAtBorder(const Job& job, const IslandPair& pair,
                                               const Contact& contact);
  [[nodiscard]] static SeamSides sidesAtEdge(const Job& job, const IslandPair& pair, const Contact& contact);
  /// [m] Displacement of A's point at p_WP relative to B's.
  [[nodiscard]] static Vector3 relativeDisplacement(const Job& job, std::span<const Displacement> step,
                                                    const IslandPair& pair, const Vector3& p_WP);

  // friction (island_friction.cpp)
  /// Solves with Coulomb friction on patches: a patch sticks by tangential rows as long as their force is
  /// within the limit, else it slides with a given force. Loads and directions are found by iteration; when
  /// its rounds run out the last step is used.
  void solveFriction(const Job& job, SolveReport& report);
  /// Groups the active contact rows into patches. True when loads changed or patches were added.
  bool collectPatches(const Job& job);
  /// Tangential rows for sticking patches, wrenches on the bodies for sliding ones.
  void applyFriction(const Job& job);
  /// Loads, sticking or sliding, and directions after a solve. True when any changed.
  bool updatePatches(const Job& job);
  /// [N] On A, in W.
  [[nodiscard]] Vector3 frictionForce(const Job& job, const FrictionPatch& patch) const;
  void addFriction(const Job& job) const;

  // baselines (island_baselines.cpp)
  void blockOpposedMotion(const Job& job);
  static void fillPenaltyForces(const Job& job);

  /// A tangent plane beside an active contact, as a contact without area.
  struct SecondaryPlane {
    std::size_t pair = 0;
    Contact contact;
  };

  MotionSolver motion_;
  FeatureScratch feature_scratch_;
  static constexpr std::size_t kMaxSeams = 64;
  FixedVector<Seam, kMaxSeams> seams_;
  static constexpr std::size_t kMaxSecondaryPlanes = 64;
  std::array<SecondaryPlane, kMaxSecondaryPlanes> secondary_planes_;
  std::size_t secondary_plane_count_ = 0;
  static constexpr std::size_t kMaxPatches = 16;
  static constexpr std::size_t kPatchRows = 4;  ///< to both sides along two tangents
  FixedVector<FrictionPatch, kMaxPatches> patches_;
  // rows_ holds the listed contacts, then the secondary planes, then the tangential rows of patches
  std::size_t first_patch_row_ = 0;
  std::vector<std::uint32_t> active_;  ///< active rows of the last QP, ascending: its warm start
  /// active rows carried over to the lists of a new iterate, by their new numbers, with their forces [N]
  std::vector<std::pair<std::size_t, double>> carried_;
  std::vector<std::uint32_t> curvature_rows_;  ///< rows whose curvatures the bodies have
  std::size_t contact_row_count_ = 0;
  /// by row: at this iterate the contact was found to be at no border
  std::vector<std::uint8_t> inside_cell_;
  std::vector<std::uint8_t> released_;  ///< by row: by releaseSeams at this iterate
  std::vector<ContactConstraint> rows_;
  std::vector<double> multipliers_;               ///< [N] by row
  std::vector<Displacement> step_;                ///< the QP's solution, by body
  std::vector<Displacement> step_without_seams_;  ///< the same if contacts at seams did not hold
  std::vector<double> lengths_;                   ///< [m] of step_, of any point, by body
  std::vector<double> clearances_;                ///< [m] clearanceOf each pair
  std::vector<double> fractions_;                 ///< [-] of step_ to take, by body
  std::vector<std::size_t> leaders_;              ///< by body: union-find of those that share a fraction
  std::vector<Displacement> last_step_;           ///< the step that led to the iterate
  std::vector<Pose> best_iterate_;                ///< by the merit function, in this solve
  std::vector<Pose> initial_poses_;               ///< of this solve
  /// Of each body, while computeRestoration changes them.
  std::vector<FixedVector<Spring, kMaxSprings>> springs_;
  std::vector<Wrench> wrenches_;           ///< for kBlocking: penalty on a body, about its centre Q
  std::vector<double> depths_;             ///< [m] for kBlocking: largest overlap of a body
  std::vector<std::uint8_t> constrained_;  ///< body has an active row
};

}  // namespace tenon::collision
