#include "server/bake/outside.h"

#include <algorithm>
#include <cmath>

#include "server/bake/parallel.h"

namespace tenon {

namespace {

using Cell = BrickLevel::Cell;
using Mask = BrickLevel::Mask;
constexpr int kVoxels = BrickLevel::kVoxels;
// Half the widest gap that is closed [voxels]: at 1.2 one triangle in a hundred may be missing.
constexpr double kSigma = 1.2;
constexpr int kReach = 3;                               // of the extension [voxels]
constexpr int kPatch = BrickLevel::kSide + 2 * kReach;  // a brick's samples and all within reach
constexpr std::uint64_t kLowX = 0x0101010101010101ULL;
constexpr std::uint64_t kHighX = kLowX << 7U;

/// Floods bricks by words of 64 samples; bricks without surface are one step each.
class Flood {
 public:
  explicit Flood(BrickLevel& level) : level_(level), queued_(level.nodes(), 0) {
    std::size_t slots = level.samples.size() / BrickLevel::kSamples;
    passable_.resize(slots);
    level.reached.assign(slots, Mask{});
    for (std::size_t s = 0; s < slots; ++s)
      passable_[s] = passable(level.samplesOf(static_cast<std::int32_t>(s)));
  }

  void seed(std::size_t node, const Mask& mask) {
    const std::int32_t slot = level_.slot[node];
    if (slot < 0) {
      if (level_.free[node] != 0) return;
      level_.free[node] = 1;
    } else {
      Mask& reached = level_.reached[static_cast<std::size_t>(slot)];
      std::uint64_t fresh = 0;
      for (int z = 0; z < kVoxels; ++z) {
        const auto w = static_cast<std::size_t>(z);
        const std::uint64_t open = mask[w] & passable_[static_cast<std::size_t>(slot)][w] & ~reached[w];
        reached[w] |= open;
        fresh |= open;
      }
      if (fresh == 0) return;
    }
    if (queued_[node] != 0) return;
    queued_[node] = 1;
    waiting_.push_back(node);
  }

  void run() {
    while (!waiting_.empty()) {
      const std::size_t node = waiting_.back();
      waiting_.pop_back();
      queued_[node] = 0;
      Mask mask;
      mask.fill(~std::uint64_t{0});
      if (const std::int32_t slot = level_.slot[node]; slot >= 0) {
        spread(static_cast<std::size_t>(slot));
        mask = level_.reached[static_cast<std::size_t>(slot)];
      }
      const Cell brick = level_.brickOf(node);
      for (int face = 0; face < 6; ++face) {
        const auto [onto, any] = through(mask, face);
        if (!any) continue;
        Cell neighbour = brick;
        neighbour[face / 2] += face % 2 == 0 ? -1 : 1;
        const std::int64_t other = level_.nodeAt(neighbour);
        if (other >= 0) seed(static_cast<std::size_t>(other), onto);
      }
    }
  }

 private:
  static Mask passable(const std::int16_t* samples) {
    constexpr auto kSigmaQuanta = static_cast<std::int16_t>(kSigma * DistanceField::kQuantaPerVoxel);
    Mask mask{};
    for (int z = 0; z < kVoxels; ++z) {
      for (int bit = 0; bit < kVoxels * kVoxels; ++bit) {
        const Cell in_brick(bit % kVoxels, bit / kVoxels, z);
        const bool open = samples[BrickLevel::sampleIndex(in_brick)] > kSigmaQuanta;
        mask[static_cast<std::size_t>(z)] |= static_cast<std::uint64_t>(open) << static_cast<unsigned>(bit);
      }
    }
    return mask;
  }

  void spread(std::size_t slot) {
    Mask& reached = level_.reached[slot];
    bool changed = true;
    while (changed) {
      changed = false;
      for (std::size_t z = 0; z < kVoxels; ++z) {
        const std::uint64_t e = reached[z];
        std::uint64_t next = e | (e & ~kHighX) << 1U | (e & ~kLowX) >> 1U | e << 8U | e >> 8U;
        if (z > 0) next |= reached[z - 1];
        if (z + 1 < kVoxels) next |= reached[z + 1];
        next &= passable_[slot][z];
        changed = changed || (next | e) != e;
        reached[z] = next | e;
      }
    }
  }

  /// The samples of the brick beyond a face (-x +x -y +y -z +z) that touch reached ones of this brick.
  static std::pair<Mask, bool> through(const Mask& mask, int face) {
    Mask onto{};
    std::uint64_t any = 0;
    for (std::size_t z = 0; z < kVoxels; ++z) {
      switch (face) {
        case 0:
          onto[z] = (mask[z] & kLowX) << 7U;
          break;
        case 1:
          onto[z] = (mask[z] & kHighX) >> 7U;
          break;
        case 2:
          onto[z] = mask[z] << 56U;
          break;
        case 3:
          onto[z] = mask[z] >> 56U;
          break;
        default:
          break;
      }
    }
    if (face == 4) onto[kVoxels - 1] = mask[0];
    if (face == 5) onto[0] = mask[kVoxels - 1];
    for (const std::uint64_t word : onto) any |= word;
    return {onto, any != 0};
  }

  BrickLevel& level_;
  std::vector<Mask> passable_;
  std::vector<std::uint8_t> queued_;
  std::vector<std::size_t> waiting_;
};

/// A lower bound of the distance at a point [m] from the coarse sample next to it, if that one is outside.
double clearanceFromCoarse(const BrickLevel& coarse, const Vector3& p_M) {
  const Cell lattice = ((p_M - coarse.p_MoFo_M) / coarse.voxel).array().round().matrix().cast<int>();
  const BrickLevel::Point point = coarse.at(lattice);
  if (!point.free) return -1.0;
  return point.distance * coarse.voxel - (coarse.position(lattice) - p_M).norm();
}

void seedFromCoarse(Flood& flood, const BrickLevel& level, const BrickLevel& coarse) {
  for (std::size_t node = 0; node < level.nodes(); ++node) {
    const Cell corner = level.brickOf(node) * kVoxels;
    Mask mask{};
    bool any = false;
    for (int k = 0; k < kVoxels * kVoxels * kVoxels; ++k) {
      const Cell in_brick(k % kVoxels, k / kVoxels % kVoxels, k / (kVoxels * kVoxels));
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
  if (coarse == nullptr) return static_cast<float>(kVoxels);
  return static_cast<float>(clearanceFromCoarse(*coarse, level.position(lattice)) / level.voxel);
}

/// Which samples of a brick are outside: reached, or in an empty ball about a reached one.
BrickLevel::SampleBits extendInBrick(const BrickLevel& level, const BrickLevel* coarse, std::size_t node,
                                     const std::vector<Step>& steps) {
  const std::int32_t slot = level.slot[node];
  const Cell corner = level.brickOf(node) * kVoxels;
  std::vector<float> patch(static_cast<std::size_t>(kPatch) * kPatch * kPatch);
  level.visitAround(node, kReach, kReach + 1, [&](const Cell& offset, const BrickLevel::Point& point) {
    const Cell in_patch = offset + Cell::Constant(kReach);
    patch[static_cast<std::size_t>((in_patch.z() * kPatch + in_patch.y()) * kPatch + in_patch.x())] =
        reachedRadius(level, coarse, corner + offset, point);
  });
  BrickLevel::SampleBits outside;
  constexpr auto kSigmaQuanta = static_cast<std::int16_t>(kSigma * DistanceField::kQuantaPerVoxel);
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

}  // namespace

void findOutside(BrickLevel& level, const BrickLevel* coarse, ParallelWork& work) {
  Flood flood(level);
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
  work.run(level.nodes(), 256, [&](std::size_t node) {
    const std::int32_t slot = level.slot[node];
    if (slot >= 0) outside[static_cast<std::size_t>(slot)] = extendInBrick(level, coarse, node, steps);
  });
  level.outside = std::move(outside);
}

void adoptFineSigns(BrickLevel& coarse, const BrickLevel& fine, ParallelWork& work) {
  work.run(coarse.nodes(), 256, [&](std::size_t node) {
    const std::int32_t slot = coarse.slot[node];
    if (slot < 0) return;
    const Cell corner = coarse.brickOf(node) * kVoxels;
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
