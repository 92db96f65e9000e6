#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "idl/types/fixed_vector.h"
#include "idl/types/spatial.h"
#include "server/structures/distance_field.h"
#include "server/structures/pointshell.h"

namespace tenon::collision {

/// What of the two bodies a contact is between.
enum class ContactKind : std::uint8_t {
  kShellPoint,    ///< a point of A's pointshell, the surface of B
  kFeaturePoint,  ///< a feature of B, the surface of A
  kCrossing,      ///< a feature of A, one of B: two pieces of edges, or a point and a piece
};

/// [m] Further apart than any margin. The gap of a dormant crossing (feature_query.h) is this plus the
/// distance of its segments.
inline constexpr double kDormantGap = 1.0;

/// A point of body A near body B's surface, or of B near A's (feature_query.h).
struct Contact {
  Vector3 p_WP = Vector3::Zero();
  Vector3 n_W = Vector3::Zero();  ///< unit, from B into A: the direction in which B pushes A
  double gap = 0.0;               ///< [m] value of B's field; < 0: inside its zero level set
  double area = 0.0;              ///< [m^2] surface of A that the point represents
  /// index in A's pointshell (kShellPoint), in B's features, or in A's (kCrossing): identifies the contact
  /// from tick to tick
  std::uint32_t point = 0;
  std::uint32_t other = 0;  ///< of a kCrossing: index in B's features
  ContactKind kind = ContactKind::kShellPoint;

  [[nodiscard]] bool dormant() const { return gap >= kDormantGap; }
  /// [m] Lower bound of the gap; for a dormant crossing the distance of its segments.
  [[nodiscard]] double gapBound() const { return dormant() ? gap - kDormantGap : gap; }
};

inline constexpr std::size_t kMaxPairContacts = 512;
using ContactList = FixedVector<Contact, kMaxPairContacts>;

/// Work done by a query, as deterministic counts: the same on every machine.
struct QueryCounts {
  std::uint32_t spheres_visited = 0;
  std::uint32_t spheres_total = 0;  ///< of all levels
  std::uint32_t points_visited = 0;
  std::uint32_t points_colliding = 0;  ///< with a negative gap
  /// contacts beyond the list's capacity: those with the largest gaps; dormant crossings do not count
  std::uint32_t contacts_dropped = 0;

  /// [%] Load eta (paper eq. 2): the mean of two ratios, spheres visited to all spheres and points colliding
  /// to points visited.
  [[nodiscard]] double loadPercent() const;
};

/// What to query: pointshell of A against the distance field of B at given poses.
struct PairQuery {
  const structures::Pointshell* shell_A = nullptr;
  const structures::DistanceField* field_B = nullptr;
  Pose X_WA;
  Pose X_WB;
  double margin = 0.0;                 ///< [m] contacts are listed up to this gap
  std::uint32_t levels = 0xFFFFFFFFU;  ///< number of pointshell levels that may be used
  /// Maximum number of points to test. A level that is expected to exceed it is skipped, with all finer ones;
  /// the coarsest level is always used. The areas of the points in use then cover the whole surface.
  std::uint32_t budget = 0xFFFFFFFFU;
  /// Points of skipped levels that are tested nevertheless and count against the budget: those that touched
  /// in the last tick, so that contact is not lost. Listed with area 0, since coarser points represent their
  /// surface.
  std::span<const std::uint32_t> priority_points = {};
  /// When the list fills up, points are dropped first that have a neighbour of the same leaf with about the
  /// same normal and a smaller gap: a flat patch then stays listed over its whole extent.
  bool reduce = false;
  /// Also sum the penalty of all points inside, listed or not. Not with a budget.
  bool sum_penalty = false;
  /// Correct depths and normals near gradient discontinuities of the field: see correctRidges().
  bool correct_ridges = false;
  /// Correct gaps and normals of listed contacts at concave edges of the field: see correctValley().
  bool correct_valleys = false;
  bool list = true;   ///< false: no contacts are listed; for PairQueryResult::smallest_gap alone
  bool prune = true;  ///< false: every point is tested, for comparison
  /// Give up as soon as more contacts are near than the list takes. Of the result, `counts.contacts_dropped`
  /// above 0 says so, and the rest is not valid. Not with `reduce`.
  bool stop_when_full = false;
};

struct PairQueryResult {
  ContactList contacts;
  QueryCounts counts;
  /// [m] of all points; a lower bound when no point is within the margin
  double smallest_gap = 0.0;
  /// [m] the list holds every contact with a smaller gap: the margin, or less when contacts were dropped
  double complete_to = 0.0;
  /// [m] lower bound of the gap of points that are not listed, those dropped by `reduce` excepted
  double unlisted_gap = 0.0;
  /// [m] lower bound of the gap of listed crossings that are dormant (feature_query.h)
  double dormant_gap = std::numeric_limits<double>::infinity();
  bool reduced = false;  ///< points were dropped in favour of neighbours (PairQuery::reduce)
  /// Penalty wrench for a stiffness of 1 N/m, force [m] and torque [m^2], if asked for
  Wrench penalty_Ao_W;
  std::uint32_t penalty_points = 0;    ///< points in that sum; points deeper than the field's band are not
  double deepest = 0.0;                ///< [m] depth of the deepest point in B's field, 0 when apart
  std::uint32_t levels_used = 0;       ///< levels 0 to levels_used - 1 were tested
  std::uint32_t traversal_points = 0;  ///< points tested by queryPair; resampling does not change it
  double skipped_gap_error = 0.0;      ///< [m] points of skipped levels may be nearer by at most this
};

/// Lists all points of A's pointshell whose gap to B is at most `margin`. Spheres that the field proves to be
/// farther away are pruned; the result is the same as that of testing every point. Beyond kMaxPairContacts
/// the smallest gaps are kept (`complete_to`, `contacts_dropped`). Empty structures give an empty list and
/// gaps of 1e6 m.
///
/// A point beyond the field's band (|distance| > DistanceField::band) has no gradient and is not listed; so a
/// margin plus dilation above the band has no effect. A point deeper than the band counts in
/// `points_colliding`, and with a bound of its depth in `smallest_gap` and `deepest`.
///
/// Threads: pure. Real-time.
void queryPair(const PairQuery& query, PairQueryResult& result) noexcept;

/// Evaluates the listed contacts at the query's poses without a traversal, as long as the gap of no point of
/// A has become smaller by more than `displacement` [m] since queryPair listed them. Gaps and normals are
/// those of queryPair without ridge correction; points that are not listed have at least a gap of
/// unlisted_gap - displacement. Contacts that left the field's band are removed from the list
/// (`unlisted_gap` then covers them).
///
/// Threads: pure. Real-time.
void resampleContacts(const PairQuery& query, double displacement, PairQueryResult& result) noexcept;

/// What resampling a part of a list found.
struct ResampledPart {
  std::size_t kept = 0;       ///< contacts, at the start of the part
  double smallest_gap = 0.0;  ///< [m] of all; a lower bound for those that left the band
  /// [m] lower bound for those that left the band
  double smallest_left_gap = std::numeric_limits<double>::infinity();
  std::uint32_t points_colliding = 0;
};

/// resampleContacts() for some contacts of a list, all of them points of `query.shell_A`: kinds stay, and
/// contacts that left the field's band are removed by moving the later ones up.
///
/// Threads: pure. Real-time.
[[nodiscard]] ResampledPart resamplePart(const PairQuery& query, std::span<Contact> contacts) noexcept;

/// [N] Penalty force of one contact along its normal for `stiffness` [N/m]; 0 when apart.
[[nodiscard]] double penaltyForce(const Contact& contact, double stiffness) noexcept;

/// Penalty wrench of the paper (§3.1) on A about its origin, in W: F = K sum a_i d_i n_i / A_ref over the
/// listed points inside B's field, with A_ref = 1 cm^2 and K = `stiffness` [N/m].
[[nodiscard]] Wrench penaltyWrench(const PairQueryResult& result, const Vector3& p_WAo,
                                   double stiffness) noexcept;

/// Selects at most `out.size()` contacts that represent all: the first `given` indices of `out`, or without
/// any the smallest gap, then always the one that differs most from those selected in position and normal.
/// Dormant crossings are none. Writes indices into `contacts` in order of selection and returns their number.
std::size_t selectRepresentatives(const ContactList& contacts, std::span<std::uint32_t> out,
                                  std::size_t given = 0) noexcept;

}  // namespace tenon::collision
