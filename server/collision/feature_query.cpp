#include "server/collision/feature_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

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

/// [m] Contacts are exact to less: what is nearer to the end of an edge grazes it, and a point that is nearer
/// to an edge is at neither of its faces.
constexpr double kGrazing = 1e-5;

/// [m] By this a point may be deeper than its distance to the end of the edge: solving leaves that much.
constexpr double kEndDepth = 1e-4;

/// [-] As the bake's: less skew of a plane is rounding.
constexpr double kFlatSkew = 1e-3;

/// [-] Square of the skew of the plane between pieces that turn by 30 degrees: one of a round rim's is enough
/// to hold a point.
constexpr double kFlatCorner2 = 0.072;

/// [voxels] By which interpolation rounds a convex edge off.
constexpr double kRounding = 0.45;

/// A frame's rotation as matrix: many vectors are turned by it.
struct Transform {
  explicit Transform(const Pose& X) : R(X.matrix()), p(X.translation()) {}
  [[nodiscard]] Vector3 operator*(const Vector3f& p_BP) const { return p + R * p_BP.cast<double>(); }
  [[nodiscard]] Vector3 turned(const Vector3f& v_B) const { return R * v_B.cast<double>(); }
  Matrix3 R;
  Vector3 p;
};

EdgePiece pieceOf(const structures::FeatureShell& features, std::uint32_t point) {
  const FeatureEdge& edge = features.edges()[point];
  return {features.points().points()[point].p_MP.cast<double>(),
          edge.half_M.cast<double>(),
          {edge.into_M[0].cast<double>(), edge.into_M[1].cast<double>()},
          edge.reach,
          {edge.beyond[0], edge.beyond[1]},
          edge.skew};
}

EdgePiece pieceOf(const structures::FeatureShell& features, std::uint32_t point, const Transform& X_AB) {
  const FeatureEdge& edge = features.edges()[point];
  return {X_AB * features.points().points()[point].p_MP,
          X_AB.turned(edge.half_M),
          {X_AB.turned(edge.into_M[0]), X_AB.turned(edge.into_M[1])},
          edge.reach,
          {edge.beyond[0], edge.beyond[1]},
          edge.skew};
}

/// [-] The direction of +-c in which the body of a piece lies on the far side of a plane through the edge; 0:
/// neither. `slack` [-]: c . into may exceed 0 by this, times the length of c.
double separatingSign(const EdgePiece& piece, const Vector3& c, double slack) {
  const double first = c.dot(piece.into[0]);
  const double second = c.dot(piece.into[1]);
  if (std::max(first, second) <= slack) return 1.0;
  return std::min(first, second) >= -slack ? -1.0 : 0.0;
}

/// Whether a contact at `along` [-] halves from the centre of a piece, or `slack` [m] beside it, is one of
/// the piece, and not at the end of the edge: what grazes an end, as a corner that slides over a face, passes
/// it.
bool isWithin(const EdgePiece& piece, double half2, double along, double slack) {
  const double half = std::sqrt(half2);
  const double past = (std::abs(along) - 1.0) * half - slack;
  return past <= kEndTolerance * half && piece.beyond[along > 0.0 ? 1 : 0] - past >= kGrazing;
}

/// Two pieces as a contact of A against B, in their frame. `slack` [m] beyond their ends, `tolerance` [-] of
/// the normal. False when they do not cross there.
bool cross(const EdgePiece& a, const EdgePiece& b, double slack, double tolerance, Contact& contact) {
  const Vector3 c = a.half.cross(b.half);
  const double c2 = c.squaredNorm();
  const double a2 = a.half.squaredNorm();
  const double b2 = b.half.squaredNorm();
  if (c2 <= kMinSine2 * a2 * b2) return false;
  const double length = std::sqrt(c2);
  const double sign = separatingSign(b, c, tolerance * length);
  if (sign == 0.0 || (-sign * c.dot(a.into[0]) > tolerance * length) ||
      (-sign * c.dot(a.into[1]) > tolerance * length))
    return false;
  const Vector3 r = a.p - b.p;
  contact.gap = sign / length * c.dot(r);
  if (contact.gap < -kMaxCrossingDepth - slack) return false;
  // closest points a.p + along_a * a.half, b.p + along_b * b.half of the two lines
  const double along_a = -r.dot(b.half.cross(c)) / c2;
  const double along_b = -r.dot(a.half.cross(c)) / c2;
  if (!isWithin(a, a2, along_a, slack) || !isWithin(b, b2, along_b, slack)) return false;
  contact.n_W = sign / length * c;
  contact.p_WP = a.p + along_a * a.half;
  return true;
}

/// Whether a point at `r` across an edge, in terms of `into` [m], is between the skewed planes in which a
/// piece ends, and from those that end the edge as far as `depth` [m] and kGrazing. `along` [m] from the
/// centre of the piece, `half` [m] its length, `cosine` [-] between its faces, `slack` [m].
bool isBetweenEnds(const EdgePiece& piece, double along, double half, const std::array<double, 2>& r,
                   double cosine, double slack, double depth) {
  for (const std::size_t end : {0U, 1U}) {
    const Eigen::Vector2f& skew = piece.skew[end];
    double past = (end == 0 ? -along : along) - half;
    double slope = 1.0;
    if (!skew.isZero(0.0F)) {
      const double first = skew[0];
      const double second = skew[1];
      const double towards_0 = first + cosine * second;
      const double towards_1 = second + cosine * first;
      double before = first * r[0] + second * r[1];
      const double skew2 = first * towards_0 + second * towards_1;
      // beside the solid, in an inner corner that is not flat, both neighbours hold a point
      if (skew2 > kFlatCorner2 && std::max(towards_0, towards_1) < kFlatSkew) before = std::min(before, 0.0);
      past += before;
      slope = std::sqrt(1.0 + skew2);
    }
    past -= slope * slack;
    // deeper than that the face at the end of the edge is nearer
    if (past > kEndTolerance * half ||
        piece.beyond[end] - past < std::max(kGrazing, slope * (depth - slack - kEndDepth)))
      return false;
  }
  return true;
}

/// A point beside a piece, in their frame, as a contact of the point's body against the piece's: the gap is
/// that of the wedge, the larger of the distances to the planes of its faces. `slack` [m] beyond the ends and
/// the reach of the piece. False where the piece's body need not be the wedge.
bool isBeside(const Vector3& p, const EdgePiece& piece, double slack, Contact& contact) {
  if (piece.reach == 0.0) return false;
  const Vector3 r = p - piece.p;
  const double half2 = piece.half.squaredNorm();
  const double along = r.dot(piece.half) / half2;
  const Vector3 across = r - along * piece.half;
  const double reach = piece.reach + slack;
  if (across.squaredNorm() >= reach * reach) return false;
  const double cosine = piece.into[0].dot(piece.into[1]);
  const double sine = std::sqrt(1.0 - cosine * cosine);
  const Vector3 n_0 = (cosine * piece.into[0] - piece.into[1]) / sine;
  const Vector3 n_1 = (cosine * piece.into[1] - piece.into[0]) / sine;
  const double gap_0 = n_0.dot(across);
  const double gap_1 = n_1.dot(across);
  contact.n_W = gap_0 > gap_1 ? n_0 : n_1;
  // at the edge itself neither face is the nearer one, and a point may slide on from either to the other
  if (across.squaredNorm() < kGrazing * kGrazing) contact.n_W = (n_0 + n_1).normalized();
  contact.gap = contact.n_W.dot(across);
  const double half = std::sqrt(half2);
  if (!isBetweenEnds(piece, along * half, half, {piece.into[0].dot(across), piece.into[1].dot(across)},
                     cosine, slack, -contact.gap))
    return false;
  contact.p_WP = p;
  return true;
}

/// Two features, of which at least one is a piece of an edge, as a contact of A against B in their frame; as
/// cross() and isBeside().
bool meet(const EdgePiece& a, const EdgePiece& b, double slack, double tolerance, Contact& contact) {
  if (a.isPoint()) return isBeside(a.p, b, slack, contact);
  if (!b.isPoint()) return cross(a, b, slack, tolerance, contact);
  if (!isBeside(b.p, a, slack, contact)) return false;
  contact.n_W = -contact.n_W;
  return true;
}

/// [m] Distance of a point at `r` from the middle of a segment.
double distanceToSegment(const Vector3& r, const Vector3& half) {
  return (r - std::clamp(r.dot(half) / half.squaredNorm(), -1.0, 1.0) * half).norm();
}

/// [m] Distance of two segments, one of which may be a point (Ericson, Real-Time Collision Detection, 5.1.9).
double segmentDistance(const EdgePiece& a, const EdgePiece& b) {
  if (a.isPoint()) return distanceToSegment(a.p - b.p, b.half);
  if (b.isPoint()) return distanceToSegment(b.p - a.p, a.half);
  const Vector3 r = a.p - b.p;
  const double aa = a.half.squaredNorm();
  const double bb = b.half.squaredNorm();
  const double ab = a.half.dot(b.half);
  const double ar = a.half.dot(r);
  const double br = b.half.dot(r);
  const double determinant = aa * bb - ab * ab;
  const auto onSegment = [](double along) { return std::clamp(along, -1.0, 1.0); };
  double along_a = determinant > 0.0 ? onSegment((ab * br - ar * bb) / determinant) : 0.0;
  const double along_b = onSegment((ab * along_a + br) / bb);
  along_a = onSegment((ab * along_b - ar) / aa);
  return (r + along_a * a.half - along_b * b.half).norm();
}

/// The contact of two features in W, from A's frame.
void evaluateCrossing(const EdgePiece& a, const EdgePiece& b, const Transform& X_WA, Contact& contact) {
  Vector3 p_A = a.p;
  if (meet(a, b, 0.0, kConeTolerance, contact)) {
    contact.n_W = X_WA.R * contact.n_W;
    p_A = contact.p_WP;
  } else {
    contact.gap = kDormantGap + segmentDistance(a, b);
    contact.n_W = Vector3::UnitZ();
  }
  contact.p_WP = X_WA.p + X_WA.R * p_A;
}

/// Whether a feature of A may meet one of B: at least one is a piece of an edge.
bool canCross(const PairFeatures& features) {
  return !features.features_A->empty() &&
         (features.features_A->longestHalf() > 0.0 || features.features_B->longestHalf() > 0.0);
}

/// [m] By this a crossing may be nearer than the gap of a feature of B in A's field: half the feature's
/// length, or where voxels are large, what interpolation rounds off A's edges.
double nearerBy(double half, const PairFeatures& features) {
  return std::max(half, kRounding * features.field_A->voxel());
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

/// A crossing counts in the gaps of all contacts.
void include(const Contact& crossing, PairQueryResult& result) {
  if (crossing.dormant()) {
    result.dormant_gap = std::min(result.dormant_gap, crossing.gapBound());
    return;
  }
  result.smallest_gap = std::min(result.smallest_gap, crossing.gap);
  result.deepest = std::max(result.deepest, -crossing.gap);
}

/// The contact is not listed. Its gap counts up to `margin` [m].
void drop(const Contact& contact, double margin, PairQueryResult& result) {
  const double gap = std::min(contact.gapBound(), margin);
  result.counts.contacts_dropped += contact.dormant() ? 0U : 1U;
  result.complete_to = std::min(result.complete_to, gap);
  result.unlisted_gap = std::min(result.unlisted_gap, gap);
}

/// Keeps the contacts up to a gap of `margin` [m].
void keepWithin(double margin, ContactList& contacts, PairQueryResult& result) {
  std::size_t kept = 0;
  for (const Contact& contact : contacts) {
    if (contact.gap <= margin) {
      contacts[kept++] = contact;
    } else {
      result.unlisted_gap = std::min(result.unlisted_gap, contact.gap);
    }
  }
  contacts.resize(kept);
}

/// Keeps the `most` contacts with the smallest gaps, in their order, and drops the others.
void keepNearest(std::size_t most, double margin, ContactList& contacts, PairQueryResult& result) {
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
      drop(contacts[i], margin, result);
    }
  }
  contacts.resize(kept);
}

/// Lists the crossings of B's features near A with those of A, by A's bounding spheres. In A's frame: A's
/// features are many, those of B few.
class CrossingSearch {
 public:
  CrossingSearch(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                 PairQueryResult& result)
      : query_(query),
        features_(features),
        near_(scratch.near),
        crossings_(scratch.crossings),
        result_(result),
        X_WA_(query.X_WA) {}

  /// `near_A`: B's features near A.
  void run(const ContactList& near_A) {
    near_.count = 0;
    const Transform X_AB(query_.X_WA.inverse() * query_.X_WB);
    const double reach_A = features_.features_A->longestHalf() + query_.margin;
    for (const Contact& contact : near_A) {
      const float half = features_.features_B->edges()[contact.point].half_M.norm();
      if (contact.gap > query_.margin + nearerBy(half, features_)) continue;
      EdgePiece& piece = near_.pieces[near_.count];
      piece = pieceOf(*features_.features_B, contact.point, X_AB);
      const Vector3f p_A = piece.p.cast<float>();
      const float reach = static_cast<float>(reach_A) + half;
      near_.all[near_.count] = {p_A, reach, near_.count};
      near_.point[near_.count++] = contact.point;
      box_A_.extend(p_A - Vector3f::Constant(reach));
      box_A_.extend(p_A + Vector3f::Constant(reach));
    }
    if (near_.count == 0) return;
    const structures::Pointshell& shell = features_.features_A->points();
    for (const structures::ShellSphere& cluster : shell.clusters()) {
      const auto by_cluster = narrowed(cluster, {near_.all.data(), near_.count}, near_.by_cluster);
      if (by_cluster.empty()) continue;
      for (const structures::ShellSphere& leaf : shell.leaves().subspan(cluster.first, cluster.count)) {
        const auto by_leaf = narrowed(leaf, by_cluster, near_.by_leaf);
        if (by_leaf.empty()) continue;
        for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) crossFeature(i, by_leaf);
      }
    }
  }

 private:
  using Ball = NearPieces::Ball;

  /// Those of B's features that may meet a feature of A within a sphere.
  std::span<const Ball> narrowed(const structures::ShellSphere& sphere, std::span<const Ball> from,
                                 NearPieces::Balls& to) const {
    if (box_A_.squaredExteriorDistance(sphere.p_MC) > sphere.radius * sphere.radius) return {};
    std::size_t count = 0;
    for (const Ball& ball : from) {
      const float reach = ball.reach + sphere.radius;
      to[count] = ball;
      count += (ball.p_A - sphere.p_MC).squaredNorm() <= reach * reach ? 1U : 0U;
    }
    return {to.data(), count};
  }

  void crossFeature(std::uint32_t i, std::span<const Ball> near) {
    const Vector3f p_A = features_.features_A->points().points()[i].p_MP;
    EdgePiece piece;
    bool known = false;
    for (const Ball& ball : near) {
      if ((ball.p_A - p_A).squaredNorm() > ball.reach * ball.reach) continue;
      if (!known) piece = pieceOf(*features_.features_A, i);
      known = true;
      const EdgePiece& other = near_.pieces[ball.piece];
      Contact contact;
      if (piece.isPoint() && other.isPoint()) continue;
      if (!meet(piece, other, query_.margin, kListedTolerance, contact) || contact.gap > query_.margin)
        continue;
      contact.kind = ContactKind::kCrossing;
      contact.point = i;
      contact.other = near_.point[ball.piece];
      evaluateCrossing(piece, other, X_WA_, contact);
      include(contact, result_);
      if (!crossings_.push_back(contact)) drop(contact, query_.margin, result_);
    }
  }

  const PairQuery& query_;
  const PairFeatures& features_;
  NearPieces& near_;
  ContactList& crossings_;
  PairQueryResult& result_;
  const Transform X_WA_;
  Eigen::AlignedBox3f box_A_;  ///< of the balls of all near pieces
};

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
  queryPair(reversed(query, features, query.margin + nearer), of_B);
  if (isDilationLimited(features)) {
    of_B.smallest_gap =
        limitDilation(features, query.X_WA, {of_B.contacts.begin(), of_B.contacts.size()}, of_B.unlisted_gap);
    of_B.deepest = std::max(-of_B.smallest_gap, 0.0);
  }
  // what it lacks beyond the margin is no contact of this list
  if (of_B.complete_to >= query.margin) of_B.counts.contacts_dropped = 0;
  addCounts(of_B.counts, result.counts);
  result.smallest_gap = std::min(result.smallest_gap, of_B.smallest_gap);
  result.unlisted_gap = std::min(result.unlisted_gap, of_B.unlisted_gap);
  result.deepest = std::max(result.deepest, of_B.deepest);
  if (of_B.complete_to < query.margin) result.complete_to = std::min(result.complete_to, of_B.complete_to);

  ContactList& points = of_B.contacts;
  ContactList& crossings = scratch.crossings;
  crossings.clear();
  const bool searched = canCross(features) && !points.empty();
  if (searched) {
    CrossingSearch(query, features, scratch, result).run(points);
    keepNearest(kMaxCrossings, query.margin, crossings, result);
  }
  keepWithin(query.margin, points, result);
  const std::size_t room = std::min(points.size() + crossings.size(), kFeatureRoom);
  keepNearest(ContactList::capacity() - room, query.margin, result.contacts, result);
  keepNearest(ContactList::capacity() - result.contacts.size() - crossings.size(), query.margin, points,
              result);
  for (const Contact& contact : points) result.contacts.push_back(turned(contact));
  for (const Contact& contact : crossings) result.contacts.push_back(contact);
  if (!canCross(features)) return;

  double crossing_bound = of_B.unlisted_gap - nearer;
  if (searched) crossing_bound = std::min(crossing_bound, query.margin);
  if (crossing_bound < query.margin) result.complete_to = std::min(result.complete_to, crossing_bound);
  result.smallest_gap = std::min(result.smallest_gap, crossing_bound);
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
