#include "server/bake/outside.h"

#include <algorithm>
#include <cmath>

#include "server/bake/flood.h"
#include "server/bake/narrow_gaps.h"
#include "server/bake/parallel.h"

namespace tenon {

namespace {

using Cell = BrickLevel::Cell;
using Mask = BrickLevel::Mask;
constexpr int kOutsideVoxels = BrickLevel::kVoxels;
// Half the widest gap that is closed [voxels]: at 1.2 one triangle in a hundred may be missing.
constexpr double kSigma = 1.2;
constexpr auto kSigmaQuanta = static_cast<std::int16_t>(kSigma * DistanceField::kQuantaPerVoxel);
constexpr int kReach = 3;                               // of the extension [voxels]
constexpr int kPatch = BrickLevel::kSide + 2 * kReach;  // a brick's samples and all within reach

/// The pairs of neighbours that are both further than sigma from the surface.
std::vector<Flood::Links> wideLinks(const BrickLevel& level, ParallelWork& work) {
  std::vector<Flood::Links> links(level.samples.size() / BrickLevel::kSamples);
  work.run(links.size(), 256, [&](std::size_t slot) {
    const std::int16_t* samples = level.samplesOf(static_cast<std::int32_t>(slot));
    links[slot] = Flood::linksWhere(
        [samples](int a, int b) { return samples[a] > kSigmaQuanta && samples[b] > kSigmaQuanta; });
  });
  return links;
}

/// A lower bound of the distance at a point [m] from the coarse sample next to it, if that one is outside.
double clearanceFromCoarse(const BrickLevel& coarse, const Vector3& p_M) {
  const Cell lattice = ((p_M - coarse.p_MoFo_M) / coarse.voxel).array().round().matrix().cast<int>();
  const BrickLevel::Point point = coarse.at(lattice);
  if (!point.free) return -1.0;
  return point.distance * coarse.voxel - (coarse.position(lattice) - p_M).norm();
}

void seedFromCoarse(Flood& flood, const BrickLevel& level, const BrickLevel& coarse) {
  for (std::size_t node = 0; node < level.nodes(); ++node) {
    const Cell corner = level.brickOf(node) * kOutsideVoxels;
    Mask mask{};
    bool any = false;
    for (int k = 0; k < kOutsideVoxels * kOutsideVoxels * kOutsideVoxels; ++k) {
      const Cell in_brick(k % kOutsideVoxels, k / kOutsideVoxels % kOutsideVoxels,
                          k / (kOutsideVoxels * kOutsideVoxels));
      if (clearanceFromCoarse(coarse, level.position(corner + in_brick)) <= kSigma * level.voxel) continue;
      mask[static_cast<std::size_t>(in_brick.z())] |= std::uint64_t{1} << static_cast<unsigned>(k % 64);
      any = true;
    }
    if (any) flood.seed(node, mask);
  }
}

/// Steps to the lattice points within kReach, nearest first.
struct Step {
  int patch_offset;
  float length;
};

std::vector<Step> stepsByLength() {
  std::vector<Step> steps;
  for (int z = -kReach; z <= kReach; ++z) {
    for (int y = -kReach; y <= kReach; ++y) {
      for (int x = -kReach; x <= kReach; ++x) {
        const int squared = x * x + y * y + z * z;
        if (squared == 0 || squared > kReach * kReach) continue;
        steps.push_back({(z * kPatch + y) * kPatch + x, std::sqrt(static_cast<float>(squared))});
      }
    }
  }
  std::stable_sort(steps.begin(), steps.end(),
                   [](const Step& a, const Step& b) { return a.length < b.length; });
  return steps;
}

/// The empty radius about a lattice point that the flood reached [voxels]; -1 where it did not.
float reachedRadius(const BrickLevel& level, const BrickLevel* coarse, const Cell& lattice,
                    const BrickLevel::Point& point) {
  if (point.known) return point.reached ? static_cast<float>(point.distance) : -1.0F;
  if (coarse == nullptr) return static_cast<float>(kOutsideVoxels);
  return static_cast<float>(clearanceFromCoarse(*coarse, level.position(lattice)) / level.voxel);
}

/// Which samples of a brick are outside: reached, or in an empty ball about a reached one.
BrickLevel::SampleBits extendInBrick(const BrickLevel& level, const BrickLevel* coarse, std::size_t node,
                                     const std::vector<Step>& steps) {
  const std::int32_t slot = level.slot[node];
  const Cell corner = level.brickOf(node) * kOutsideVoxels;
  std::vector<float> patch(static_cast<std::size_t>(kPatch) * kPatch * kPatch);
  level.visitAround(node, kReach, kReach + 1, [&](const Cell& offset, const BrickLevel::Point& point) {
    const Cell in_patch = offset + Cell::Constant(kReach);
    patch[static_cast<std::size_t>((in_patch.z() * kPatch + in_patch.y()) * kPatch + in_patch.x())] =
        reachedRadius(level, coarse, corner + offset, point);
  });
  BrickLevel::SampleBits outside;
  // a sample on the surface itself is outside in spite of rounding
  constexpr float kRounding = 0.002F;
  for (int sample = 0; sample < BrickLevel::kSamples; ++sample) {
    const Cell in_brick(sample % BrickLevel::kSide, sample / BrickLevel::kSide % BrickLevel::kSide,
                        sample / (BrickLevel::kSide * BrickLevel::kSide));
    const Cell in_patch = in_brick + Cell::Constant(kReach);
    const int place = (in_patch.z() * kPatch + in_patch.y()) * kPatch + in_patch.x();
    bool is_outside = patch[static_cast<std::size_t>(place)] > 0.0F;
    if (!is_outside && level.samplesOf(slot)[sample] <= kSigmaQuanta) {
      is_outside = std::any_of(steps.begin(), steps.end(), [&](const Step& step) {
        return patch[static_cast<std::size_t>(place + step.patch_offset)] + kRounding >= step.length;
      });
    }
    outside[static_cast<std::size_t>(sample)] = is_outside;
  }
  return outside;
}

/// Whether a brick or one of its neighbours is marked.
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

  const std::vector<Step> steps = stepsByLength();
  std::vector<BrickLevel::SampleBits> outside(level.reached.size());
  const auto extend = [&](std::size_t node) {
    const std::int32_t slot = level.slot[node];
    if (slot >= 0) outside[static_cast<std::size_t>(slot)] = extendInBrick(level, coarse, node, steps);
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
      const Cell in_brick(sample % BrickLevel::kSide, sample / BrickLevel::kSide % BrickLevel::kSide,
                          sample / (BrickLevel::kSide * BrickLevel::kSide));
      const BrickLevel::Point point = fine.at((corner + in_brick) * fine.refinement);
      if (point.known) {
        coarse.outside[static_cast<std::size_t>(slot)][static_cast<std::size_t>(sample)] = point.free;
      }
    }
  });
}

}  // namespace tenon
