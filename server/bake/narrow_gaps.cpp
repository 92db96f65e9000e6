#include "server/bake/narrow_gaps.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "server/bake/flood.h"
#include "server/bake/parallel.h"
#include "server/bake/triangle_tree.h"

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;
using Mask = BrickLevel::Mask;
constexpr int kGapVoxels = BrickLevel::kVoxels;
// Rays per region, and how many of them must have odd crossings for a solid. Between sheets, which have no
// inside, odd and even are about equally likely.
constexpr std::size_t kRays = 24;
constexpr std::size_t kRaysForSolid = 18;
// [quanta] Sum of distances above which the empty balls of neighbouring samples overlap in spite of rounding.
constexpr int kOverlap = static_cast<int>(structures::DistanceField::kQuantaPerVoxel) + 2;
// [quanta] Samples nearer to the surface than this are not used: rounding leaves their side uncertain.
constexpr int kMinDistance = 32;

/// A connected set of samples, by node.
struct GapRegion {
  std::vector<std::pair<std::size_t, Mask>> bricks;
  bool outside = false;
};

/// Directions spread over the sphere by a golden-angle spiral, of any length; unlikely to be parallel to a
/// face or an edge of a manufactured part.
std::vector<Vector3> directions() {
  std::vector<Vector3> all;
  Eigen::Vector2d around(0.6391, 0.7691);
  Eigen::Matrix2d golden;
  golden << -0.73737, -0.67549, 0.67549, -0.73737;
  for (std::size_t i = 0; i < kRays; ++i) {
    const double z = (2.0 * static_cast<double>(i) + 1.0) / kRays - 0.9863;
    around = golden * around;
    all.emplace_back(around.x() * (1.1 - std::abs(z)), around.y() * (1.1 - std::abs(z)), z);
  }
  return all;
}

class GapOpener {
 public:
  GapOpener(BrickLevel& level, const TriangleTree& tree, ParallelWork& work)
      : level_(level),
        tree_(tree),
        work_(work),
        directions_(directions()),
        links_(level.outside.size()),
        seeds_(level.nodes()),
        reached_(level.outside.size()),
        taken_(level.outside.size()) {
    work.run(level.nodes(), 256, [&](std::size_t node) {
      if (level.slot[node] >= 0) readBrick(node);
    });
  }

  std::vector<std::uint8_t> run() {
    std::vector<GapRegion> regions = findRegions();
    work_.run(regions.size(), 8, [&](std::size_t i) { regions[i].outside = !insideSolid(regions[i]); });
    std::vector<std::uint8_t> changed(level_.nodes(), 0);
    for (const GapRegion& region : regions) {
      if (!region.outside) continue;
      for (const auto& [node, mask] : region.bricks) {
        const auto slot = static_cast<std::size_t>(level_.slot[node]);
        for (std::size_t z = 0; z < kGapVoxels; ++z) level_.reached[slot][z] |= mask[z];
        changed[node] = 1;
      }
    }
    return changed;
  }

 private:
  /// Finds the neighbouring samples whose empty balls overlap: both not outside (links), or one of them
  /// (seeds).
  void readBrick(std::size_t node) {
    const auto slot = static_cast<std::size_t>(level_.slot[node]);
    const BrickLevel::SampleBits& outside = level_.outside[slot];
    if (outside.all()) return;
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    links_[slot] = Flood::linksWhere([&](int a, int b) {
      if (samples[a] + samples[b] <= kOverlap || std::min(samples[a], samples[b]) < kMinDistance)
        return false;
      const bool a_outside = outside[static_cast<std::size_t>(a)];
      const bool b_outside = outside[static_cast<std::size_t>(b)];
      if (a_outside != b_outside) {
        seeds_[node].push_back(level_.brickOf(node) * kGapVoxels +
                               BrickLevel::cellOfSample(a_outside ? b : a));
      }
      return !a_outside && !b_outside;
    });
  }

  [[nodiscard]] std::vector<GapRegion> findRegions() {
    std::vector<GapRegion> regions;
    Flood flood(level_, links_, reached_, false);
    for (const std::vector<Cell>& seeds : seeds_) {
      if (work_.cancelled()) break;
      for (const Cell& seed : seeds) {
        const std::int64_t node = level_.nodeAt(seed / kGapVoxels);
        if (node < 0) continue;
        const Cell in_brick = seed - seed / kGapVoxels * kGapVoxels;
        Mask first{};
        first[static_cast<std::size_t>(in_brick.z())] =
            std::uint64_t{1} << static_cast<unsigned>(in_brick.y() * kGapVoxels + in_brick.x());
        flood.seed(static_cast<std::size_t>(node), first);
        flood.run();
        GapRegion region = takeRegion(flood.takeReachedNodes());
        if (!flood.takeBlocked() && !region.bricks.empty()) regions.push_back(std::move(region));
      }
    }
    return regions;
  }

  [[nodiscard]] GapRegion takeRegion(const std::vector<std::size_t>& nodes) {
    GapRegion region;
    for (const std::size_t node : nodes) {
      const auto slot = static_cast<std::size_t>(level_.slot[node]);
      Mask fresh{};
      for (std::size_t z = 0; z < kGapVoxels; ++z) fresh[z] = reached_[slot][z] & ~taken_[slot][z];
      taken_[slot] = reached_[slot];
      region.bricks.emplace_back(node, fresh);
    }
    return region;
  }

  /// The origins of the rays: kRays samples spread evenly over a region.
  [[nodiscard]] std::vector<Vector3> rayOrigins(const GapRegion& region) const {
    std::size_t count = 0;
    for (const auto& [node, mask] : region.bricks) {
      for (const std::uint64_t word : mask) count += static_cast<std::size_t>(std::popcount(word));
    }
    std::vector<Vector3> origins;
    std::size_t number = 0;
    for (const auto& [node, mask] : region.bricks) {
      const Cell corner = level_.brickOf(node) * kGapVoxels;
      for (int z = 0; z < kGapVoxels; ++z) {
        for (std::uint64_t word = mask[static_cast<std::size_t>(z)]; word != 0; word &= word - 1) {
          const int bit = std::countr_zero(word);
          const Cell lattice = corner + Cell(bit % kGapVoxels, bit / kGapVoxels, z);
          for (++number; origins.size() * count < number * kRays;)
            origins.push_back(level_.position(lattice));
        }
      }
    }
    return origins;
  }

  [[nodiscard]] bool insideSolid(const GapRegion& region) const {
    std::size_t odd = 0;
    std::size_t even = 0;
    for (const Vector3& p : rayOrigins(region)) {
      (tree_.oddCrossings(p, directions_[odd + even]) ? odd : even) += 1;
      if (even > kRays - kRaysForSolid) return false;
    }
    return true;
  }

  BrickLevel& level_;
  const TriangleTree& tree_;
  ParallelWork& work_;
  const std::vector<Vector3> directions_;
  std::vector<Flood::Links> links_;       // per slot
  std::vector<std::vector<Cell>> seeds_;  // per node: lattice points next to the outside
  std::vector<Mask> reached_;             // per slot: reached from seeds
  std::vector<Mask> taken_;               // per slot: already in a region
};

}  // namespace

std::vector<std::uint8_t> openNarrowGaps(BrickLevel& level, const TriangleTree& tree, ParallelWork& work) {
  return GapOpener(level, tree, work).run();
}

}  // namespace tenon::bake
