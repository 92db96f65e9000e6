#include "server/bake/outside.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/bake/flood.h"
#include "server/bake/narrow_gaps.h"
#include "server/bake/parallel.h"
#include "server/bake/triangle_tree.h"

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;
using Mask = BrickLevel::Mask;
constexpr int kOutsideVoxels = BrickLevel::kVoxels;
// [voxels] Half the widest hole that the flood does not enter. At 1.2 one triangle in a hundred may be
// missing.
constexpr double kSigma = 1.2;
constexpr auto kSigmaQuanta = static_cast<std::int16_t>(kSigma * structures::DistanceField::kQuantaPerVoxel);
constexpr int kReach = 3;                               // [voxels] of the extension
constexpr int kPatch = BrickLevel::kSide + 2 * kReach;  // samples along an edge of a brick with kReach around

/// Links between neighbouring samples that are both further than sigma from the surface.
std::vector<Flood::Links> wideLinks(const BrickLevel& level, ParallelWork& work) {
  std::vector<Flood::Links> links(level.samples.size() / BrickLevel::kSamples);
  work.run(links.size(), 256, [&](std::size_t slot) {
    const std::int16_t* samples = level.samplesOf(static_cast<std::int32_t>(slot));
    links[slot] = Flood::linksWhere(
        [samples](int a, int b) { return samples[a] > kSigmaQuanta && samples[b] > kSigmaQuanta; });
  });
  return links;
}

/// [m] A lower bound of the distance at a point, from the value of the nearest coarse sample; negative if
/// that sample is not outside.
double distanceBoundFromCoarse(const BrickLevel& coarse, const Vector3& p_M) {
  const Cell lattice = ((p_M - coarse.p_MoFo_M) / coarse.voxel).array().round().matrix().cast<int>();
  const BrickLevel::Point point = coarse.at(lattice);
  if (!point.free) return -1.0;
  return point.distance * coarse.voxel - (coarse.position(lattice) - p_M).norm();
}

/// Along one axis, the coarse lattice coordinates nearest to the samples of a fine brick, and how far they
/// are.
struct NearestCoarse {
  std::array<int, kOutsideVoxels> lattice{};
  std::array<double, kOutsideVoxels> away{};  // [m]

  NearestCoarse(const BrickLevel& level, const BrickLevel& coarse, const Cell& corner, Eigen::Index axis) {
    for (int i = 0; i < kOutsideVoxels; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double p = level.position(corner + Cell::Constant(i))[axis];
      lattice[k] = static_cast<int>(std::round((p - coarse.p_MoFo_M[axis]) / coarse.voxel));
      away[k] = coarse.position(Cell::Constant(lattice[k]))[axis] - p;
    }
  }
};

/// Seeds what coarse samples' empty balls show to be outside by sigma: distanceBoundFromCoarse() at each
/// sample.
void seedFromCoarse(Flood& flood, const BrickLevel& level, const BrickLevel& coarse) {
  for (std::size_t node = 0; node < level.nodes(); ++node) {
    const Cell corner = level.brickOf(node) * kOutsideVoxels;
    const NearestCoarse x(level, coarse, corner, 0);
    const NearestCoarse y(level, coarse, corner, 1);
    const NearestCoarse z(level, coarse, corner, 2);
    Mask mask{};
    bool any = false;
    // neighbouring samples mostly have the same nearest one
    Cell last = Cell::Constant(-1);
    double radius = -1.0;  // [m]
    for (std::size_t k = 0; k < kOutsideVoxels * kOutsideVoxels * kOutsideVoxels; ++k) {
      const std::size_t in_x = k % kOutsideVoxels;
      const std::size_t in_y = k / kOutsideVoxels % kOutsideVoxels;
      const std::size_t in_z = k / (kOutsideVoxels * kOutsideVoxels);
      const Cell nearest(x.lattice[in_x], y.lattice[in_y], z.lattice[in_z]);
      if (nearest != last) {
        last = nearest;
        const BrickLevel::Point point = coarse.at(nearest);
        radius = point.free ? point.distance * coarse.voxel : -1.0;
      }
      if (radius < 0.0) continue;
      const double away = Vector3(x.away[in_x], y.away[in_y], z.away[in_z]).norm();
      if (radius - away <= kSigma * level.voxel) continue;
      mask[in_z] |= std::uint64_t{1} << static_cast<unsigned>(k % 64);
      any = true;
      if (level.slot[node] < 0) break;
    }
    if (any) flood.seed(node, mask);
  }
}

/// A vector to a neighbouring lattice point.
struct LatticeOffset {
  int patch_offset;
  float length;          // [voxels]
  Eigen::Vector3i step;  // [voxels]
};

/// The lattice points within kReach, nearest first.
std::vector<LatticeOffset> offsetsByLength() {
  std::vector<LatticeOffset> offsets;
  for (int z = -kReach; z <= kReach; ++z) {
    for (int y = -kReach; y <= kReach; ++y) {
      for (int x = -kReach; x <= kReach; ++x) {
        const int squared = x * x + y * y + z * z;
        if (squared == 0 || squared > kReach * kReach) continue;
        offsets.push_back({(z * kPatch + y) * kPatch + x, std::sqrt(static_cast<float>(squared)), {x, y, z}});
      }
    }
  }
  std::stable_sort(offsets.begin(), offsets.end(),
                   [](const LatticeOffset& a, const LatticeOffset& b) { return a.length < b.length; });
  return offsets;
}

/// [voxels] The radius of the empty ball around a lattice point that the flood reached; negative where it did
/// not.
float reachedRadius(const BrickLevel& level, const BrickLevel* coarse, const Cell& lattice,
                    const BrickLevel::Point& point) {
  if (point.known) return point.reached ? static_cast<float>(point.distance) : -1.0F;
  if (coarse == nullptr) return static_cast<float>(kOutsideVoxels);
  return static_cast<float>(distanceBoundFromCoarse(*coarse, level.position(lattice)) / level.voxel);
}

/// Whether rays from p say that it is in a solid. Between sheets, which have no inside, odd and even numbers
/// of crossings are about equally likely.
bool looksSolid(const TriangleTree& tree, const Vector3& p) {
  // spread over the sphere, unlikely to be parallel to a face or an edge of a manufactured part
  static const std::array<Vector3, 5> kDirections{{{0.3127, 0.4411, 0.8193},
                                                   {-0.7703, 0.1931, 0.5573},
                                                   {0.6421, -0.7309, 0.1879},
                                                   {-0.2939, -0.5171, -0.7873},
                                                   {0.5519, 0.6947, -0.4261}}};
  constexpr std::size_t kFew = 1;  // rays through holes of missing triangles
  std::size_t even = 0;
  for (const Vector3& direction : kDirections)
    if (!tree.oddCrossings(p, direction) && ++even > kFew) return false;
  return true;
}

/// Whether p is in front of all triangles that are nearest to it, at `distance` [m].
bool isInFront(const TriangleTree& tree, const Vector3& p, double distance, double margin) {
  bool any = false;
  const bool behind = tree.visitWithin(p, distance + margin, [&](const structures::Triangle& triangle) {
    any = true;
    return (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).dot(p - triangle[0]) <= 0.0;
  });
  return any && !behind;
}

/// The samples of a brick that are outside: reached, in the empty ball around a reached one, or in a corner
/// that no such ball fills. There either its empty ball overlaps that of a reached one beside it (empty balls
/// that overlap are on the same side of every surface, unless triangles are missing), or it is in front of
/// the nearest surface and sees a reached one.
BrickLevel::SampleBits extendInBrick(const BrickLevel& level, const BrickLevel* coarse, std::size_t node,
                                     const TriangleTree& tree, const std::vector<LatticeOffset>& offsets) {
  const std::int32_t slot = level.slot[node];
  const Cell corner = level.brickOf(node) * kOutsideVoxels;
  const std::int16_t* samples = level.samplesOf(slot);
  // where all samples are further away than sigma, none is outside but by the flood itself
  const bool near = *std::min_element(samples, samples + BrickLevel::kSamples) <= kSigmaQuanta;
  const int around = near ? kReach : 0;
  std::vector<float> patch(static_cast<std::size_t>(kPatch) * kPatch * kPatch);
  level.visitAround(node, around, around + 1, [&](const Cell& offset, const BrickLevel::Point& point) {
    const Cell in_patch = offset + Cell::Constant(kReach);
    patch[static_cast<std::size_t>((in_patch.z() * kPatch + in_patch.y()) * kPatch + in_patch.x())] =
        reachedRadius(level, coarse, corner + offset, point);
  });
  BrickLevel::SampleBits outside;
  // [voxels] so that a sample exactly on the surface counts as outside in spite of rounding
  constexpr float kRounding = 0.002F;
  constexpr float kLeastRadius = 0.016F;  // [voxels] of a sample whose side rounding cannot change
  constexpr float kCornerReach = 0.75F;   // [voxels] from the surface, of a sample in a corner
  constexpr double kMargin = 0.01;        // [voxels] of a sample's rounding
  constexpr std::ptrdiff_t kBeside = 26;  // offsets to the samples of neighbouring cells
  for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
    const Cell in_brick = BrickLevel::cellOfSample(sample);
    const Cell in_patch = in_brick + Cell::Constant(kReach);
    const int position = (in_patch.z() * kPatch + in_patch.y()) * kPatch + in_patch.x();
    bool is_outside = patch[static_cast<std::size_t>(position)] > 0.0F;
    if (!is_outside && samples[sample] <= kSigmaQuanta) {
      is_outside = std::any_of(offsets.begin(), offsets.end(), [&](const LatticeOffset& neighbour) {
        return patch[static_cast<std::size_t>(position + neighbour.patch_offset)] + kRounding >=
               neighbour.length;
      });
      const float own = static_cast<float>(samples[sample]) / structures::DistanceField::kQuantaPerVoxel;
      const bool in_corner =
          !is_outside && own > kLeastRadius &&
          std::any_of(offsets.begin(), offsets.begin() + kBeside, [&](const LatticeOffset& neighbour) {
            const float radius = patch[static_cast<std::size_t>(position + neighbour.patch_offset)];
            return radius > 0.0F && radius + own > neighbour.length + kRounding;
          });
      const Vector3 p = level.position(corner + in_brick);
      const bool sees_outside =
          !is_outside && !in_corner && own > kLeastRadius && own < kCornerReach &&
          isInFront(tree, p, own * level.voxel, kMargin * level.voxel) &&
          std::any_of(offsets.begin(), offsets.end(), [&](const LatticeOffset& neighbour) {
            return patch[static_cast<std::size_t>(position + neighbour.patch_offset)] > 0.0F &&
                   tree.firstIntersection(p, level.voxel * neighbour.step.cast<double>()).triangle == nullptr;
          });
      is_outside = is_outside || ((in_corner || sees_outside) && !looksSolid(tree, p));
    }
    outside[static_cast<std::size_t>(sample)] = is_outside;
  }
  return outside;
}

/// Whether a brick or one of its 26 neighbours is marked.
bool anyAround(const BrickLevel& level, std::size_t node, const std::vector<std::uint8_t>& marks) {
  const Cell brick = level.brickOf(node);
  for (int k = 0; k < 27; ++k) {
    const std::int64_t found = level.nodeAt(brick + Cell(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
    if (found >= 0 && marks[static_cast<std::size_t>(found)] != 0) return true;
  }
  return false;
}

}  // namespace

void findOutside(BrickLevel& level, const BrickLevel* coarse, const TriangleTree& tree, ParallelWork& work) {
  const std::vector<Flood::Links> links = wideLinks(level, work);
  level.reached.assign(links.size(), Mask{});
  Flood flood(level, links, level.reached, true);
  if (coarse != nullptr) {
    seedFromCoarse(flood, level, *coarse);
  } else {
    Mask corner{};
    corner[0] = 1;
    flood.seed(0, corner);
  }
  flood.run();

  const std::vector<LatticeOffset> offsets = offsetsByLength();
  std::vector<BrickLevel::SampleBits> outside(level.reached.size());
  const auto extend = [&](std::size_t node) {
    const std::int32_t slot = level.slot[node];
    if (slot >= 0)
      outside[static_cast<std::size_t>(slot)] = extendInBrick(level, coarse, node, tree, offsets);
  };
  work.run(level.nodes(), 256, extend);
  level.outside = outside;
  const std::vector<std::uint8_t> changed = openNarrowGaps(level, tree, work);
  work.run(level.nodes(), 256, [&](std::size_t node) {
    if (anyAround(level, node, changed)) extend(node);
  });
  level.outside = std::move(outside);
}

void adoptFineSigns(BrickLevel& coarse, const BrickLevel& fine, ParallelWork& work) {
  work.run(coarse.nodes(), 256, [&](std::size_t node) {
    const std::int32_t slot = coarse.slot[node];
    if (slot < 0) return;
    const Cell corner = coarse.brickOf(node) * kOutsideVoxels;
    for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
      const Cell in_brick = BrickLevel::cellOfSample(sample);
      const BrickLevel::Point point = fine.at((corner + in_brick) * fine.refinement);
      if (point.known) {
        coarse.outside[static_cast<std::size_t>(slot)][static_cast<std::size_t>(sample)] = point.free;
      }
    }
  });
}

}  // namespace tenon::bake
