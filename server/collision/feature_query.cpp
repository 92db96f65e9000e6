#include "server/collision/feature_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace tenon::collision {
namespace {

using structures::FeatureEdge;

/// [-] Squared sine of 5 degrees: edges nearer to parallel do not cross, their ends and faces touch.
constexpr double kMinSine2 = 0.0076;

/// [-] n . into may exceed 0 by this where the normal of a crossing is along a face.
constexpr double kConeTolerance = 1e-3;

/// [-] The same for a crossing that is listed: bodies turn until the next traversal.
constexpr double kListedTolerance = 0.2;

/// [m] Deeper crossings do not count: the edges are those of far sides of thin parts.
constexpr double kMaxCrossingDepth = 5e-4;

/// [-] Relative to half a piece: a crossing at the border of two pieces is in one of them.
constexpr double kEndTolerance = 1e-3;

/// A piece of an edge in W, or in any other frame.
struct Piece {
  Piece(const structures::FeatureShell& features, std::uint32_t point, const Pose& X_WM)
      : p_W(X_WM * Vector3(features.points().points()[point].p_MP.cast<double>())) {
    const FeatureEdge& edge = features.edges()[point];
    half_W = X_WM.rotation() * Vector3(edge.half_M.cast<double>());
    for (std::size_t face : {0U, 1U})
      into_W[face] = X_WM.rotation() * Vector3(edge.into_M[face].cast<double>());
  }
  /// Whether its body lies on the far side of a plane with normal n_W through the edge.
  [[nodiscard]] bool separatedBy(const Vector3& n_W, double tolerance) const {
    return n_W.dot(into_W[0]) <= tolerance && n_W.dot(into_W[1]) <= tolerance;
  }

  Vector3 p_W, half_W;
  std::array<Vector3, 2> into_W;
};

/// Two pieces as a contact of A against B. `slack` [m] beyond their ends, `tolerance` [-] of the normal.
/// False when they do not cross there.
bool cross(const Piece& a, const Piece& b, double slack, double tolerance, Contact& contact) {
  const Vector3 c = a.half_W.cross(b.half_W);
  const double c2 = c.squaredNorm();
  const double a2 = a.half_W.squaredNorm();
  const double b2 = b.half_W.squaredNorm();
  if (c2 < kMinSine2 * a2 * b2) return false;
  // closest points a + along_a * half_a, b + along_b * half_b of the two lines
  const Vector3 r = a.p_W - b.p_W;
  const double along_a = -r.dot(b.half_W.cross(c)) / c2;
  const double along_b = -r.dot(a.half_W.cross(c)) / c2;
  if (std::abs(along_a) > 1.0 + kEndTolerance + slack / std::sqrt(a2) ||
      std::abs(along_b) > 1.0 + kEndTolerance + slack / std::sqrt(b2))
    return false;
  const Vector3 unit = c / std::sqrt(c2);
  for (const double sign : {1.0, -1.0}) {
    const Vector3 n_W = sign * unit;
    if (!b.separatedBy(n_W, tolerance) || !a.separatedBy(-n_W, tolerance)) continue;
    contact.n_W = n_W;
    contact.p_WP = a.p_W + along_a * a.half_W;
    contact.gap = n_W.dot(r);
    if (contact.gap < -kMaxCrossingDepth - slack) continue;
    return true;
  }
  return false;
}

/// Sets the contact of two pieces from their poses.
void evaluateCrossing(const Piece& a, const Piece& b, double dilation, Contact& contact) {
  if (cross(a, b, 0.0, kConeTolerance, contact)) {
    contact.gap -= dilation;
    return;
  }
  contact.p_WP = a.p_W;
  contact.gap = kDormantGap;
}

/// B's features in A's field.
PairQuery reversed(const PairQuery& query, const PairFeatures& features, double margin) {
  return {
      &features.features_B->points(), features.field_A, query.X_WB, query.X_WA, features.dilation_A, margin};
}

/// A contact of B against A as one of A against B.
Contact turned(const Contact& of_B) {
  Contact contact = of_B;
  contact.n_W = -of_B.n_W;
  contact.area = 0.0;
  contact.kind = ContactKind::kFeaturePoint;
  return contact;
}

void addCounts(const QueryCounts& counts, QueryCounts& sum) {
  sum.spheres_visited += counts.spheres_visited;
  sum.spheres_total += counts.spheres_total;
  sum.points_visited += counts.points_visited;
  sum.points_colliding += counts.points_colliding;
  sum.contacts_dropped += counts.contacts_dropped;
}

/// A contact of `gap` [m] is not listed.
void drop(double gap, PairQueryResult& result) {
  ++result.counts.contacts_dropped;
  result.complete_to = std::min(result.complete_to, gap);
  result.unlisted_gap = std::min(result.unlisted_gap, gap);
}

/// Drops shell points with the largest gaps until `wanted` contacts fit, at most kFeatureRoom.
void makeRoom(std::size_t wanted, PairQueryResult& result) {
  ContactList& contacts = result.contacts;
  const std::size_t most = ContactList::capacity() - std::min(wanted, kFeatureRoom);
  if (contacts.size() <= most) return;
  std::array<std::pair<double, std::uint32_t>, ContactList::capacity()> rank;
  for (std::uint32_t i = 0; i < contacts.size(); ++i) rank[i] = {contacts[i].gap, i};
  const auto end = rank.begin() + static_cast<std::ptrdiff_t>(contacts.size());
  const auto last = rank.begin() + static_cast<std::ptrdiff_t>(most);
  std::nth_element(rank.begin(), last, end);
  const auto limit = *last;
  std::size_t kept = 0;
  for (std::uint32_t i = 0; i < contacts.size(); ++i) {
    if (std::pair(contacts[i].gap, i) < limit) {
      contacts[kept++] = contacts[i];
    } else {
      drop(contacts[i].gap, result);
    }
  }
  contacts.resize(kept);
}

/// Finds the crossings of B's pieces near A with pieces of A, by A's bounding spheres. In A's frame: A's
/// pieces are many, those of B few.
class CrossingSearch {
 public:
  CrossingSearch(const PairQuery& query, const PairFeatures& features, PairQueryResult& result)
      : query_(query), features_(features), result_(result), X_AB_(query.X_WA.inverse() * query.X_WB) {}

  /// `near_A`: B's features near A.
  void run(const ContactList& near_A) {
    const double reach_A = features_.features_A->longestHalf() + query_.dilation + query_.margin;
    for (const Contact& contact : near_A) {
      const FeatureEdge& edge = features_.features_B->edges()[contact.point];
      if (edge.half_M.isZero()) continue;
      const Vector3f p_A = (X_AB_ * Vector3(pointOf(*features_.features_B, contact.point))).cast<float>();
      centres_[count_] = p_A;
      reach_[count_] = static_cast<float>(reach_A) + edge.half_M.norm();
      all_[count_] = static_cast<std::uint16_t>(count_);
      point_[count_++] = contact.point;
    }
    const structures::Pointshell& shell = features_.features_A->points();
    for (const structures::ShellSphere& cluster : shell.clusters()) {
      const auto by_cluster = narrowed(cluster.p_MC, cluster.radius, {all_.data(), count_}, by_cluster_);
      if (by_cluster.empty()) continue;
      for (const structures::ShellSphere& leaf : shell.leaves().subspan(cluster.first, cluster.count)) {
        const auto by_leaf = narrowed(leaf.p_MC, leaf.radius, by_cluster, by_leaf_);
        if (by_leaf.empty()) continue;
        for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) crossPiece(i, by_leaf);
      }
    }
  }

 private:
  using Indices = std::array<std::uint16_t, kMaxPairContacts>;

  static Vector3 pointOf(const structures::FeatureShell& features, std::uint32_t point) {
    return features.points().points()[point].p_MP.cast<double>();
  }

  /// Those of B's pieces that may cross a piece of A within a sphere about `p_AC` of `radius` [m].
  std::span<const std::uint16_t> narrowed(const Vector3f& p_AC, float radius,
                                          std::span<const std::uint16_t> from, Indices& to) const {
    std::size_t count = 0;
    for (const std::uint16_t j : from) {
      const float reach = reach_[j] + radius;
      to[count] = j;
      count += (centres_[j] - p_AC).squaredNorm() <= reach * reach ? 1U : 0U;
    }
    return {to.data(), count};
  }

  void crossPiece(std::uint32_t i, std::span<const std::uint16_t> near) {
    const FeatureEdge& edge = features_.features_A->edges()[i];
    if (edge.half_M.isZero()) return;
    const Vector3f p_A = features_.features_A->points().points()[i].p_MP;
    for (const std::uint16_t j : near) {
      if ((centres_[j] - p_A).squaredNorm() > reach_[j] * reach_[j]) continue;
      Contact contact;
      if (!cross(Piece(*features_.features_A, i, Pose()), Piece(*features_.features_B, point_[j], X_AB_),
                 query_.margin, kListedTolerance, contact) ||
          contact.gap - query_.dilation > query_.margin)
        continue;
      list(i, point_[j], contact);
    }
  }

  void list(std::uint32_t point, std::uint32_t other, Contact& contact) {
    contact.kind = ContactKind::kCrossing;
    contact.point = point;
    contact.other = other;
    evaluateCrossing(Piece(*features_.features_A, point, query_.X_WA),
                     Piece(*features_.features_B, other, query_.X_WB), query_.dilation, contact);
    result_.smallest_gap = std::min(result_.smallest_gap, contact.gap);
    if (listed_ < kMaxCrossings && result_.contacts.push_back(contact)) {
      ++listed_;
    } else {
      drop(std::min(contact.gap, query_.margin), result_);
    }
  }

  const PairQuery& query_;
  const PairFeatures& features_;
  PairQueryResult& result_;
  const Pose X_AB_;
  // B's pieces near A, in A's frame
  std::size_t count_ = 0;
  std::array<Vector3f, kMaxPairContacts> centres_;
  std::array<float, kMaxPairContacts> reach_;  ///< [m] centres of pieces that cross it are no farther
  std::array<std::uint32_t, kMaxPairContacts> point_;
  Indices all_, by_cluster_, by_leaf_;
  std::size_t listed_ = 0;
};

}  // namespace

void queryFeatures(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                   PairQueryResult& result) noexcept {
  if (!features.any()) return;
  const double half_A = features.features_A->longestHalf();
  const double half_B = features.features_B->longestHalf();
  PairQueryResult& of_B = scratch.of_B;
  queryPair(reversed(query, features, query.margin + half_B), of_B);
  addCounts(of_B.counts, result.counts);
  result.smallest_gap = std::min(result.smallest_gap, of_B.smallest_gap);
  result.unlisted_gap = std::min(result.unlisted_gap, of_B.unlisted_gap);
  result.deepest = std::max(result.deepest, of_B.deepest);
  if (of_B.complete_to < query.margin) result.complete_to = std::min(result.complete_to, of_B.complete_to);

  const auto near = static_cast<std::size_t>(
      std::count_if(of_B.contacts.begin(), of_B.contacts.end(),
                    [&](const Contact& contact) { return contact.gap <= query.margin; }));
  makeRoom(near + (of_B.contacts.empty() ? 0 : kMaxCrossings), result);
  for (const Contact& contact : of_B.contacts) {
    if (contact.gap > query.margin) {
      result.unlisted_gap = std::min(result.unlisted_gap, contact.gap);
    } else if (!result.contacts.push_back(turned(contact))) {
      drop(contact.gap, result);
    }
  }
  if (half_A == 0.0 || half_B == 0.0) return;

  // a crossing is nearer than the centre of B's piece by half its length at most
  const double crossing_bound = of_B.contacts.empty() ? of_B.smallest_gap - half_B : query.margin;
  if (!of_B.contacts.empty()) CrossingSearch(query, features, result).run(of_B.contacts);
  result.smallest_gap = std::min(result.smallest_gap, crossing_bound);
  result.unlisted_gap = std::min(result.unlisted_gap, crossing_bound);
}

void resampleFeatures(const PairQuery& query, const PairFeatures& features, double displacement,
                      FeatureScratch& scratch, PairQueryResult& result) noexcept {
  ContactList& contacts = result.contacts;
  const auto first = std::find_if(contacts.begin(), contacts.end(), [](const Contact& contact) {
    return contact.kind != ContactKind::kShellPoint;
  });
  ContactList& points = scratch.of_B.contacts;
  ContactList& crossings = scratch.crossings;
  points.clear();
  crossings.clear();
  for (const Contact* contact = first; contact != contacts.end(); ++contact)
    (contact->kind == ContactKind::kFeaturePoint ? points : crossings).push_back(*contact);
  contacts.resize(static_cast<std::size_t>(first - contacts.begin()));
  resampleContacts(query, displacement, result);
  if (!points.empty()) {
    scratch.of_B.reduced = false;
    scratch.of_B.unlisted_gap = result.unlisted_gap;
    resampleContacts(reversed(query, features, query.margin), displacement, scratch.of_B);
    result.unlisted_gap = scratch.of_B.unlisted_gap;
    result.smallest_gap = std::min(result.smallest_gap, scratch.of_B.smallest_gap);
    result.deepest = std::max(result.deepest, scratch.of_B.deepest);
    if (!result.reduced) result.counts.points_colliding += scratch.of_B.counts.points_colliding;
    for (const Contact& contact : points) contacts.push_back(turned(contact));
  }
  for (Contact& contact : crossings) {
    evaluateCrossing(Piece(*features.features_A, contact.point, query.X_WA),
                     Piece(*features.features_B, contact.other, query.X_WB), query.dilation, contact);
    result.smallest_gap = std::min(result.smallest_gap, contact.gap);
    contacts.push_back(contact);
  }
  result.deepest = std::max(result.deepest, -(result.smallest_gap + query.dilation));
}

}  // namespace tenon::collision
