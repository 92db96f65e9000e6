#include "server/collision/edge_crossing.h"

#include <algorithm>
#include <cmath>

#include "server/collision/edge_wedge.h"

namespace tenon::collision {
namespace {

/// [-] Squared sine of 5 degrees: edges nearer to parallel do not cross, their ends and faces touch.
constexpr double kMinSine2 = 0.0076;

/// [m] Deeper crossings do not count: the edges are those of far sides of thin parts.
constexpr double kMaxCrossingDepth = 5e-4;

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

}  // namespace

bool areParallel(const EdgePiece& a, const EdgePiece& b) noexcept {
  return a.half.cross(b.half).squaredNorm() <= kMinSine2 * a.half.squaredNorm() * b.half.squaredNorm();
}

bool meet(const EdgePiece& a, const EdgePiece& b, double slack, double tolerance, Contact& contact) noexcept {
  if (a.isPoint()) return isBeside(a.p, b, slack, contact);
  if (!b.isPoint() && !areParallel(a, b)) return cross(a, b, slack, tolerance, contact);
  if (!isBeside(b.p, a, slack, contact)) return false;
  contact.n_W = -contact.n_W;
  return true;
}

void evaluateCrossing(const EdgePiece& a, const EdgePiece& b, const Transform& X_WA,
                      Contact& contact) noexcept {
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

}  // namespace tenon::collision
