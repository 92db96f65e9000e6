#pragma once

#include <cstddef>

#include "server/structures/triangle.h"

namespace tenon::bake {

/// Halves a triangle at its longest edge until fits(centre, longest edge [m]) holds of all pieces, and calls
/// visit(centre, area [m^2]) for each.
template <typename Fits, typename Visit>
void forEachPiece(const structures::Triangle& t, Fits&& fits, Visit&& visit) {
  const Vector3 centre = (t[0] + t[1] + t[2]) / 3.0;
  std::size_t a = 0;
  if (fits(centre, structures::longestEdge(t, a))) {
    visit(centre, structures::areaOf(t));
    return;
  }
  const std::size_t b = (a + 1) % 3;
  const Vector3 middle = (t[a] + t[b]) / 2;
  structures::Triangle first = t;
  structures::Triangle second = t;
  first[b] = middle;
  second[a] = middle;
  forEachPiece(first, fits, visit);
  forEachPiece(second, fits, visit);
}

}  // namespace tenon::bake
