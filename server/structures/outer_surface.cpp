#include "server/structures/outer_surface.h"

#include <algorithm>
#include <array>

#include "server/structures/triangle.h"

namespace tenon {

namespace {

/// [voxels] An empty ball that comes as near as this to a place exposes it.
constexpr double kTouch = 0.25;
/// [voxels] Heights over a place at which such balls are looked for.
constexpr std::array kHeights{0.5, 0.25, 1.0, 2.0};
/// [voxels] No piece is longer: a tree of boxes does not like long triangles.
constexpr double kPiece = 6.0;
/// [voxels] Shorter ones are not cut.
constexpr double kCrumb = 0.3;

class Cutter {
 public:
  Cutter(const DistanceField& field, std::vector<SurfaceTree::Triangle>& outer)
      : field_(field), outer_(outer) {}

  void cut(const Triangle& t) {
    const Halves halves(t);
    if (halves.length > kPiece * field_.voxelAt(centreOf(t))) {
      cut(halves.first);
      cut(halves.second);
    } else if (exposedPart(t, halves) == Part::kAll) {
      keep(t);
    }
  }

 private:
  enum class Part { kAll, kNone, kSome };

  /// Both sides of the longest edge's middle.
  struct Halves {
    explicit Halves(const Triangle& t) : first(t), second(t) {
      std::size_t a = 0;
      length = longestEdge(t, a);
      const std::size_t b = (a + 1) % 3;
      first[b] = second[a] = 0.5 * (t[a] + t[b]);
    }
    Triangle first, second;
    double length = 0.0;
  };

  static Vector3 centreOf(const Triangle& t) { return (t[0] + t[1] + t[2]) / 3.0; }

  /// Of a triangle that is exposed in some places these are kept already.
  Part exposedPart(const Triangle& t, const Halves& halves) {
    const Vector3 centre = centreOf(t);
    const double voxel = field_.voxelAt(centre);
    const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
    const bool at_centre = isExposed(centre, normal, voxel);
    bool all_agree = true;
    for (std::size_t i = 0; i < 3 && all_agree && halves.length > kCrumb * voxel; ++i) {
      // a little within, so that neighbours behind an edge do not count
      const Vector3 corner = centre + 0.95 * (t[i] - centre);
      const Vector3 next = centre + 0.95 * (t[(i + 1) % 3] - centre);
      all_agree = isExposed(corner, normal, voxel) == at_centre &&
                  isExposed(0.5 * (corner + next), normal, voxel) == at_centre;
    }
    if (all_agree) return at_centre ? Part::kAll : Part::kNone;

    const Part of_first = exposedPart(halves.first, Halves(halves.first));
    const Part of_second = exposedPart(halves.second, Halves(halves.second));
    if (of_first == of_second && of_first != Part::kSome) return of_first;
    if (of_first == Part::kAll) keep(halves.first);
    if (of_second == Part::kAll) keep(halves.second);
    return Part::kSome;
  }

  /// Whether an empty ball over the place, on either side, comes near to it.
  [[nodiscard]] bool isExposed(const Vector3& p, const Vector3& normal, double voxel) const {
    const double here = field_.sample(p).distance;
    if (here < -(kTouch + DistanceField::kHalfDiagonal) * voxel) return false;
    for (const double height : kHeights) {
      for (const double side : {height, -height}) {
        const double radius = field_.sample(p + side * voxel * normal).distance;
        if (radius > 0.0 && radius >= (height - kTouch) * voxel) return true;
      }
    }
    return false;
  }

  void keep(const Triangle& t) {
    outer_.push_back({t[0].cast<float>(), t[1].cast<float>(), t[2].cast<float>()});
  }

  const DistanceField& field_;
  std::vector<SurfaceTree::Triangle>& outer_;
};

}  // namespace

std::vector<SurfaceTree::Triangle> outerTriangles(std::span<const SurfaceTree::Triangle> triangles,
                                                  const DistanceField& field) {
  std::vector<SurfaceTree::Triangle> outer;
  Cutter cutter(field, outer);
  for (const SurfaceTree::Triangle& t : triangles) {
    cutter.cut({t[0].cast<double>(), t[1].cast<double>(), t[2].cast<double>()});
  }
  return outer;
}

}  // namespace tenon
