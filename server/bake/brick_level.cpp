#include "server/bake/brick_level.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/bake/parallel.h"
#include "server/bake/point_block.h"
#include "server/bake/triangle_tree.h"
#include "server/structures/field_builder.h"

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;

/// [voxels] Of a sample, and more than that of the position of a lattice point.
constexpr double kRounding = 0.001;

std::size_t linearIndex(const Cell& cell, const Cell& size) {
  return (static_cast<std::size_t>(cell.z()) * static_cast<std::size_t>(size.y()) +
          static_cast<std::size_t>(cell.y())) *
             static_cast<std::size_t>(size.x()) +
         static_cast<std::size_t>(cell.x());
}

Cell cellOfIndex(std::size_t number, const Cell& size) {
  const auto nx = static_cast<std::size_t>(size.x());
  const auto ny = static_cast<std::size_t>(size.y());
  return {static_cast<int>(number % nx), static_cast<int>(number / nx % ny),
          static_cast<int>(number / nx / ny)};
}

/// Calls visit for the samples of a brick that its neighbour at `brick_offset` (components 0 or 1) owns.
template <typename Visit>
void visitFace(const Cell& brick_offset, Visit&& visit) {
  const Cell from = brick_offset * BrickLevel::kVoxels;
  const Cell to = Cell::Constant(BrickLevel::kVoxels) + brick_offset;
  for (int z = from.z(); z < to.z(); ++z) {
    for (int y = from.y(); y < to.y(); ++y) {
      for (int x = from.x(); x < to.x(); ++x) visit(Cell(x, y, z));
    }
  }
}

/// The largest of the trilinear values at the corners of a brick's child `cell`.
double mostIn(const BrickLevel::CornerDilations& corners, const Cell& cell, int divisions) {
  double most = 0.0;
  for (int child_corner = 0; child_corner < 8; ++child_corner) {
    const Vector3 at =
        (cell + Cell(child_corner & 1, child_corner >> 1 & 1, child_corner >> 2 & 1)).cast<double>() /
        divisions;
    double value = 0.0;
    for (int k = 0; k < 8; ++k) {
      double weight = static_cast<double>(corners[static_cast<std::size_t>(k)]);
      for (int axis = 0; axis < 3; ++axis) weight *= (k >> axis & 1) != 0 ? at[axis] : 1.0 - at[axis];
      value += weight;
    }
    most = std::max(most, value);
  }
  return most;
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

BrickLevel::BrickLevel(const BrickLevel& coarse, int divisions, std::span<const std::uint32_t> refined,
                       std::span<const CornerDilations> dilations)
    : p_MoFo_M(coarse.p_MoFo_M),
      voxel(coarse.voxel / divisions),
      bricks(coarse.bricks * divisions),
      refinement(divisions),
      coarse_bricks_(coarse.bricks),
      block_of_coarse_(coarse.nodes(), -1),
      coarse_of_block_(refined.begin(), refined.end()) {
  for (std::size_t block = 0; block < refined.size(); ++block) {
    block_of_coarse_[refined[block]] = static_cast<std::int32_t>(block);
  }
  slot.assign(refined.size() * childrenOfBlock(), -1);
  free.assign(slot.size(), 0);
  beyond_.reserve(slot.size());
  for (const CornerDilations& corners : dilations) {
    for (std::size_t child = 0; child < childrenOfBlock(); ++child) {
      const double most =
          divisions * mostIn(corners, cellOfIndex(child, Cell::Constant(divisions)), divisions);
      beyond_.push_back(static_cast<float>(std::max(most - structures::DistanceField::kHalfDiagonal, 0.0)));
    }
  }
}

std::int64_t BrickLevel::nodeAt(const Cell& brick) const {
  if (!inside(brick, bricks)) return -1;
  if (refinement == 1) return static_cast<std::int64_t>(linearIndex(brick, bricks));
  const Cell parent = brick / refinement;
  const std::int32_t block = block_of_coarse_[linearIndex(parent, coarse_bricks_)];
  if (block < 0) return -1;
  const Cell size = Cell::Constant(refinement);
  return static_cast<std::int64_t>(static_cast<std::size_t>(block) * static_cast<std::size_t>(size.prod()) +
                                   linearIndex(brick - parent * refinement, size));
}

Cell BrickLevel::brickOf(std::size_t node) const {
  if (refinement == 1) return cellOfIndex(node, bricks);
  const Cell size = Cell::Constant(refinement);
  const auto children = static_cast<std::size_t>(size.prod());
  return cellOfIndex(coarse_of_block_[node / children], coarse_bricks_) * refinement +
         cellOfIndex(node % children, size);
}

BrickLevel::Point BrickLevel::at(const Cell& lattice) const {
  const Cell brick(lattice.x() >> 3, lattice.y() >> 3, lattice.z() >> 3);
  return brickAt(nodeAt(brick)).at(lattice - brick * kVoxels);
}

double BrickLevel::interpolated(std::size_t node, const Vector3& p) const {
  const Cell cell = p.array().floor().cwiseMax(0).cwiseMin(kVoxels - 1).matrix().cast<int>();
  const Vector3 upper = p - cell.cast<double>();
  const std::int16_t* s = samplesOf(slot[node]);
  double distance = 0.0;
  for (int k = 0; k < 8; ++k) {
    const Cell offset(k & 1, k >> 1 & 1, k >> 2 & 1);
    double weight = 1.0;
    for (int axis = 0; axis < 3; ++axis) weight *= offset[axis] != 0 ? upper[axis] : 1.0 - upper[axis];
    distance += weight * s[sampleIndex(cell + offset)];
  }
  return distance / structures::DistanceField::kQuantaPerVoxel;
}

template <typename Visit>
void BrickLevel::visitCopies(const Cell& lattice, Visit&& visit) const {
  const Cell brick(lattice.x() >> 3, lattice.y() >> 3, lattice.z() >> 3);
  const Cell in_brick = lattice - brick * kVoxels;
  for (int part = 0; part < 8; ++part) {
    // lower neighbours contain the lattice points on their upper faces
    const Cell below(part & 1, part >> 1 & 1, part >> 2 & 1);
    if ((in_brick.array() * below.array() > 0).any()) continue;
    const std::int64_t found = nodeAt(brick - below);
    if (found < 0) continue;
    const auto node = static_cast<std::size_t>(found);
    if (slot[node] >= 0 && !visit(node, sampleIndex(in_brick + below * kVoxels))) return;
  }
}

const std::int16_t* BrickLevel::findSample(const Cell& lattice) const {
  const std::int16_t* found = nullptr;
  visitCopies(lattice, [&](std::size_t node, int sample) {
    found = samplesOf(slot[node]) + sample;
    return false;
  });
  return found;
}

void BrickLevel::setSample(const Cell& lattice, std::int16_t value, std::span<std::uint8_t> marks) {
  visitCopies(lattice, [&](std::size_t node, int sample) {
    samplesOf(slot[node])[sample] = value;
    marks[node] = 1;
    return true;
  });
}

std::size_t BrickLevel::sampleDistances(const TriangleTree& tree, std::size_t most, ParallelWork& work) {
  // other bricks have no sample in the band
  std::vector<std::uint8_t> candidate(nodes(), 0);
  work.run(nodes(), 1024, [&](std::size_t node) {
    candidate[node] = tree.maybeNear(centreOf(node), (kVoxels / 2 + kRounding) * voxel, bandOf(node) * voxel);
  });
  std::vector<std::uint32_t> of_slot;
  for (std::size_t node = 0; node < nodes(); ++node) {
    if (candidate[node] == 0) continue;
    slot[node] = static_cast<std::int32_t>(of_slot.size());
    of_slot.push_back(static_cast<std::uint32_t>(node));
  }
  if (of_slot.size() > most) return of_slot.size();
  samples.resize(of_slot.size() * kSamples);
  work.run(of_slot.size(), 64, [&](std::size_t s) {
    const std::uint32_t node = of_slot[s];
    sampleBrick(node, tree, ownSamples(node));
  });
  work.run(of_slot.size(), 1024, [&](std::size_t s) { copyApron(of_slot[s]); });
  for (std::size_t s = 0; s < of_slot.size() && !work.cancelled(); ++s) {
    const std::int16_t* own = samplesOf(static_cast<std::int32_t>(s));
    const auto band =
        static_cast<std::int16_t>(bandOf(of_slot[s]) * structures::DistanceField::kQuantaPerVoxel);
    if (*std::min_element(own, own + kSamples) >= band) slot[of_slot[s]] = -1;
  }
  return of_slot.size();
}

BrickLevel::SampleBits BrickLevel::ownSamples(std::size_t node) const {
  SampleBits own;
  const Cell brick = brickOf(node);
  for (int face = 0; face < 8; ++face) {
    const Cell brick_offset(face & 1, face >> 1 & 1, face >> 2 & 1);
    const std::int64_t neighbour = nodeAt(brick + brick_offset);
    if (face > 0 && neighbour >= 0 && slot[static_cast<std::size_t>(neighbour)] >= 0) continue;
    visitFace(brick_offset,
              [&](const Cell& in_brick) { own.set(static_cast<std::size_t>(sampleIndex(in_brick))); });
  }
  return own;
}

void BrickLevel::copyApron(std::size_t node) {
  const Cell brick = brickOf(node);
  std::int16_t* to = samplesOf(slot[node]);
  for (int face = 1; face < 8; ++face) {
    const Cell brick_offset(face & 1, face >> 1 & 1, face >> 2 & 1);
    const std::int64_t neighbour = nodeAt(brick + brick_offset);
    if (neighbour < 0 || slot[static_cast<std::size_t>(neighbour)] < 0) continue;
    const std::int16_t* from = samplesOf(slot[static_cast<std::size_t>(neighbour)]);
    visitFace(brick_offset, [&](const Cell& in_brick) {
      to[sampleIndex(in_brick)] = from[sampleIndex(in_brick - brick_offset * kVoxels)];
    });
  }
}

void BrickLevel::sampleBrick(std::size_t node, const TriangleTree& tree, const SampleBits& which) {
  if (which.none()) return;
  const Cell corner = brickOf(node) * kVoxels;
  std::int16_t* out = samplesOf(slot[node]);
  const double clamp = clampOf(node);
  constexpr double kBlockRadius = 2.5981;  // [voxels] from the middle of 4^3 samples to a corner
  TriangleTree::Search search(tree, centreOf(node), kBrickRadius * voxel, (clamp + kBlockRadius) * voxel);
  const std::int16_t clamped = structures::quantizedSample(clamp * voxel, voxel, clamp);
  const double squared_clamp = clamp * voxel * (clamp * voxel);
  PointBlock block;
  std::array<std::size_t, PointBlock::kMost> numbers;
  forEachBlock([&](const Cell& from, const Cell& to) {
    block.clear();
    forEachSample(from, to, [&](int sample, const Cell& in_brick) {
      if (!which[static_cast<std::size_t>(sample)]) return;
      numbers[block.size()] = static_cast<std::size_t>(sample);
      block.add(position(corner + in_brick), squared_clamp);
    });
    if (block.size() == 0) return;
    const bool near = search.focus(middleOf(corner + from, corner + to), radiusOf(from, to), clamp * voxel);
    if (near) {
      block.finish();
      search.lower(block);
    }
    for (std::size_t i = 0; i < block.size(); ++i)
      out[numbers[i]] =
          near ? structures::quantizedSample(std::sqrt(block.squared(i)), voxel, clamp) : clamped;
  });
}

}  // namespace tenon::bake
