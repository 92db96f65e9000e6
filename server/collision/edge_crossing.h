#pragma once

#include "server/collision/edge_piece.h"
#include "server/collision/pair_query.h"

namespace tenon::collision {

/// [-] n . into may exceed 0 by this where the normal of a crossing is along a face.
inline constexpr double kConeTolerance = 1e-3;

/// [-] The same for a crossing that is listed: bodies turn until the next traversal.
inline constexpr double kListedTolerance = 0.2;

/// Whether two pieces of edges are nearer to parallel than 5 degrees: these do not cross.
///
/// Threads: pure. Real-time.
[[nodiscard]] bool areParallel(const EdgePiece& a, const EdgePiece& b) noexcept;

/// Two features, of which at least one is a piece of an edge, as a contact of A against B in their frame: two
/// edges that cross, or a point beside an edge as isBeside(). Of an edge of B along one of A the centre of
/// the piece is a point beside A's. `slack` [m] beyond the ends of pieces and their reach, `tolerance` [-] of
/// the normal. False when they do not meet.
///
/// Threads: pure. Real-time.
[[nodiscard]] bool meet(const EdgePiece& a, const EdgePiece& b, double slack, double tolerance,
                        Contact& contact) noexcept;

/// Sets gap, normal and place of a crossing, in W, from two features in A's frame. Dormant where they do not
/// meet.
///
/// Threads: pure. Real-time.
void evaluateCrossing(const EdgePiece& a, const EdgePiece& b, const Transform& X_WA,
                      Contact& contact) noexcept;

}  // namespace tenon::collision
