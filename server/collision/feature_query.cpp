#include "server/collision/feature_query.h"

#include <algorithm>
#include <limits>
#include <span>

#include "server/collision/crossing_search.h"
#include "server/collision/edge_crossing.h"
#include "server/collision/edge_wedge.h"
#include "server/collision/feature_lists.h"

namespace tenon::collision {
namespace {

/// Whether a feature of A may meet one of B: at least one is a piece of an edge.
bool canCross(const PairFeatures& features) {
  return !features.features_A->empty() &&
         (features.features_A->longestHalf() > 0.0 || features.features_B->longestHalf() > 0.0);
}

/// B's features in A's field.
PairQuery reversed(const PairQuery& query, const PairFeatures& features, double margin) {
  PairQuery of_B{&features.features_B->points(), features.field_A, query.X_WB, query.X_WA, margin};
  of_B.correct_valleys = query.correct_valleys;
  return of_B;
}

/// Adds to the gaps of B's features what A's field is dilated beyond `most_dilation_A`. Returns the smallest
/// [m] of them and `others` [m].
double limitDilation(const PairFeatures& features, const Pose& X_WA, std::span<Contact> contacts,
                     double others) {
  const Pose X_AW = X_WA.inverse();
  double smallest = others;
  for (Contact& contact : contacts) {
    contact.gap += features.field_A->dilationBeyond(features.most_dilation_A, X_AW * contact.p_WP);
    smallest = std::min(smallest, contact.gap);
  }
  return smallest;
}

bool isDilationLimited(const PairFeatures& features) {
  return features.most_dilation_A < features.field_A->dilation();
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

/// End of the contacts of a kind that begin at `from`.
Contact* endOf(ContactKind kind, Contact* from, Contact* end) {
  return std::find_if(from, end, [kind](const Contact& contact) { return contact.kind != kind; });
}

/// Evaluates feature points anew, and moves them to `to`. Returns their end.
Contact* resamplePoints(const PairQuery& query, const PairFeatures& features, double displacement,
                        std::span<Contact> points, Contact* to, PairQueryResult& result) {
  ResampledPart part = resamplePart(reversed(query, features, query.margin), points);
  points = points.first(part.kept);
  if (isDilationLimited(features))
    part.smallest_gap = limitDilation(features, query.X_WA, points, part.smallest_left_gap);
  result.smallest_gap = std::min(result.smallest_gap, part.smallest_gap);
  result.deepest = std::max(result.deepest, -part.smallest_gap);
  result.unlisted_gap = std::min(result.unlisted_gap, part.smallest_left_gap - displacement);
  if (!result.reduced) result.counts.points_colliding += part.points_colliding;
  for (Contact& contact : points) {
    contact.n_W = -contact.n_W;
    if (to != &contact) *to = contact;
    ++to;
  }
  return to;
}

/// Evaluates crossings anew, and moves them to `to`. Returns their end.
Contact* resampleCrossings(const PairQuery& query, const PairFeatures& features,
                           std::span<const Contact> crossings, Contact* to, PairQueryResult& result) {
  const Transform X_WA(query.X_WA);
  const Transform X_AB(query.X_WA.inverse() * query.X_WB);
  for (const Contact& crossing : crossings) {
    Contact& contact = *to++;
    if (&contact != &crossing) contact = crossing;
    evaluateCrossing(pieceOf(*features.features_A, contact.point),
                     pieceOf(*features.features_B, contact.other, X_AB), X_WA, contact);
    include(contact, result);
  }
  return to;
}

}  // namespace

void queryFeatures(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                   PairQueryResult& result) noexcept {
  result.dormant_gap = std::numeric_limits<double>::infinity();
  if (!features.any()) return;
  const double nearer = nearerBy(features.features_B->longestHalf(), features);
  PairQueryResult& of_B = scratch.of_B;
  PairQuery all = reversed(query, features, query.margin + nearer);
  all.stop_when_full = true;
  queryPair(all, of_B);
  const bool crowded = of_B.counts.contacts_dropped > 0;
  if (crowded) {
    PairQuery reduced = reversed(query, features, query.margin);
    reduced.reduce = true;
    queryPair(reduced, of_B);
    result.reduced = result.reduced || of_B.reduced;
  }
  if (isDilationLimited(features)) {
    of_B.smallest_gap =
        limitDilation(features, query.X_WA, {of_B.contacts.begin(), of_B.contacts.size()}, of_B.unlisted_gap);
    of_B.deepest = std::max(-of_B.smallest_gap, 0.0);
  }
  addCounts(of_B.counts, result.counts);
  result.smallest_gap = std::min(result.smallest_gap, of_B.smallest_gap);
  result.unlisted_gap = std::min(result.unlisted_gap, of_B.unlisted_gap);
  result.deepest = std::max(result.deepest, of_B.deepest);
  if (of_B.complete_to < query.margin) result.complete_to = std::min(result.complete_to, of_B.complete_to);

  ContactList& points = of_B.contacts;
  ContactList& crossings = scratch.crossings;
  crossings.clear();
  double crossing_bound = of_B.unlisted_gap - nearer;
  if (canCross(features) && !points.empty()) {
    CrossingSearch search(query, features, scratch, result);
    if (crowded) {
      search.run();
    } else {
      search.run(points);
    }
    keepNearest(kMaxCrossings, query.margin, crossings, result);
    crossing_bound = crowded ? search.margin() : std::min(crossing_bound, search.margin());
  }
  keepWithin(query.margin, points, result);
  const std::size_t room =
      std::min(points.size() + crossings.size(), crowded ? 2 * kFeatureRoom : kFeatureRoom);
  keepNearest(ContactList::capacity() - room, query.margin, result.contacts, result);
  keepNearest(ContactList::capacity() - result.contacts.size() - crossings.size(), query.margin, points,
              result);
  for (const Contact& contact : points) result.contacts.push_back(turned(contact));
  for (const Contact& contact : crossings) result.contacts.push_back(contact);
  if (!canCross(features)) return;

  if (crossing_bound < query.margin) result.complete_to = std::min(result.complete_to, crossing_bound);
  result.smallest_gap = std::min(result.smallest_gap, std::max(crossing_bound, 0.0));
  result.unlisted_gap = std::min(result.unlisted_gap, crossing_bound);
}

double featureGap(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                  QueryCounts& counts) noexcept {
  if (!features.any()) return std::numeric_limits<double>::infinity();
  const double nearer = canCross(features) ? nearerBy(features.features_B->longestHalf(), features) : 0.0;
  PairQuery of_B = reversed(query, features, query.margin + nearer);
  of_B.list = false;
  queryPair(of_B, scratch.of_B);
  addCounts(scratch.of_B.counts, counts);
  return scratch.of_B.smallest_gap - nearer;
}

FixedVector<ContactSide, 2> sidesOfWedge(const PairFeatures& features, const Contact& crossing,
                                         const Pose& X_WA, const Pose& X_WB) noexcept {
  FixedVector<ContactSide, 2> sides;
  if (crossing.dormant()) return sides;
  const EdgePiece a = pieceOf(*features.features_A, crossing.point);
  const EdgePiece b = pieceOf(*features.features_B, crossing.other);
  if (!a.isPoint() && !b.isPoint() &&
      !areParallel({.half = X_WA.rotation() * a.half}, {.half = X_WB.rotation() * b.half}))
    return sides;
  const EdgePiece& piece = a.isPoint() ? b : a;
  const Pose& X_WP = a.isPoint() ? X_WB : X_WA;  // of the piece's body
  const double sign = a.isPoint() ? 1.0 : -1.0;
  const Vector3 r = X_WP.inverse() * crossing.p_WP - piece.p;
  for (const Vector3& n : normalsOf(piece)) sides.push_back({X_WP.rotation() * (sign * n), n.dot(r)});
  return sides;
}

void resampleFeatures(const PairQuery& query, const PairFeatures& features, double displacement,
                      PairQueryResult& result) noexcept {
  ContactList& contacts = result.contacts;
  Contact* const points = endOf(ContactKind::kShellPoint, contacts.begin(), contacts.end());
  Contact* const crossings = endOf(ContactKind::kFeaturePoint, points, contacts.end());
  Contact* const end = contacts.end();
  contacts.resize(static_cast<std::size_t>(points - contacts.begin()));
  resampleContacts(query, displacement, result);
  // contacts that left the band make room
  Contact* kept = contacts.end();
  if (points != crossings)
    kept = resamplePoints(query, features, displacement, {points, crossings}, kept, result);
  result.dormant_gap = std::numeric_limits<double>::infinity();
  if (crossings != end) kept = resampleCrossings(query, features, {crossings, end}, kept, result);
  contacts.resize(static_cast<std::size_t>(kept - contacts.begin()));
}

}  // namespace tenon::collision
