#include "server/bake/thin_places.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>
#include <optional>

#include "server/bake/parallel.h"
#include "server/bake/triangle_pieces.h"

namespace tenon::bake {

namespace {

using Field = structures::DistanceField;
/// [m] The exact surface is so far inside, or a tenth of a voxel where that is less.
constexpr double kCover = 5e-5;
/// [m] A point of the exact surface that is further outside is open.
constexpr double kOpen = 5e-5;
/// [voxels] Measured distances up to this, or up to kNoise [m], are noise of curved and quantised surfaces.
constexpr double kNoiseVoxels = 0.02;
constexpr double kNoise = 4e-5;
/// [-] Points in refined bricks are farther apart by this, in voxels there: a brick's share of a wall then
/// still has hundreds of them, in all places of a voxel.
constexpr double kSparseWhereRefined = 4.0;
/// [voxels] Thin walls are seen from so far on both sides: their distance is exact there.
constexpr double kBeyond = 2.5;
/// [voxels] A point with such a distance is inside of a solid: in a wall of 2.5 voxels, each cell that
/// contains the middle has a sample 0.75 deep, less the rounding of samples.
constexpr double kInside = -0.749;
/// [voxels] The middle of such a wall is at least so deep where it is interpolated, at its corners too.
constexpr double kMiddle = -0.5;
/// [-] Largest gradient of the dilation.
constexpr double kSlope = 0.2;

double noise(double voxel) { return std::min(kNoiseVoxels * voxel, kNoise); }

/// The interpolated distances kBeyond away from a point of the surface, on both sides.
struct Beyond {
  std::array<double, 2> distance;  // [m]
  double cosine;                   // [-] of the gradients there
};

/// [m] Half the thickness of a thin wall at a point of its surface, where the interpolated distance is
/// `outside` [m]. Beyond a wall of thickness t, s from the point, the distance is s - t. Another surface
/// behind it makes that less; but where samples see a wall of half-thickness h worst, they show
/// (voxel - h)^2 / (2 voxel) at its surface, so that a larger `outside` bounds h.
double halfThickness(const Beyond& beyond, double outside, double voxel) {
  const double most = voxel - std::sqrt(2.0 * std::max(outside, 0.0) * voxel);
  return std::clamp(0.5 * std::abs(beyond.distance[1] - beyond.distance[0]), 0.0, std::max(most, 0.0));
}

/// [m] The dilation for a thin wall at whose exact surface the interpolated distance is `outside` [m]. Its
/// level set is flat where cells of it do not contain the middle of the wall, from half a cell's diagonal of
/// the middle on. A smaller offset would cover it, and leave a surface with steps of up to 0.4 voxels.
double dilationFor(double outside, double half_thickness, double voxel) {
  const double covered = outside > 0.0 ? outside + std::min(kCover, 0.1 * voxel) : 0.0;
  return std::max(covered, Field::kHalfDiagonal * voxel - half_thickness);
}

/// The gradient of a field about p, by differences over a voxel to each side.
Vector3 wideGradient(const Field& field, const Vector3& p_MP, double voxel) {
  Vector3 gradient;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 step = voxel * Vector3::Unit(axis);
    gradient[axis] =
        (field.sample(p_MP + step).distance - field.sample(p_MP - step).distance) / (2.0 * voxel);
  }
  return gradient;
}

/// The distances beyond a wall at p, a point of its surface with `normal_M` of either sign. None where an
/// inside of 0.75 voxels is straight behind p.
std::optional<Beyond> beyondWall(const Field& field, const Vector3& p_MP, const Vector3& normal_M,
                                 double voxel) {
  for (const double side : {-voxel, voxel})
    if (field.sample(p_MP + side * normal_M).distance <= kInside * voxel) return std::nullopt;
  const Vector3 away = kBeyond * voxel * normal_M;
  const structures::FieldSample before = field.sample(p_MP - away);
  const structures::FieldSample behind = field.sample(p_MP + away);
  return Beyond{{before.distance, behind.distance}, before.gradient.dot(behind.gradient)};
}

/// [m] The lowest distance in the cell around p: that of one of its corners.
double lowestInCell(const Field& field, const Vector3& p_MP, double voxel) {
  const Vector3& p_MoFo_M = field.layout().p_MoFo_M;
  const Vector3 low = ((p_MP - p_MoFo_M) / voxel).array().floor();
  double lowest = 0.0;
  for (int k = 0; k < 8; ++k) {
    const Vector3 corner = low + Vector3(k & 1, k >> 1 & 1, k >> 2 & 1);
    lowest = std::min(lowest, field.sample(p_MoFo_M + voxel * corner).distance);
  }
  return lowest;
}

/// Whether the wall of beyondWall() is thin: it is where air is straight behind it and its faces are
/// parallel, and where no inside of 0.75 voxels is where the gradient leads inwards, or in the cell around
/// the deepest place there.
bool isThinWall(const Field& field, Vector3 p_MP, const Beyond& beyond, double voxel) {
  constexpr double kAir = 0.9;  // [voxels] 2.5 voxels from the surface: behind a wall of 1.6 voxels at most
  constexpr double kStep = 0.25;
  constexpr int kSteps = 9;
  constexpr double kNoGradient = 0.1;  // [-] as in the middle of a thin wall
  constexpr double kBack = -0.5;       // [-] cosine of consecutive steps
  constexpr double kParallel = -0.9;   // [-] cosine of the normals of a wall's two faces
  if (std::min(beyond.distance[0], beyond.distance[1]) >= kAir * voxel && beyond.cosine < kParallel)
    return true;
  Vector3 before = Vector3::Zero();
  double lowest = 0.0;
  Vector3 p_MDeepest = p_MP;
  for (int i = 0; i <= kSteps; ++i) {
    const structures::FieldSample here = field.sample(p_MP);
    if (here.distance <= kInside * voxel) return false;
    if (here.distance < lowest) {
      lowest = here.distance;
      p_MDeepest = p_MP;
    }
    // at an edge, a cell's own gradient may be along a face
    Vector3 inwards = -wideGradient(field, p_MP, voxel);
    if (inwards.norm() < kNoGradient) inwards = -here.gradient;
    // where it leads back, the middle of the wall has been passed
    if (inwards.norm() < kNoGradient || inwards.normalized().dot(before) < kBack) break;
    before = inwards.normalized();
    p_MP += kStep * voxel * before;
  }
  return lowest > kMiddle * voxel || lowestInCell(field, p_MDeepest, voxel) > kInside * voxel;
}

class ThinPlaceFinder {
 public:
  ThinPlaceFinder(const Field& field, std::span<const structures::Triangle> surface, const BrickMarks& thin,
                  ParallelWork& work)
      : field_(field),
        surface_(surface),
        thin_(thin),
        work_(work),
        bricks_(field.layout().bricks),
        needed_(std::make_unique<std::atomic<float>[]>(field.layout().far.size())) {}

  /// The dilation that each brick needs.
  void measure() {
    const std::vector<double> areas =
        forEachThinPoint(2.0, [this](const Vector3& p, const Vector3& normal_M, double voxel) {
          const auto beyond = beyondWall(field_, p, normal_M, voxel);
          if (!beyond) return false;
          const double outside = field_.sample(p).distance;
          const double dilation = dilationFor(outside, halfThickness(*beyond, outside, voxel), voxel);
          if (dilation <= noise(voxel) || !isThinWall(field_, p, *beyond, voxel)) return false;
          raise(needed_[brickAt(p)], static_cast<float>(dilation));
          return true;
        });
    for (const double area : areas) area_ += area;
  }

  /// Measured at other points than those that the dilations follow from.
  ThinPlaces result() {
    ThinPlaces places;
    places.area = area_;
    places.dilations = cornerDilations();
    limitSlope(places.dilations);
    const bool none =
        std::all_of(places.dilations.begin(), places.dilations.end(), [](float d) { return d == 0.0F; });
    if (none) return places;
    Field::Layout layout = field_.layout();
    layout.dilations = places.dilations;
    const Field offsets(layout, nullptr);
    for (const double area :
         forEachThinPoint(2.5, [&](const Vector3&p, const Vector3&normal_M, double voxel) {
           if (field_.sample(p).distance - offsets.dilationAt(p) <= kOpen) return false;
           const auto beyond = beyondWall(field_, p, normal_M, voxel);
           return beyond && isThinWall(field_, p, *beyond, voxel);
         }))
      places.open_area += area;
    return places;
  }

 private:
  static constexpr std::size_t kChunk = 64;

  /// Calls visit(point, normal of either sign, voxel) at points of the surface in thin bricks; returns by
  /// chunk the area [m^2] of those for which it is true.
  template <typename Visit>
  std::vector<double> forEachThinPoint(double fraction, Visit&& visit) {
    std::vector<double> areas((surface_.size() + kChunk - 1) / kChunk, 0.0);
    work_.run(areas.size(), 1, [&](std::size_t chunk) {
      const std::size_t end = std::min(surface_.size(), (chunk + 1) * kChunk);
      for (std::size_t i = chunk * kChunk; i < end; ++i) {
        const structures::Triangle& t = surface_[i];
        const Vector3 normal_M = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
        if (!normal_M.allFinite() || !thin_.anyIn(structures::boxOf(t))) continue;
        const auto fits = [&](const Vector3& centre, double length) {
          if (length > fraction * field_.voxel()) return false;
          return !thin_.at(centre) || field_.layout().refinement == 1 ||
                 length <= kSparseWhereRefined * fraction * field_.voxelAt(centre);
        };
        forEachPiece(t, fits, [&](const Vector3& p, double area) {
          if (!thin_.at(p)) return;
          if (visit(p, normal_M, field_.voxelAt(p))) areas[chunk] += area;
        });
      }
    });
    return areas;
  }

  [[nodiscard]] std::size_t brickAt(const Vector3& p_MP) const {
    const Vector3 p = (p_MP - field_.layout().p_MoFo_M) / (field_.voxel() * Field::kBrickVoxels);
    const auto cell = p.cast<std::int64_t>();
    return static_cast<std::size_t>((cell.z() * bricks_[1] + cell.y()) * bricks_[0] + cell.x());
  }

  static void raise(std::atomic<float>& value, float to) {
    float now = value.load(std::memory_order_relaxed);
    while (now < to && !value.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
    }
  }

  [[nodiscard]] std::size_t cornerIndex(int x, int y, int z) const {
    const auto row = static_cast<std::size_t>(bricks_[0]) + 1;
    const auto rows = static_cast<std::size_t>(bricks_[1]) + 1;
    return (static_cast<std::size_t>(z) * rows + static_cast<std::size_t>(y)) * row +
           static_cast<std::size_t>(x);
  }

  /// [m] At each corner the largest dilation that one of its bricks needs.
  [[nodiscard]] std::vector<float> cornerDilations() const {
    std::vector<float> corners(cornerIndex(0, 0, bricks_[2] + 1), 0.0F);
    std::size_t number = 0;
    for (int z = 0; z < bricks_[2]; ++z) {
      for (int y = 0; y < bricks_[1]; ++y) {
        for (int x = 0; x < bricks_[0]; ++x, ++number) {
          const float needed = needed_[number].load(std::memory_order_relaxed);
          for (int k = 0; needed > 0.0F && k < 8; ++k) {
            float& corner = corners[cornerIndex(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2 & 1))];
            corner = std::max(corner, needed);
          }
        }
      }
    }
    return corners;
  }

  /// Raises corners until neighbours along an axis differ by no more than a gradient of kSlope allows.
  void limitSlope(std::vector<float>& corners) const {
    const auto step = static_cast<float>(kSlope / std::sqrt(3.0) * Field::kBrickVoxels * field_.voxel());
    for (bool raised = true; raised;) {
      raised = false;
      for (int z = 0; z <= bricks_[2]; ++z) {
        for (int y = 0; y <= bricks_[1]; ++y) {
          for (int x = 0; x <= bricks_[0]; ++x) {
            const float least = corners[cornerIndex(x, y, z)] - step;
            if (least <= 0.0F) continue;
            for (const auto& [dx, dy, dz] :
                 {std::array{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}) {
              const std::array<int, 3> at{x + dx, y + dy, z + dz};
              if (at[0] < 0 || at[1] < 0 || at[2] < 0 || at[0] > bricks_[0] || at[1] > bricks_[1] ||
                  at[2] > bricks_[2])
                continue;
              float& next = corners[cornerIndex(at[0], at[1], at[2])];
              raised = raised || next < least;
              next = std::max(next, least);
            }
          }
        }
      }
    }
  }

  const Field& field_;
  const std::span<const structures::Triangle> surface_;
  const BrickMarks& thin_;
  ParallelWork& work_;
  const std::array<std::int32_t, 3> bricks_;
  const std::unique_ptr<std::atomic<float>[]> needed_;  // [m] by coarse brick
  double area_ = 0.0;                                   // [m^2]
};

}  // namespace

ThinPlaces findThinPlaces(const structures::DistanceField& field,
                          std::span<const structures::Triangle> surface, const BrickMarks& thin,
                          ParallelWork& work) {
  ThinPlaceFinder finder(field, surface, thin, work);
  finder.measure();
  return finder.result();
}

}  // namespace tenon::bake
