#include "server/structures/outer_surface.h"

#include <algorithm>
#include <array>

#include "server/structures/triangle.h"

namespace tenon::structures {

namespace {

/// [voxels] A point is exposed when an empty ball comes as near as this to it.
constexpr double kTouch = 0.25;
/// [voxels] Heights of the centres of such balls over the point.
constexpr std::array kHeights{0.5, 0.25, 1.0, 2.0};
/// [voxels] Longest edge of a piece: boxes of long triangles overlap too much in a bounding-box hierarchy.
constexpr double kMaxEdge = 6.0;
/// [voxels] Triangles with a shorter longest edge are not split.
constexpr double kMinEdge = 0.3;

class OuterSurfaceSplitter {
 public:
  OuterSurfaceSplitter(const DistanceField& field, std::vector<SurfaceTree::Triangle>& outer)
      : field_(field), outer_(outer) {}

  void split(const Triangle& t) {
    std::size_t from = 0;
    if (longestEdge(t, from) > kMaxEdge * field_.voxelAt(centreOf(t))) {
      for (const Triangle& half : bisected(t, from)) split(half);
    } else if (exposedPart(t) == Exposed::kAll) {
      keep(t);
    }
  }

 private:
  enum class Exposed { kAll, kNone, kSome };

  static Vector3 centreOf(const Triangle& t) { return (t[0] + t[1] + t[2]) / 3.0; }

  /// How much of a triangle is exposed. With kSome the exposed pieces have been added to `outer_`.
  Exposed exposedPart(const Triangle& t) {
    std::size_t from = 0;
    const double length = longestEdge(t, from);
    const Vector3 centre = centreOf(t);
    const double voxel = field_.voxelAt(centre);
    const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
    const bool at_centre = isExposed(centre, normal, voxel);
    bool all_agree = true;
    for (std::size_t i = 0; i < 3 && all_agree && length > kMinEdge * voxel; ++i) {
      // 5 % inside the corners, so that triangles beyond an edge have no influence
      const Vector3 corner = centre + 0.95 * (t[i] - centre);
      const Vector3 next = centre + 0.95 * (t[(i + 1) % 3] - centre);
      all_agree = isExposed(corner, normal, voxel) == at_centre &&
                  isExposed(0.5 * (corner + next), normal, voxel) == at_centre;
    }
    if (all_agree) return at_centre ? Exposed::kAll : Exposed::kNone;

    const auto [first, second] = bisected(t, from);
    const Exposed of_first = exposedPart(first);
    const Exposed of_second = exposedPart(second);
    if (of_first == of_second && of_first != Exposed::kSome) return of_first;
    if (of_first == Exposed::kAll) keep(first);
    if (of_second == Exposed::kAll) keep(second);
    return Exposed::kSome;
  }

  /// Whether an empty ball above the point, on either side, reaches within kTouch of it.
  [[nodiscard]] bool isExposed(const Vector3& p, const Vector3& normal, double voxel) const {
    const double here = field_.undilated(p).distance;
    if (here < -(kTouch + DistanceField::kHalfDiagonal) * voxel) return false;
    for (const double height : kHeights) {
      for (const double side : {height, -height}) {
        const double radius = field_.undilated(p + side * voxel * normal).distance;
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
  OuterSurfaceSplitter splitter(field, outer);
  for (const SurfaceTree::Triangle& t : triangles) {
    splitter.split({t[0].cast<double>(), t[1].cast<double>(), t[2].cast<double>()});
  }
  return outer;
}

}  // namespace tenon::structures
