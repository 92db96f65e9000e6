#include "server/bake/brick_level.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/bake/parallel.h"
#include "server/structures/field_builder.h"

namespace tenon {

namespace {

using Cell = BrickLevel::Cell;
// From a sub-block's centre to its corner [voxels].
constexpr double kBlockRadius = 1.7321;
constexpr int kBlock = 3;
// What fits into 3 GB: bricks of 1,458 bytes, and places in triangle lists of 4.
constexpr std::size_t kMaxSlots = 1'000'000;
constexpr std::size_t kMaxListed = 250'000'000;

std::size_t linear(const Cell& cell, const Cell& size) {
  return (static_cast<std::size_t>(cell.z()) * static_cast<std::size_t>(size.y()) +
          static_cast<std::size_t>(cell.y())) *
             static_cast<std::size_t>(size.x()) +
         static_cast<std::size_t>(cell.x());
}

Cell unlinear(std::size_t number, const Cell& size) {
  const auto nx = static_cast<std::size_t>(size.x());
  const auto ny = static_cast<std::size_t>(size.y());
  return {static_cast<int>(number % nx), static_cast<int>(number / nx % ny),
          static_cast<int>(number / nx / ny)};
}

/// A triangle and its distance from some centre: at a point c away from there it is at least distance - c
/// away.
struct Ranked {
  double distance;
  const Triangle* triangle;
};

// Triangles lie in one array, so their addresses break ties the same way in every run.
bool nearer(const Ranked& a, const Ranked& b) {
  return a.distance != b.distance ? a.distance < b.distance : a.triangle < b.triangle;
}

std::vector<Ranked> ranked(std::span<const Triangle> triangles, const Vector3& centre) {
  std::vector<Ranked> ranks;
  ranks.reserve(triangles.size());
  for (const Triangle& t : triangles) ranks.push_back({std::sqrt(squaredDistance(centre, t)), &t});
  std::sort(ranks.begin(), ranks.end(), nearer);
  return ranks;
}

bool inside(const Cell& cell, const Cell& size) {
  return (cell.array() >= 0).all() && (cell.array() < size.array()).all();
}

}  // namespace

BrickLevel::BrickLevel(const Vector3& p_MoFo, double edge, const Cell& brick_counts)
    : p_MoFo_M(p_MoFo), voxel(edge), bricks(brick_counts), coarse_bricks_(brick_counts) {
  const auto count = static_cast<std::size_t>(bricks.x()) * static_cast<std::size_t>(bricks.y()) *
                     static_cast<std::size_t>(bricks.z());
  slot.assign(count, -1);
  free.assign(count, 0);
}

BrickLevel::BrickLevel(const BrickLevel& coarse, int cuts, std::span<const std::uint32_t> refined)
    : p_MoFo_M(coarse.p_MoFo_M),
      voxel(coarse.voxel / cuts),
      bricks(coarse.bricks * cuts),
      refinement(cuts),
      coarse_bricks_(coarse.bricks),
      block_of_coarse_(coarse.nodes(), -1),
      coarse_of_block_(refined.begin(), refined.end()) {
  for (std::size_t block = 0; block < refined.size(); ++block) {
    block_of_coarse_[refined[block]] = static_cast<std::int32_t>(block);
  }
  const std::size_t children = static_cast<std::size_t>(cuts) * static_cast<std::size_t>(cuts * cuts);
  slot.assign(refined.size() * children, -1);
  free.assign(slot.size(), 0);
}

std::int64_t BrickLevel::nodeAt(const Cell& brick) const {
  if (!inside(brick, bricks)) return -1;
  if (refinement == 1) return static_cast<std::int64_t>(linear(brick, bricks));
  const Cell parent = brick / refinement;
  const std::int32_t block = block_of_coarse_[linear(parent, coarse_bricks_)];
  if (block < 0) return -1;
  const Cell size = Cell::Constant(refinement);
  return static_cast<std::int64_t>(static_cast<std::size_t>(block) * static_cast<std::size_t>(size.prod()) +
                                   linear(brick - parent * refinement, size));
}

Cell BrickLevel::brickOf(std::size_t node) const {
  if (refinement == 1) return unlinear(node, bricks);
  const Cell size = Cell::Constant(refinement);
  const auto children = static_cast<std::size_t>(size.prod());
  return unlinear(coarse_of_block_[node / children], coarse_bricks_) * refinement +
         unlinear(node % children, size);
}

BrickLevel::Point BrickLevel::at(const Cell& lattice) const {
  const Cell brick(lattice.x() >> 3, lattice.y() >> 3, lattice.z() >> 3);
  const std::int64_t node = nodeAt(brick);
  if (node < 0) return {};
  Point point;
  point.known = true;
  const std::int32_t of_slot = slot[static_cast<std::size_t>(node)];
  if (of_slot < 0) {
    point.free = point.reached = free[static_cast<std::size_t>(node)] != 0;
    point.distance = DistanceField::kBandVoxels;
    return point;
  }
  const Cell in_brick = lattice - brick * kVoxels;
  const int sample = sampleIndex(in_brick);
  point.distance = std::abs(static_cast<double>(samplesOf(of_slot)[sample])) / DistanceField::kQuantaPerVoxel;
  const auto s = static_cast<std::size_t>(of_slot);
  if (!outside.empty()) point.free = outside[s][static_cast<std::size_t>(sample)];
  if (!reached.empty()) {
    const std::uint64_t word = reached[s][static_cast<std::size_t>(in_brick.z())];
    point.reached = (word >> static_cast<unsigned>(in_brick.y() * kVoxels + in_brick.x()) & 1U) != 0;
  }
  return point;
}

/// Calls visit(node) for bricks of layers [z_begin, z_end) that are within kClampVoxels of the triangle.
/// Ranges of bricks are halved until one is left: work grows with the triangle's surface, not with its box.
template <typename Visit>
void BrickLevel::visitNear(const Triangle& triangle, int z_begin, int z_end, Visit&& visit) const {
  const double reach = DistanceField::kClampVoxels * voxel;
  const double edge = voxel * kVoxels;
  const Eigen::AlignedBox3d box = boxOf(triangle);
  const auto brickAt = [&](const Vector3& p) -> Cell {
    return ((p - p_MoFo_M) / edge).array().floor().matrix().template cast<int>();
  };
  Cell low = brickAt(box.min() - Vector3::Constant(reach)).cwiseMax(0);
  Cell high = brickAt(box.max() + Vector3::Constant(reach)).cwiseMin(bricks - Cell::Ones());
  low.z() = std::max(low.z(), z_begin);
  high.z() = std::min(high.z(), z_end - 1);
  if ((low.array() > high.array()).any()) return;

  const auto descend = [&](const auto& self, const Cell& from, const Cell& to) -> void {
    const Cell count = to - from + Cell::Ones();
    const Vector3 half = count.cast<double>() * (edge / 2);
    const Vector3 centre = p_MoFo_M + from.cast<double>() * edge + half;
    const double radius = half.norm() + reach;
    if (squaredDistance(centre, triangle) > radius * radius) return;
    int axis = 0;
    if (count.maxCoeff(&axis) == 1) {
      const std::int64_t node = nodeAt(from);
      if (node >= 0) visit(static_cast<std::size_t>(node));
      return;
    }
    Cell middle = to;
    middle[axis] = from[axis] + count[axis] / 2 - 1;
    self(self, from, middle);
    Cell next = from;
    next[axis] = middle[axis] + 1;
    self(self, next, to);
  };
  descend(descend, low, high);
}

bool BrickLevel::listTriangles(std::span<const Triangle> triangles, ParallelWork& work) {
  // each piece of work owns a few layers of bricks, so no two write to one node
  const int layers = std::max(1, (bricks.z() + 15) / 16);
  const auto pieces = static_cast<std::size_t>((bricks.z() + layers - 1) / layers);
  std::vector<std::uint32_t> counts(nodes(), 0);
  const auto layersOf = [&](std::size_t piece) {
    const int begin = static_cast<int>(piece) * layers;
    return std::pair(begin, std::min(begin + layers, bricks.z()));
  };
  work.run(pieces, 1, [&](std::size_t piece) {
    const auto [begin, end] = layersOf(piece);
    for (const Triangle& t : triangles) visitNear(t, begin, end, [&](std::size_t node) { ++counts[node]; });
  });
  near_first.assign(nodes() + 1, 0);
  for (std::size_t node = 0; node < nodes(); ++node) near_first[node + 1] = near_first[node] + counts[node];
  if (near_first.back() > kMaxListed) return false;
  near_triangles.resize(near_first.back());
  std::fill(counts.begin(), counts.end(), 0U);
  work.run(pieces, 1, [&](std::size_t piece) {
    const auto [begin, end] = layersOf(piece);
    for (std::uint32_t i = 0; i < triangles.size(); ++i) {
      visitNear(triangles[i], begin, end,
                [&](std::size_t node) { near_triangles[near_first[node] + counts[node]++] = i; });
    }
  });
  return true;
}

bool BrickLevel::sampleDistances(std::span<const Triangle> triangles, ParallelWork& work) {
  // bricks whose centre is too far away have no sample in the band
  std::vector<std::uint8_t> candidate(nodes(), 0);
  work.run(nodes(), 1024, [&](std::size_t node) {
    const double reach = (DistanceField::kBandVoxels + BrickLevel::kBrickRadius) * voxel;
    const Vector3 centre = position(brickOf(node) * kVoxels + Cell::Constant(kVoxels / 2));
    const auto list = near(node);
    candidate[node] = std::any_of(list.begin(), list.end(), [&](std::uint32_t i) {
      return squaredDistance(centre, triangles[i]) < reach * reach;
    });
  });
  std::vector<std::uint32_t> of_slot;
  for (std::size_t node = 0; node < nodes(); ++node) {
    if (candidate[node] == 0) continue;
    slot[node] = static_cast<std::int32_t>(of_slot.size());
    of_slot.push_back(static_cast<std::uint32_t>(node));
  }
  if (of_slot.size() > kMaxSlots) return false;
  samples.resize(of_slot.size() * kSamples);
  work.run(of_slot.size(), 64, [&](std::size_t s) {
    const std::uint32_t node = of_slot[s];
    std::vector<Triangle> local;
    for (const std::uint32_t i : near(node)) local.push_back(triangles[i]);
    std::int16_t* out = samplesOf(static_cast<std::int32_t>(s));
    sampleBrick(node, local, nullptr, out);
    const auto band = static_cast<std::int16_t>(DistanceField::kBandVoxels * DistanceField::kQuantaPerVoxel);
    if (*std::min_element(out, out + kSamples) >= band) slot[node] = -1;
  });
  return true;
}

void BrickLevel::sampleBrick(std::size_t node, std::span<const Triangle> triangles, const SampleBits* which,
                             std::int16_t* out) const {
  const Cell corner = brickOf(node) * kVoxels;
  const Vector3 middle = position(corner + Cell::Constant(kVoxels / 2));
  const std::vector<Ranked> by_brick = ranked(triangles, middle);
  std::vector<Ranked> by_block;
  for (int block = 0; block < 27; ++block) {
    // only triangles that can be nearest to some sample of the block, nearest to its centre first
    const Cell first = corner + kBlock * Cell(block % 3, block / 3 % 3, block / 9);
    const Vector3 centre = position(first + Cell::Ones());
    const double from_middle = (centre - middle).norm();
    double reach = std::numeric_limits<double>::infinity();
    by_block.clear();
    for (const Ranked& r : by_brick) {
      if (r.distance - from_middle > reach) break;
      const double distance = std::sqrt(squaredDistance(centre, *r.triangle));
      if (distance > reach) continue;
      reach = std::min(reach, distance + 2.0 * kBlockRadius * voxel);
      by_block.push_back({distance, r.triangle});
    }
    std::sort(by_block.begin(), by_block.end(), nearer);
    for (int k = 0; k < kBlock * kBlock * kBlock; ++k) {
      const Cell lattice = first + Cell(k % 3, k / 3 % 3, k / 9);
      const int sample = sampleIndex(lattice - corner);
      if (which != nullptr && !(*which)[static_cast<std::size_t>(sample)]) continue;
      const Vector3 p = position(lattice);
      const double from_centre = (p - centre).norm();
      double squared = std::numeric_limits<double>::infinity();
      double enough = squared;
      for (const Ranked& r : by_block) {
        if (r.distance > enough) break;
        const double candidate = squaredDistance(p, *r.triangle);
        if (candidate >= squared) continue;
        squared = candidate;
        enough = std::sqrt(squared) + from_centre;
      }
      out[sample] = quantizedSample(std::sqrt(squared), voxel);
    }
  }
}

}  // namespace tenon
