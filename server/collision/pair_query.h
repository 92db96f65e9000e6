#pragma once

#include <cstdint>
#include <span>

#include "idl/types/fixed_vector.h"
#include "idl/types/spatial.h"
#include "server/structures/distance_field.h"
#include "server/structures/pointshell.h"

namespace tenon {

/// A point of body A's shell near body B's surface.
struct Contact {
  Vector3 p_WP = Vector3::Zero();
  Vector3 n_W = Vector3::Zero();  ///< unit, from B into A: the direction in which B pushes A
  double gap = 0.0;               ///< [m] signed distance minus the dilation; < 0: inside the dilated surface
  double area = 0.0;              ///< [m^2] the point stands for
  std::uint32_t point = 0;        ///< its index in the shell: a name that stays from tick to tick
};

inline constexpr std::size_t kMaxPairContacts = 512;
using ContactList = FixedVector<Contact, kMaxPairContacts>;

/// Work done by a query, counted: the same on every machine.
struct QueryCounts {
  std::uint32_t spheres_visited = 0;
  std::uint32_t spheres_total = 0;  ///< of all levels
  std::uint32_t points_visited = 0;
  std::uint32_t points_colliding = 0;
  std::uint32_t contacts_dropped = 0;  ///< for want of room: those with the largest gaps

  /// The paper's load eta in percent (eq. 2), weights 0.5 and 0.5.
  [[nodiscard]] double loadPercent() const;
};

struct PairQuery {
  const Pointshell* shell_A = nullptr;
  const DistanceField* field_B = nullptr;
  Pose X_WA;
  Pose X_WB;
  double dilation = 0.0;               ///< [m] the surface of B is felt this far outside
  double margin = 0.0;                 ///< [m] contacts are listed up to this gap
  std::uint32_t levels = 0xFFFFFFFFU;  ///< how many levels of the shell may be used
  /// So many points may be tested: a level of which more are expected is left out, and all finer ones. The
  /// coarsest is always used. Points of coarser levels then stand for the skin of those left out.
  std::uint32_t budget = 0xFFFFFFFFU;
  /// Points that are tested whatever is left out, before all others of the budget: what touched a moment ago
  /// holds on. Listed with no area when others stand for their skin.
  std::span<const std::uint32_t> first = {};
  /// When room runs out, points give way first that stand behind a neighbour (of the same leaf, with about
  /// the same normal and a smaller gap): a flat patch then stays listed over all its width.
  bool thin = false;
  bool sum = false;  ///< also sum what all points inside push, listed or not; not with a budget
  /// Where the field bends inside, depths and normals are those of planes beside it: see straightening.h.
  bool straighten = false;
  bool prune = true;  ///< false: every point is tested, for comparison
};

struct PairQueryResult {
  ContactList contacts;
  QueryCounts counts;
  double smallest_gap =
      0.0;  ///< of all points, a lower bound when none is within the margin; dilation included
  double listed_to =
      0.0;  ///< [m] every contact with a smaller gap is in the list: the margin, or less when full
  double others_gap = 0.0;    ///< [m] no point outside the list has a smaller gap, thinned ones aside
  bool thinned = false;       ///< some points gave way to their neighbours
  Wrench push_Ao_W;           ///< [m] and [m^2] of penalty a N/m of stiffness, when asked for
  std::uint32_t pushing = 0;  ///< points in that sum; deeper than the field's band nothing pushes
  double deepest = 0.0;       ///< [m] depth in the undilated field of the deepest point, 0 when apart
  std::uint32_t levels_used = 0;
  std::uint32_t walk_points = 0;  ///< points tested by queryPair; resampling does not change it
  double left_out = 0.0;          ///< [m] points of levels that were left out may be nearer by so much
};

/// All points of A's shell whose gap to B is at most `margin`. Spheres that the field proves to be farther
/// away are skipped; the answer is the same as testing every point.
///
/// Threads: pure. Real-time.
void queryPair(const PairQuery& query, PairQueryResult& result) noexcept;

/// The listed contacts again, at the query's poses, while no point of A came nearer to B than by `moved` [m]
/// since queryPair listed them: costs no walk. Gaps and normals are those that queryPair would give without
/// straightening; what is not in the list is still not nearer than others_gap - moved.
void resampleContacts(const PairQuery& query, double moved, PairQueryResult& result) noexcept;

/// [N] the penalty of one contact along its normal; 0 when apart.
[[nodiscard]] double penaltyForce(const Contact& contact, double stiffness) noexcept;

/// The paper's penalty: F = K sum a_i d_i n_i / A_ref of the points inside the (dilated) surface, about A's
/// origin. A_ref = 1 cm^2, K in N/m.
[[nodiscard]] Wrench penaltyWrench(const PairQueryResult& result, const Vector3& p_WAo,
                                   double stiffness) noexcept;

/// At most `out.size()` contacts that stand for all: the smallest gap, then those that differ most in place
/// and normal. Returns how many; indices into `contacts`, in order of choice.
std::size_t reduceContacts(const ContactList& contacts, std::span<std::uint32_t> out) noexcept;

}  // namespace tenon
