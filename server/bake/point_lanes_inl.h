// The distances of several points to a triangle at once. Included once for each instruction set, with its
// name TENON_LANES_TARGET, the bytes of its registers TENON_LANES_BYTES, the name of the struct that is
// defined TENON_LANES_STRUCT, and TENON_LANES_ANY(mask), 0 when no lane of a mask is set.

#include <cstddef>

#include "server/bake/prepared_triangle.h"

// in the order of Eigen's dot product
#define TENON_LANES_DOT(u, v) ((u)[0] * (v)[0] + (u)[1] * (v)[1] + (u)[2] * (v)[2])

namespace tenon::bake {

struct TENON_LANES_STRUCT {
  using Lanes [[gnu::vector_size(TENON_LANES_BYTES)]] = double;
  using Mask [[gnu::vector_size(TENON_LANES_BYTES)]] = long long;
  static constexpr std::size_t kCount = TENON_LANES_BYTES / sizeof(double);

  /// PointBlock::lower() of as many points as there are lanes, with coordinates [m] from x, y and z on,
  /// `slack` [m^2] and `squared` [m^2]. The operations are those of structures::squaredDistance() in its
  /// order, so that results have the same bits.
  __attribute__((target(TENON_LANES_TARGET))) static void lowerLanes(const PreparedTriangle& t,
                                                                     const double* x, const double* y,
                                                                     const double* z, double slack,
                                                                     double* squared) {
    const Lanes p[3] = {*reinterpret_cast<const Lanes*>(x), *reinterpret_cast<const Lanes*>(y),
                        *reinterpret_cast<const Lanes*>(z)};
    const Lanes zero = {};
    Lanes& least = *reinterpret_cast<Lanes*>(squared);
    Lanes ap[3];
    for (int i = 0; i < 3; ++i) ap[i] = p[i] - t.a[i];
    const Lanes above = TENON_LANES_DOT(t.normal, ap);
    const Lanes to_plane = above * above / t.squared_normal;
    const Mask skipped = to_plane >= least * PreparedTriangle::kPlaneMargin + slack;
    if (t.has_plane && TENON_LANES_ANY(~skipped) == 0) return;

    Lanes bp[3], cp[3];
    for (int i = 0; i < 3; ++i) {
      bp[i] = p[i] - t.b[i];
      cp[i] = p[i] - t.c[i];
    }
    const Lanes d1 = TENON_LANES_DOT(t.ab, ap);
    const Lanes d2 = TENON_LANES_DOT(t.ac, ap);
    const Lanes d3 = TENON_LANES_DOT(t.ab, bp);
    const Lanes d4 = TENON_LANES_DOT(t.ac, bp);
    const Lanes d5 = TENON_LANES_DOT(t.ab, cp);
    const Lanes d6 = TENON_LANES_DOT(t.ac, cp);
    // the first of these regions that a point is in has its nearest point; else the face
    const Mask at_a = (d1 <= 0.0) & (d2 <= 0.0);
    const Mask at_b = (d3 >= 0.0) & (d4 <= d3);
    const Mask on_ab = (d1 * d4 - d3 * d2 <= 0.0) & (d1 >= 0.0) & (d3 <= 0.0);
    const Mask at_c = (d6 >= 0.0) & (d5 <= d6);
    const Mask on_ac = (d5 * d2 - d1 * d6 <= 0.0) & (d2 >= 0.0) & (d6 <= 0.0);
    const Mask on_bc = (d3 * d6 - d5 * d4 <= 0.0) & (d4 >= d3) & (d5 >= d6);
    const Mask at_corner = at_a | at_b | (~on_ab & at_c);
    const Mask from_c = ~at_a & ~at_b & ~on_ab & at_c;
    const Mask from_b = ~at_a & (at_b | (~on_ab & ~at_c & ~on_ac));
    // along the edge, from its first corner
    Lanes part = on_ac ? d2 : d4 - d3;
    Lanes whole = on_ac ? d2 - d6 : (d4 - d3) + (d5 - d6);
    part = on_ab ? d1 : part;
    whole = on_ab ? d1 - d3 : whole;
    Lanes along = whole > zero ? part / whole : zero;
    along = at_corner ? zero : along;
    Lanes to[3];
    for (int i = 0; i < 3; ++i) {
      Lanes edge = on_ac ? t.ac[i] + zero : t.bc[i] + zero;
      edge = on_ab ? t.ab[i] + zero : edge;
      Lanes from = from_b ? bp[i] : ap[i];
      from = from_c ? cp[i] : from;
      to[i] = from - along * edge;
    }
    const Mask on_border = at_a | at_b | on_ab | at_c | on_ac | on_bc;
    const Lanes candidate = on_border ? TENON_LANES_DOT(to, to) : to_plane;
    least = candidate < least ? candidate : least;
  }

  /// The same of `count` points. [m^2] The largest squared distance.
  __attribute__((target(TENON_LANES_TARGET))) static double lowerAll(const PreparedTriangle& t,
                                                                     const double* x, const double* y,
                                                                     const double* z, std::size_t count,
                                                                     double slack, double* squared) {
    Lanes largest = {};
    for (std::size_t i = 0; i < count; i += kCount) {
      lowerLanes(t, x + i, y + i, z + i, slack, squared + i);
      const Lanes& now = *reinterpret_cast<const Lanes*>(squared + i);
      largest = now > largest ? now : largest;
    }
    double most = 0.0;
    for (std::size_t lane = 0; lane < kCount; ++lane) most = largest[lane] > most ? largest[lane] : most;
    return most;
  }
};

}  // namespace tenon::bake

#undef TENON_LANES_DOT
