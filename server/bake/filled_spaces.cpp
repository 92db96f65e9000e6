#include "server/bake/filled_spaces.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "server/bake/brick_level.h"
#include "server/bake/parallel.h"
#include "server/bake/triangle_pieces.h"
#include "server/bake/triangle_tree.h"

namespace tenon::bake {

namespace {

using Place = std::array<int, 3>;  // a cube of kWallPiece voxels

constexpr double kWallPiece =
    2.0;                           // [voxels] longest edge of a piece of a wall, which is asked at its centre
constexpr double kInFront = 0.01;  // [voxels]
constexpr double kLeastWallArea = 4.0;  // [voxels^2] of a space
constexpr double kLeastInCube = 1.0;    // [voxels^2] on average

/// The walls of filled spaces in one cube.
struct WallsThere {
  Eigen::AlignedBox3f box_M;  // [m]
  double area = 0.0;          // [m^2]
  int cubes = 1;
  void add(const WallsThere& other) {
    box_M.extend(other.box_M);
    area += other.area;
    cubes += other.cubes;
  }
};

/// A soup of triangles that have an outer side.
struct WoundSoup {
  const TriangleTree& tree;
  std::span<const std::int8_t> winding;
  Eigen::AlignedBox3d box_M;  // [m] around all of it

  /// The unit normal of a triangle, or of a part of one, outwards; none: it has no side.
  [[nodiscard]] Vector3 outwards(const structures::Triangle& t, std::uint32_t triangle) const {
    const int sign = (winding[triangle] > 0) - (winding[triangle] < 0);
    return sign * (t[1] - t[0]).cross(t[2] - t[0]).normalized();
  }

  /// How many solids are around p, as a ray finds it.
  [[nodiscard]] int solidsAround(const Vector3& p, const Vector3& direction) const {
    int solids = 0;
    for (const std::uint32_t i : tree.crossed(p, direction))
      solids += tree.normalOf(i).dot(direction) > 0.0 ? winding[i] : -winding[i];
    return solids;
  }

  /// Whether p is in no solid: the rays that leave `box_M` first are asked first, as most points are in one.
  [[nodiscard]] bool isEmptyAt(const Vector3& p) const {
    // none is along an axis, so that few rays meet an edge of a manufactured part
    static const std::array<Vector3, 4> kDirections{Vector3(0.43, 0.74, 0.52), Vector3(-0.53, 0.19, 0.82),
                                                    Vector3(0.26, -0.93, -0.27),
                                                    Vector3(-0.71, -0.12, -0.69)};
    std::array<std::pair<double, std::size_t>, kDirections.size()> rays;  // [m] in the box, its number
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Vector3& direction = kDirections[i];
      const Vector3 end = (direction.array() > 0.0).select(box_M.max(), box_M.min());
      rays[i] = {(end - p).cwiseQuotient(direction).minCoeff() * direction.norm(), i};
    }
    std::sort(rays.begin(), rays.end());
    return std::all_of(rays.begin(), rays.end(),
                       [&](const auto& ray) { return solidsAround(p, kDirections[ray.second]) == 0; });
  }
};

/// The walls of a space that begins at `from`, which are taken out of `walls`.
WallsThere takeSpace(std::map<Place, WallsThere>& walls, Place from) {
  WallsThere all{.cubes = 0};
  std::vector<Place> next{from};
  while (!next.empty()) {
    const Place at = next.back();
    next.pop_back();
    const auto found = walls.find(at);
    if (found == walls.end()) continue;
    all.add(found->second);
    walls.erase(found);
    for (int k = 0; k < 27; ++k)
      next.push_back({at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1});
  }
  return all;
}

}  // namespace

std::vector<structures::FilledSpace> findFilledSpaces(std::span<const ExposedSurface::HiddenPart> hidden,
                                                      const TriangleTree& tree,
                                                      std::span<const std::int8_t> winding,
                                                      const BrickLevel& coarse, ParallelWork& work) {
  constexpr std::size_t kTriangles = 256;
  const double voxel = coarse.voxel;
  const Eigen::AlignedBox3d box_M(coarse.p_MoFo_M, coarse.position(coarse.bricks * BrickLevel::kVoxels));
  const WoundSoup soup{tree, winding, box_M};
  std::vector<std::map<Place, WallsThere>> found((hidden.size() + kTriangles - 1) / kTriangles);
  work.run(found.size(), 1, [&](std::size_t chunk) {
    const std::size_t end = std::min(hidden.size(), (chunk + 1) * kTriangles);
    for (std::size_t i = chunk * kTriangles; i < end; ++i) {
      const auto& [t, triangle] = hidden[i];
      const Vector3 outwards = soup.outwards(t, triangle);
      if (!(outwards.norm() > 0.5)) continue;
      const auto fits = [&](const Vector3&, double length) { return length <= kWallPiece * voxel; };
      forEachPiece(t, fits, [&](const Vector3& p, double area) {
        if (!soup.isEmptyAt(p + kInFront * voxel * outwards)) return;
        const Eigen::Vector3i cube =
            ((p - coarse.p_MoFo_M) / (kWallPiece * voxel)).array().floor().matrix().cast<int>();
        WallsThere& walls = found[chunk][{cube.x(), cube.y(), cube.z()}];
        walls.box_M.extend(Vector3f(p.cast<float>()));
        walls.area += area;
      });
    }
  });
  std::map<Place, WallsThere> walls;
  for (const auto& chunk : found)
    for (const auto& [place, there] : chunk)
      if (const auto [known, is_new] = walls.try_emplace(place, there); !is_new) {
        known->second.box_M.extend(there.box_M);
        known->second.area += there.area;
      }
  std::vector<structures::FilledSpace> spaces;
  while (!walls.empty()) {
    const WallsThere all = takeSpace(walls, walls.begin()->first);
    // of an inner corner a strip is not exposed
    if (all.area < std::max(kLeastWallArea, kLeastInCube * all.cubes) * voxel * voxel) continue;
    structures::FilledSpace& space = spaces.emplace_back();
    Vector3f::Map(space.low.data()) = all.box_M.min();
    Vector3f::Map(space.high.data()) = all.box_M.max();
    space.wall_area = static_cast<float>(all.area);
  }
  std::stable_sort(spaces.begin(), spaces.end(),
                   [](const auto& a, const auto& b) { return a.wall_area > b.wall_area; });
  return spaces;
}

}  // namespace tenon::bake
