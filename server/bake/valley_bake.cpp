#include "server/bake/valley_bake.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <utility>

#include "server/bake/parallel.h"
#include "server/bake/triangle_tree.h"

namespace tenon::bake {

namespace {

using structures::BrickValleys;
using structures::DistanceField;
using structures::ValleyPlane;
using Entry = DistanceField::Entry;
using PlanesOfCell = FixedVector<ValleyPlane, DistanceField::kMaxValleyPlanes>;

constexpr int kValleySide = DistanceField::kBrickSide;
constexpr int kValleyVoxels = DistanceField::kBrickVoxels;
constexpr int kValleyQuanta = DistanceField::kQuantaPerVoxel;

/// [quanta] Second difference of samples along an axis from which on the surface may have a concave edge.
constexpr int kConcave = kValleyQuanta / 64;

/// [quanta] Cells whose samples all are farther than this from the surface have no contacts.
constexpr int kNearQuanta = kValleyQuanta / 2;

/// [voxels] The planes are the surface, and the field, to this.
constexpr double kPlaneFit = 0.01;

/// [voxels] Samples nearer to the surface may have the wrong sign in a corner, see findOutside().
constexpr double kTrusted = 0.4;

/// [voxels] Samples behind a concave edge may be too deep by this: pieces of the surface there count as
/// hidden.
constexpr double kTooDeep = 0.15;

/// [voxels] Triangles are in a plane to this.
constexpr double kInPlane = 0.004;

/// [voxels] Smaller errors of the interpolation are left.
constexpr double kLeastError = 0.004;

/// [voxels] So far behind the planes the interpolation counts: the surface may pass between the points.
constexpr double kBehind = 0.3;

/// [-] Normals with a cosine nearer to 1 than this are of one plane.
constexpr double kOnePlane = 1e-6;

/// Triangles and planes near a cell; with more, a surface is round.
constexpr std::size_t kCellTriangles = 48;
constexpr std::size_t kCellPlanes = 8;

/// A brick of samples.
struct SampledBrick {
  Entry entry = 0;
  Vector3 p_FoBo_M;    ///< [m] its corner, from that of the grid
  double voxel = 0.0;  ///< [m]
};

/// A plane in a cell, in voxels from the middle of the cell.
struct CellPlane {
  Vector3 n = Vector3::Zero();
  double offset = 0.0;  ///< [voxels]
  [[nodiscard]] double at(const Vector3& p) const { return n.dot(p) + offset; }
};
using CellPlanes = FixedVector<CellPlane, kCellPlanes>;

/// [voxels] Signed distance of a point to the outside of all planes. Behind three and more of them, where the
/// nearest point may be the corner, a lower bound of the depth.
double distanceToPlanes(const CellPlanes& planes, const Vector3& p) {
  std::array<double, kCellPlanes> at{};
  double lowest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < planes.size(); ++i) lowest = std::min(lowest, at[i] = planes[i].at(p));
  if (lowest >= 0.0 || planes.size() != 2) return lowest;
  const double cosine = planes[0].n.dot(planes[1].n);
  const double sine2 = 1.0 - cosine * cosine;
  // the nearest point is in one of both planes, unless that is inside of the other one
  if (at[0] - cosine * at[1] >= 0.0 || at[1] - cosine * at[0] >= 0.0 || sine2 < kOnePlane) return lowest;
  return -std::sqrt((at[0] * at[0] + at[1] * at[1] - 2.0 * cosine * at[0] * at[1]) / sine2);
}

/// Whether a signed distance is that of the planes, `there` [voxels].
bool isDistanceToPlanes(const CellPlanes& planes, double distance, double there) {
  if (planes.size() > 2 && there < 0.0) return distance <= there + kPlaneFit;
  return std::abs(there - distance) <= kPlaneFit;
}

/// 3^3 points of a cell, in voxels from its middle; x fastest.
constexpr std::size_t kCellPoints = 27;
Vector3 pointInCell(std::size_t k) {
  return 0.5 * Vector3(static_cast<double>(k % 3) - 1.0, static_cast<double>(k / 3 % 3) - 1.0,
                       static_cast<double>(k / 9) - 1.0);
}

/// A cell of the field, and what the mesh says of it.
class CellSurface {
 public:
  /// `samples` [voxels] at the corners, x fastest; `middle` [m], `voxel` [m].
  CellSurface(const TriangleTree& surface, const std::array<double, 8>& samples, const Vector3& middle,
              double voxel)
      : samples_(samples) {
    double farthest = 0.0;
    for (const double sample : samples) farthest = std::max(farthest, std::abs(sample));
    // a point of the cell is at most 0.5 from the middle of a face and 0.71 from a corner
    const double reach = farthest + 1.25;
    is_simple_ = !surface.visitWithin(middle, reach * voxel, [&](const structures::Triangle& triangle) {
      structures::Triangle t = triangle;
      for (Vector3& corner : t) corner = (corner - middle) / voxel;
      return !add(t);
    });
    is_simple_ = is_simple_ && triangles_.size() > 0;
  }

  /// The planes that are the field in the cell; empty where none are.
  [[nodiscard]] CellPlanes planes() const {
    CellPlanes found;
    if (!is_simple_) return found;
    std::array<double, kCellPoints> distances;
    if (!measure(distances, found) || !orient(distances, found) || !isWorth(found)) found.clear();
    return found;
  }

 private:
  /// False when there are too many.
  bool add(const structures::Triangle& t) {
    const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
    if (normal.isZero(0.0)) return true;
    // long triangles are visited more than once
    if (std::find(triangles_.begin(), triangles_.end(), t) != triangles_.end()) return true;
    std::size_t plane = 0;
    const auto isIn = [&](const CellPlane& one) {
      return std::abs(one.n.dot(normal)) > 1.0 - kOnePlane &&
             std::all_of(t.begin(), t.end(),
                         [&](const Vector3& p) { return std::abs(one.at(p)) <= kInPlane; });
    };
    while (plane < planes_.size() && !isIn(planes_[plane])) ++plane;
    if (plane == planes_.size() && !planes_.push_back({normal, -normal.dot(t[0])})) return false;
    plane_of_.push_back(plane);
    return triangles_.push_back(t);
  }

  /// Measures the distances [voxels] of the mesh at the cell's points, and finds the planes that are nearest
  /// to one of them. False when they are too many.
  bool measure(std::array<double, kCellPoints>& distances, CellPlanes& found) const {
    std::array<bool, kCellPlanes> is_nearest{};
    for (std::size_t k = 0; k < kCellPoints; ++k) {
      const Vector3 p = pointInCell(k);
      double squared = std::numeric_limits<double>::infinity();
      std::size_t nearest = 0;
      for (std::size_t i = 0; i < triangles_.size(); ++i) {
        const double here = structures::squaredDistance(p, triangles_[i]);
        if (here >= squared) continue;
        squared = here;
        nearest = plane_of_[i];
      }
      distances[k] = std::sqrt(squared);
      // at a concave edge itself it is neither plane
      if (std::abs(std::abs(planes_[nearest].at(p)) - distances[k]) <= kPlaneFit) is_nearest[nearest] = true;
    }
    for (std::size_t i = 0; i < planes_.size(); ++i)
      if (is_nearest[i]) found.push_back(planes_[i]);
    return found.size() > 0 && found.size() <= DistanceField::kMaxValleyPlanes;
  }

  /// Turns normals into free space. False when the planes are not the field.
  [[nodiscard]] bool orient(const std::array<double, kCellPoints>& distances, CellPlanes& planes) const {
    const CellPlanes given = planes;
    for (std::uint32_t turned = 0; turned < 1U << given.size(); ++turned) {
      for (std::size_t i = 0; i < given.size(); ++i) {
        const double sign = (turned >> i & 1U) != 0 ? -1.0 : 1.0;
        planes[i] = {sign * given[i].n, sign * given[i].offset};
      }
      if (fits(distances, planes)) return true;
    }
    return false;
  }

  [[nodiscard]] bool fits(const std::array<double, kCellPoints>& distances, const CellPlanes& planes) const {
    bool is_trusted = false;
    for (unsigned k = 0; k < 8; ++k) {
      const double there =
          distanceToPlanes(planes, pointInCell((k & 1U) * 2 + (k >> 1U & 1U) * 6 + (k >> 2U) * 18));
      if (std::abs(there) < kTrusted) continue;
      if (isDistanceToPlanes(planes, samples_[k], there)) {
        is_trusted = true;
      } else if (there > 0.0 || samples_[k] > there || samples_[k] < there - kTooDeep) {
        return false;
      }
    }
    if (!is_trusted) return false;
    for (std::size_t k = 0; k < kCellPoints; ++k) {
      const double there = distanceToPlanes(planes, pointInCell(k));
      if (!isDistanceToPlanes(planes, std::copysign(distances[k], there), there)) return false;
    }
    return true;
  }

  /// Whether interpolation is worse.
  [[nodiscard]] bool isWorth(const CellPlanes& planes) const {
    for (std::size_t k = 0; k < kCellPoints; ++k) {
      const Vector3 t = pointInCell(k) + Vector3::Constant(0.5);
      double interpolated = 0.0;
      for (unsigned corner = 0; corner < 8; ++corner) {
        interpolated += samples_[corner] * ((corner & 1U) != 0 ? t.x() : 1.0 - t.x()) *
                        ((corner & 2U) != 0 ? t.y() : 1.0 - t.y()) *
                        ((corner & 4U) != 0 ? t.z() : 1.0 - t.z());
      }
      const double there = distanceToPlanes(planes, pointInCell(k));
      if (there >= -kBehind && std::abs(there - interpolated) > kLeastError) return true;
    }
    return false;
  }

  const std::array<double, 8>& samples_;  ///< [voxels]
  bool is_simple_ = false;
  FixedVector<structures::Triangle, kCellTriangles> triangles_;  ///< [voxels] from the middle
  FixedVector<std::size_t, kCellTriangles> plane_of_;
  CellPlanes planes_;
};

/// The planes of one brick's cells.
class ValleyFinder {
 public:
  ValleyFinder(const DistanceField& field, const TriangleTree& surface, const TriangleTree* mesh,
               const SampledBrick& brick)
      : field_(field),
        surface_(surface),
        mesh_(mesh),
        brick_(brick),
        samples_(field.layout().samples.data() +
                 static_cast<std::size_t>(brick.entry) * DistanceField::kBrickSamples) {}

  [[nodiscard]] BrickValleys find() {
    BrickValleys valleys;
    valleys.brick = brick_.entry;
    if (!findConcave()) return valleys;
    for (int cell = 0; cell < kValleyVoxels * kValleyVoxels * kValleyVoxels; ++cell) {
      const Eigen::Vector3i at(cell % kValleyVoxels, cell / kValleyVoxels % kValleyVoxels,
                               cell / (kValleyVoxels * kValleyVoxels));
      const PlanesOfCell planes = planesOf(at);
      if (planes.empty()) continue;
      valleys.cells[static_cast<std::size_t>(at.z())] |=
          std::uint64_t{1} << static_cast<unsigned>(cell % (kValleyVoxels * kValleyVoxels));
      valleys.planes.push_back(planes);
    }
    return valleys;
  }

 private:
  static constexpr std::array<int, 3> kStride{1, kValleySide, kValleySide* kValleySide};

  /// Marks the samples at which the field is concave along an axis; false where there are none.
  bool findConcave() {
    bool any = false;
    for (int k = 0; k < DistanceField::kBrickSamples; ++k) {
      for (const int stride : kStride) {
        const int along = k / stride % kValleySide;
        if (along == 0 || along == kValleySide - 1) continue;
        if (samples_[k - stride] + samples_[k + stride] - 2 * samples_[k] > -kConcave) continue;
        concave_[static_cast<std::size_t>(k)] = 1;
        any = true;
      }
    }
    return any;
  }

  [[nodiscard]] PlanesOfCell planesOf(const Eigen::Vector3i& at) {
    const int low = at.x() + kStride[1] * at.y() + kStride[2] * at.z();
    std::array<double, 8> samples;
    int least = std::numeric_limits<int>::max();
    int most = std::numeric_limits<int>::min();
    bool concave = false;
    for (int k = 0; k < 8; ++k) {
      const int i = low + (k & 1) + kStride[1] * (k >> 1 & 1) + kStride[2] * (k >> 2);
      concave = concave || concave_[static_cast<std::size_t>(i)] != 0;
      least = std::min<int>(least, samples_[i]);
      most = std::max<int>(most, samples_[i]);
      samples[static_cast<std::size_t>(k)] = samples_[i] / double{kValleyQuanta};
    }
    // at the border of the brick a sample's neighbour is another brick's
    concave = concave || (isAtBorder(at) && isBent(low));
    if (!concave || least > kNearQuanta || most < -kNearQuanta) return {};
    const Vector3 p_BoC = (at.cast<double>() + Vector3::Constant(0.5)) * brick_.voxel;
    const Vector3 p_FoC = brick_.p_FoBo_M + p_BoC;
    const Vector3 middle = field_.layout().p_MoFo_M + p_FoC;
    CellPlanes found = CellSurface(surface_, samples, middle, brick_.voxel).planes();
    // at a concave edge, pieces of the surface may count as hidden
    if (found.empty() && mesh_ != nullptr)
      found = CellSurface(*mesh_, samples, middle, brick_.voxel).planes();
    PlanesOfCell planes;
    for (const CellPlane& plane : found) {
      const double offset = plane.offset * brick_.voxel - plane.n.dot(p_FoC);
      planes.push_back(shared({plane.n.cast<float>(), static_cast<float>(offset)}));
    }
    const auto isBefore = [](const ValleyPlane& a, const ValleyPlane& b) {
      return std::lexicographical_compare(a.n_M.begin(), a.n_M.end(), b.n_M.begin(), b.n_M.end());
    };
    // by insertion: GCC 12 takes std::sort of so few to be out of their bounds
    for (std::size_t i = 1; i < planes.size(); ++i)
      for (std::size_t k = i; k > 0 && isBefore(planes[k], planes[k - 1]); --k)
        std::swap(planes[k], planes[k - 1]);
    return planes;
  }

  static bool isAtBorder(const Eigen::Vector3i& at) {
    return at.minCoeff() == 0 || at.maxCoeff() == kValleyVoxels - 1;
  }

  /// Whether the samples of the cell whose first one is `low` are not those of one plane.
  [[nodiscard]] bool isBent(int low) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int a = kStride[axis];
      const int b = kStride[(axis + 1) % 3];
      for (const int face : {low, low + kStride[(axis + 2) % 3]}) {
        const int mixed = samples_[face] + samples_[face + a + b] - samples_[face + a] - samples_[face + b];
        if (std::abs(mixed) >= kConcave) return true;
      }
    }
    return false;
  }

  /// The same plane as in other cells of the brick, where triangles differ by rounding.
  ValleyPlane shared(const ValleyPlane& plane) {
    const Vector3 p_FoBo = brick_.p_FoBo_M;
    for (const ValleyPlane& known : planes_) {
      if ((known.n_M - plane.n_M).norm() < 1e-5F &&
          std::abs(known.distance(p_FoBo) - plane.distance(p_FoBo)) < 1e-4 * brick_.voxel)
        return known;
    }
    planes_.push_back(plane);
    return plane;
  }

  const DistanceField& field_;
  const TriangleTree& surface_;
  const TriangleTree* mesh_;  ///< null where it is the same
  const SampledBrick& brick_;
  const std::int16_t* samples_;
  std::array<std::uint8_t, DistanceField::kBrickSamples> concave_{};
  std::vector<ValleyPlane> planes_;
};

/// The bricks that queries interpolate near the surface, in ascending order, without those with a dilation.
std::vector<SampledBrick> sampledBricks(const DistanceField& field) {
  std::vector<SampledBrick> bricks;
  const DistanceField::Layout& layout = field.layout();
  const double edge = layout.voxel * kValleyVoxels;
  std::size_t number = 0;
  for (int z = 0; z < layout.bricks[2]; ++z) {
    for (int y = 0; y < layout.bricks[1]; ++y) {
      for (int x = 0; x < layout.bricks[0]; ++x) {
        const Entry entry = layout.index[number++];
        if (entry < 0) continue;
        const Vector3 p_FoBo = Vector3(x, y, z) * edge;
        const Vector3 p_MBo = layout.p_MoFo_M + p_FoBo;
        if (!layout.dilations.empty() &&
            field.largestDilation({p_MBo, p_MBo + Vector3::Constant(edge)}) > 0.0)
          continue;
        if (entry < DistanceField::kRefined) {
          bricks.push_back({entry, p_FoBo, layout.voxel});
          continue;
        }
        const int r = layout.refinement;
        for (int k = 0; k < r * r * r; ++k) {
          const Entry child = layout.index[static_cast<std::size_t>(entry - DistanceField::kRefined + k)];
          const Vector3 cell(k % r, k / r % r, k / (r * r));
          if (child >= 0) bricks.push_back({child, p_FoBo + cell * (edge / r), layout.voxel / r});
        }
      }
    }
  }
  return bricks;
}

}  // namespace

std::vector<BrickValleys> findValleys(const DistanceField& field, const TriangleTree& surface,
                                      const TriangleTree* mesh, ParallelWork& work) {
  const std::vector<SampledBrick> bricks = sampledBricks(field);
  std::vector<BrickValleys> found(bricks.size());
  work.run(bricks.size(), 64,
           [&](std::size_t i) { found[i] = ValleyFinder(field, surface, mesh, bricks[i]).find(); });
  std::erase_if(found, [](const BrickValleys& valleys) { return valleys.planes.empty(); });
  return found;
}

}  // namespace tenon::bake
