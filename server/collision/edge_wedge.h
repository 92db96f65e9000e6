#pragma once

#include <array>

#include "server/collision/edge_piece.h"
#include "server/collision/pair_query.h"

namespace tenon::collision {

/// [-] Relative to half a piece: a contact at the border of two pieces is in one of them.
inline constexpr double kEndTolerance = 1e-3;

/// [m] Contacts are exact to less: what is nearer to the end of an edge grazes it.
inline constexpr double kGrazing = 1e-5;

/// Outward unit normals of the planes of a piece's faces.
///
/// Threads: pure. Real-time.
[[nodiscard]] std::array<Vector3, 2> normalsOf(const EdgePiece& piece) noexcept;

/// A point beside a piece, in their frame, as a contact of the point's body against the piece's: the gap is
/// that of the wedge, the larger of the distances to the planes of its faces. `slack` [m] beyond the ends and
/// the reach of the piece. False where the piece's body need not be the wedge.
///
/// Threads: pure. Real-time.
[[nodiscard]] bool isBeside(const Vector3& p, const EdgePiece& piece, double slack,
                            Contact& contact) noexcept;

}  // namespace tenon::collision
