#include "server/collision/edge_wedge.h"

#include <algorithm>
#include <cmath>

namespace tenon::collision {
namespace {

/// [m] A point nearer to an edge is at neither of its faces.
constexpr double kAtEdge = 1e-6;

/// [m] By this a point may be deeper than its distance to the end of the edge: solving leaves that much.
constexpr double kEndDepth = 1e-4;

/// [-] As the bake's: less skew of a plane is rounding.
constexpr double kFlatSkew = 1e-3;

/// [-] Square of the skew of the plane between pieces that turn by 30 degrees: one of a round rim's is enough
/// to hold a point.
constexpr double kFlatCorner2 = 0.072;

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

}  // namespace

std::array<Vector3, 2> normalsOf(const EdgePiece& piece) noexcept {
  const double cosine = piece.into[0].dot(piece.into[1]);
  const double sine = std::sqrt(1.0 - cosine * cosine);
  return {(cosine * piece.into[0] - piece.into[1]) / sine, (cosine * piece.into[1] - piece.into[0]) / sine};
}

bool isBeside(const Vector3& p, const EdgePiece& piece, double slack, Contact& contact) noexcept {
  if (piece.reach == 0.0) return false;
  const Vector3 r = p - piece.p;
  const double half2 = piece.half.squaredNorm();
  const double along = r.dot(piece.half) / half2;
  const Vector3 across = r - along * piece.half;
  const double reach = piece.reach + slack;
  if (across.squaredNorm() >= reach * reach) return false;
  const double cosine = piece.into[0].dot(piece.into[1]);
  const auto [n_0, n_1] = normalsOf(piece);
  const double gap_0 = n_0.dot(across);
  const double gap_1 = n_1.dot(across);
  contact.n_W = gap_0 > gap_1 ? n_0 : n_1;
  // at the edge itself neither face is the nearer one, and a point may slide on from either to the other
  if (across.squaredNorm() < kAtEdge * kAtEdge) contact.n_W = (n_0 + n_1).normalized();
  contact.gap = contact.n_W.dot(across);
  const double half = std::sqrt(half2);
  if (!isBetweenEnds(piece, along * half, half, {piece.into[0].dot(across), piece.into[1].dot(across)},
                     cosine, slack, -contact.gap))
    return false;
  contact.p_WP = p;
  return true;
}

}  // namespace tenon::collision
