#include "server/bake/narrow_gaps.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "server/bake/flood.h"
#include "server/bake/parallel.h"
#include "server/bake/triangle_tree.h"

namespace tenon {

namespace {

using Cell = BrickLevel::Cell;
using Mask = BrickLevel::Mask;
constexpr int kGapVoxels = BrickLevel::kVoxels;
// Rays by which a part is asked, at most; three quarters of them say that it is in a solid. Between sheets,
// which have no inside, they are even odds.
constexpr std::size_t kRays = 24;
constexpr std::size_t kRaysForSolid = 18;
// Sum of distances at which the balls of neighbours overlap, in spite of rounding [quanta].
constexpr int kOverlap = static_cast<int>(DistanceField::kQuantaPerVoxel) + 2;
// Nearer to the surface than this a sample may be on either side of it, whatever it is called [quanta].
constexpr int kSure = 32;

/// Samples that hang together, by node.
struct Part {
  std::vector<std::pair<std::size_t, Mask>> bricks;
  bool outside = false;
};

/// Spread over the sphere; no face or edge of what people make is likely to be parallel to one.
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
        doors_(level.nodes()),
        reached_(level.outside.size()),
        taken_(level.outside.size()) {
    work.run(level.nodes(), 256, [&](std::size_t node) {
      if (level.slot[node] >= 0) readBrick(node);
    });
  }

  std::vector<std::uint8_t> run() {
    std::vector<Part> parts = findParts();
    work_.run(parts.size(), 8, [&](std::size_t i) { parts[i].outside = !insideSolid(parts[i]); });
    std::vector<std::uint8_t> changed(level_.nodes(), 0);
    for (const Part& part : parts) {
      if (!part.outside) continue;
      for (const auto& [node, mask] : part.bricks) {
        const auto slot = static_cast<std::size_t>(level_.slot[node]);
        for (std::size_t z = 0; z < kGapVoxels; ++z) level_.reached[slot][z] |= mask[z];
        changed[node] = 1;
      }
    }
    return changed;
  }

 private:
  /// Finds the pairs whose balls overlap: both not outside (links), or one of them (doors).
  void readBrick(std::size_t node) {
    const auto slot = static_cast<std::size_t>(level_.slot[node]);
    const BrickLevel::SampleBits& outside = level_.outside[slot];
    if (outside.all()) return;
    const std::int16_t* samples = level_.samplesOf(level_.slot[node]);
    links_[slot] = Flood::linksWhere([&](int a, int b) {
      if (samples[a] + samples[b] <= kOverlap || std::min(samples[a], samples[b]) < kSure) return false;
      const bool a_outside = outside[static_cast<std::size_t>(a)];
      const bool b_outside = outside[static_cast<std::size_t>(b)];
      if (a_outside != b_outside) {
        doors_[node].push_back(level_.brickOf(node) * kGapVoxels +
                               BrickLevel::cellOfSample(a_outside ? b : a));
      }
      return !a_outside && !b_outside;
    });
  }

  [[nodiscard]] std::vector<Part> findParts() {
    std::vector<Part> parts;
    Flood flood(level_, links_, reached_, false);
    for (const std::vector<Cell>& doors : doors_) {
      if (work_.cancelled()) break;
      for (const Cell& door : doors) {
        const std::int64_t node = level_.nodeAt(door / kGapVoxels);
        if (node < 0) continue;
        const Cell in_brick = door - door / kGapVoxels * kGapVoxels;
        Mask first{};
        first[static_cast<std::size_t>(in_brick.z())] =
            std::uint64_t{1} << static_cast<unsigned>(in_brick.y() * kGapVoxels + in_brick.x());
        flood.seed(static_cast<std::size_t>(node), first);
        flood.run();
        Part part = takePart(flood.takeTouched());
        if (!flood.takeStopped() && !part.bricks.empty()) parts.push_back(std::move(part));
      }
    }
    return parts;
  }

  [[nodiscard]] Part takePart(const std::vector<std::size_t>& nodes) {
    Part part;
    for (const std::size_t node : nodes) {
      const auto slot = static_cast<std::size_t>(level_.slot[node]);
      Mask fresh{};
      for (std::size_t z = 0; z < kGapVoxels; ++z) fresh[z] = reached_[slot][z] & ~taken_[slot][z];
      taken_[slot] = reached_[slot];
      part.bricks.emplace_back(node, fresh);
    }
    return part;
  }

  /// Samples spread evenly over a part, as many as there are rays.
  [[nodiscard]] std::vector<Vector3> placesIn(const Part& part) const {
    std::size_t count = 0;
    for (const auto& [node, mask] : part.bricks) {
      for (const std::uint64_t word : mask) count += static_cast<std::size_t>(std::popcount(word));
    }
    std::vector<Vector3> places;
    std::size_t number = 0;
    for (const auto& [node, mask] : part.bricks) {
      const Cell corner = level_.brickOf(node) * kGapVoxels;
      for (int z = 0; z < kGapVoxels; ++z) {
        for (std::uint64_t word = mask[static_cast<std::size_t>(z)]; word != 0; word &= word - 1) {
          const int bit = std::countr_zero(word);
          const Cell lattice = corner + Cell(bit % kGapVoxels, bit / kGapVoxels, z);
          for (++number; places.size() * count < number * kRays;) places.push_back(level_.position(lattice));
        }
      }
    }
    return places;
  }

  [[nodiscard]] bool insideSolid(const Part& part) const {
    std::size_t odd = 0;
    std::size_t even = 0;
    for (const Vector3& p : placesIn(part)) {
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
  std::vector<std::vector<Cell>> doors_;  // per node: lattice points next to the outside
  std::vector<Mask> reached_;             // per slot, through doors
  std::vector<Mask> taken_;               // per slot, into a part
};

}  // namespace

std::vector<std::uint8_t> openNarrowGaps(BrickLevel& level, const TriangleTree& tree, ParallelWork& work) {
  return GapOpener(level, tree, work).run();
}

}  // namespace tenon
