#include "server/bake/exposed_surface.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/bake/parallel.h"

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;
// [voxels] A surface point is exposed when the empty ball around an outside sample comes this near to it:
// enough for concave corners, where no ball reaches the edge itself.
constexpr double kTouch = 0.6;
// [voxels] Longest edge of pieces that are tested against a single empty ball, and against a hidden box.
constexpr double kMaxEdgeForBall = 5.0;
constexpr double kMaxEdgeForBox = 12.0;
constexpr std::size_t kChunk = 4096;

enum class Exposure { kUnknown, kHidden, kExposed };

constexpr int kVoxels = BrickLevel::kVoxels;
constexpr int kCellSide = kVoxels + 3;  // a brick's cells reach one lattice point below and two above

/// The 4^3 lattice points around a cell, its own corners first: these usually decide.
const std::array<Cell, 64> kAround = [] {
  std::array<Cell, 64> around;
  constexpr std::array kOrder{0, 1, -1, 2};
  for (int k = 0; k < 64; ++k) {
    around[static_cast<std::size_t>(k)] = Cell(kOrder[static_cast<std::size_t>((k & 1) | (k >> 2 & 2))],
                                               kOrder[static_cast<std::size_t>((k >> 1 & 1) | (k >> 3 & 2))],
                                               kOrder[static_cast<std::size_t>((k >> 2 & 1) | (k >> 4 & 2))]);
  }
  return around;
}();

/// For each cell of a level, whether one of the 4^3 lattice points around it is free.
class CellMap {
 public:
  CellMap(const BrickLevel& level, ParallelWork& work) : level_(level), near_(level.outside.size()) {
    work.run(level.nodes(), 256, [&](std::size_t node) {
      if (level.slot[node] >= 0) near_[static_cast<std::size_t>(level.slot[node])] = nearOutside(node);
    });
  }

  [[nodiscard]] const BrickLevel& level() const { return level_; }

  [[nodiscard]] Exposure exposureOf(const Vector3& p_MP) const {
    const Cell cell = level_.cellAt(p_MP);
    const Cell brick = cell / kVoxels;
    const std::int64_t node = level_.nodeAt(brick);
    if (node < 0) return Exposure::kUnknown;
    const Cell in_brick = cell - brick * kVoxels;
    const std::int32_t slot = level_.slot[static_cast<std::size_t>(node)];
    if (slot >= 0) {
      const std::uint64_t word =
          near_[static_cast<std::size_t>(slot)][static_cast<std::size_t>(in_brick.z())];
      const auto bit = static_cast<unsigned>(in_brick.y() * kVoxels + in_brick.x());
      if ((word >> bit & 1U) == 0) return Exposure::kHidden;
    }
    return exposureFromNeighbours(p_MP, cell, brick, node);
  }

  /// Whether no cell of a box has a free lattice point around it.
  [[nodiscard]] bool hides(const Eigen::AlignedBox3d& box_M) const {
    const Cell low = level_.cellAt(box_M.min());
    const Cell high = level_.cellAt(box_M.max());
    const Cell first = low / kVoxels;
    const Cell last = high / kVoxels;
    for (int z = first.z(); z <= last.z(); ++z) {
      for (int y = first.y(); y <= last.y(); ++y) {
        for (int x = first.x(); x <= last.x(); ++x) {
          const Cell corner = Cell(x, y, z) * kVoxels;
          const std::int64_t node = level_.nodeAt({x, y, z});
          if (node < 0 || level_.slot[static_cast<std::size_t>(node)] < 0) return false;
          const auto slot = static_cast<std::size_t>(level_.slot[static_cast<std::size_t>(node)]);
          const Cell from = (low - corner).cwiseMax(0);
          const Cell to = (high - corner).cwiseMin(kVoxels - 1);
          const std::uint64_t row = (0xFFULL >> static_cast<unsigned>(7 - to.x() + from.x()))
                                    << static_cast<unsigned>(from.x());
          std::uint64_t layer = 0;
          for (int i = from.y(); i <= to.y(); ++i) layer |= row << static_cast<unsigned>(i * kVoxels);
          for (int i = from.z(); i <= to.z(); ++i) {
            if ((near_[slot][static_cast<std::size_t>(i)] & layer) != 0) return false;
          }
        }
      }
    }
    return true;
  }

 private:
  [[nodiscard]] BrickLevel::Mask nearOutside(std::size_t node) const {
    // one word per row of lattice points along x; a point outside this level counts as free
    std::array<std::uint32_t, static_cast<std::size_t>(kCellSide) * kCellSide> rows{};
    level_.visitAround(node, 1, 2, [&](const Cell& offset, const BrickLevel::Point& point) {
      const bool free = point.free || !point.known;
      rows[static_cast<std::size_t>((offset.z() + 1) * kCellSide + offset.y() + 1)] |=
          static_cast<std::uint32_t>(free) << static_cast<unsigned>(offset.x() + 1);
    });
    BrickLevel::Mask near{};
    for (int z = 0; z < kVoxels; ++z) {
      for (int y = 0; y < kVoxels; ++y) {
        std::uint32_t row = 0;
        for (int k = 0; k < 16; ++k) {
          row |= rows[static_cast<std::size_t>((z + k / 4) * kCellSide + y + k % 4)];
        }
        const std::uint64_t cells = (row | row >> 1U | row >> 2U | row >> 3U) & 0xFFU;
        near[static_cast<std::size_t>(z)] |= cells << static_cast<unsigned>(y * kVoxels);
      }
    }
    return near;
  }

  [[nodiscard]] Exposure exposureFromNeighbours(const Vector3& p_MP, const Cell& cell, const Cell& brick,
                                                std::int64_t node) const {
    const Vector3 p_cell = (p_MP - level_.p_MoFo_M) / level_.voxel - cell.cast<double>();
    const Cell in_brick = cell - brick * kVoxels;
    const std::int32_t slot = level_.slot[static_cast<std::size_t>(node)];
    const std::int16_t* samples = slot < 0 ? nullptr : level_.samplesOf(slot);
    bool all_known = true;
    Cell looked_up = brick;
    BrickLevel::BrickState state = level_.brickAt(node);
    for (const Cell& offset : kAround) {
      const Cell in_samples = in_brick + offset;
      double distance = 0.0;
      if (samples != nullptr && in_samples.minCoeff() >= 0 && in_samples.maxCoeff() < BrickLevel::kSide) {
        const int sample = BrickLevel::sampleIndex(in_samples);
        if (!level_.outside[static_cast<std::size_t>(slot)][static_cast<std::size_t>(sample)]) continue;
        distance = samples[sample] / double{structures::DistanceField::kQuantaPerVoxel};
      } else {
        const Cell lattice = cell + offset;
        const Cell neighbour(lattice.x() >> 3, lattice.y() >> 3, lattice.z() >> 3);
        if (neighbour != looked_up) {
          looked_up = neighbour;
          state = level_.brickAt(level_.nodeAt(neighbour));
        }
        const BrickLevel::Point point = state.at(lattice - neighbour * kVoxels);
        all_known = all_known && point.known;
        if (!point.free || !point.known) continue;
        distance = point.distance;
      }
      const double reach = distance + kTouch;
      if ((offset.cast<double>() - p_cell).squaredNorm() <= reach * reach) return Exposure::kExposed;
    }
    return all_known ? Exposure::kHidden : Exposure::kUnknown;
  }

  const BrickLevel& level_;
  std::vector<BrickLevel::Mask> near_;
};

/// Splits triangles into exposed and hidden pieces.
class ExposureSplitter {
 public:
  ExposureSplitter(const CellMap& coarse, const CellMap* fine) : coarse_(coarse), fine_(fine) {}

  enum class Exposed { kAll, kNone, kSome };

  /// With kSome, `pieces` contains the exposed parts of the triangle, and `hidden` the others.
  Exposed exposedPart(const structures::Triangle& t, std::vector<structures::Triangle>& pieces,
                      std::vector<structures::Triangle>& hidden) {
    std::size_t from = 0;
    const double length = structures::longestEdge(t, from);
    const Vector3 centre = (t[0] + t[1] + t[2]) / 3.0;
    const CellMap& map = mapAt(centre);
    const BrickLevel& level = map.level();
    if (length <= level.voxel) return isExposed(centre) ? Exposed::kAll : Exposed::kNone;
    if (length <= kMaxEdgeForBall * level.voxel && inEmptyBall(level, t, centre)) return Exposed::kAll;
    if (length <= kMaxEdgeForBox * level.voxel && map.hides(structures::boxOf(t))) return Exposed::kNone;

    const auto [first, second] = structures::bisected(t, from);
    const Exposed of_first = exposedPart(first, pieces, hidden);
    const Exposed of_second = exposedPart(second, pieces, hidden);
    if (of_first == of_second && of_first != Exposed::kSome) return of_first;
    if (of_first != Exposed::kSome) (of_first == Exposed::kAll ? pieces : hidden).push_back(first);
    if (of_second != Exposed::kSome) (of_second == Exposed::kAll ? pieces : hidden).push_back(second);
    return Exposed::kSome;
  }

 private:
  /// Whether one empty ball, enlarged by kTouch, contains the whole piece: balls are convex, so its corners
  /// suffice.
  [[nodiscard]] bool inEmptyBall(const BrickLevel& level, const structures::Triangle& t,
                                 const Vector3& centre) {
    const auto contains = [&t](const Ball& ball) {
      return std::all_of(t.begin(), t.end(), [&ball](const Vector3& corner) {
        return (corner - ball.centre).squaredNorm() <= ball.squared_radius;
      });
    };
    // neighbouring pieces are usually in the same ball
    if (contains(last_)) return true;
    const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
    if (!normal.allFinite()) return false;
    const Vector3 half = Vector3::Constant(level.voxel / 2);
    for (const double height : {5.0, -5.0, 2.5, -2.5}) {
      const Cell lattice = level.cellAt(centre + normal * (height * level.voxel) + half);
      const BrickLevel::Point point = level.at(lattice);
      if (!point.known || !point.free) continue;
      const double radius = (point.distance + kTouch) * level.voxel;
      const Ball ball{level.position(lattice), radius * radius};
      if (!contains(ball)) continue;
      last_ = ball;
      return true;
    }
    return false;
  }

  [[nodiscard]] const CellMap& mapAt(const Vector3& p) const {
    if (fine_ == nullptr) return coarse_;
    const BrickLevel& fine = fine_->level();
    return fine.nodeAt(fine.cellAt(p) / kVoxels) >= 0 ? *fine_ : coarse_;
  }
  [[nodiscard]] bool isExposed(const Vector3& p) const {
    if (fine_ != nullptr) {
      const Exposure exposure = fine_->exposureOf(p);
      if (exposure != Exposure::kUnknown) return exposure == Exposure::kExposed;
    }
    return coarse_.exposureOf(p) == Exposure::kExposed;
  }

  struct Ball {
    Vector3 centre = Vector3::Zero();
    double squared_radius = -1.0;
  };
  const CellMap& coarse_;
  const CellMap* fine_;
  Ball last_;
};

}  // namespace

ExposedSurface::ExposedSurface(std::span<const structures::Triangle> triangles, const BrickLevel& coarse,
                               const BrickLevel* fine, ParallelWork& work)
    : triangles_(triangles), state_(triangles.size(), kWhole) {
  // pieces are collected by chunk and numbered afterwards, so that their order does not depend on threads
  struct SplitTriangle {
    std::uint32_t triangle;
    std::vector<structures::Triangle> pieces;
  };
  std::vector<std::vector<SplitTriangle>> splits((triangles.size() + kChunk - 1) / kChunk);
  std::vector<std::vector<HiddenPart>> hidden(splits.size());
  const CellMap coarse_map(coarse, work);
  std::optional<CellMap> fine_map;
  if (fine != nullptr) fine_map.emplace(*fine, work);
  work.run(splits.size(), 1, [&](std::size_t chunk) {
    ExposureSplitter splitter(coarse_map, fine_map ? &*fine_map : nullptr);
    const std::size_t end = std::min(triangles.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      std::vector<structures::Triangle> pieces;
      std::vector<structures::Triangle> others;
      const ExposureSplitter::Exposed part = splitter.exposedPart(triangles[i], pieces, others);
      if (part == ExposureSplitter::Exposed::kNone) {
        state_[i] = kHidden;
        others = {triangles[i]};
      }
      for (const structures::Triangle& other : others)
        hidden[chunk].push_back({other, static_cast<std::uint32_t>(i)});
      if (part == ExposureSplitter::Exposed::kSome)
        splits[chunk].push_back({static_cast<std::uint32_t>(i), std::move(pieces)});
    }
  });
  for (const auto& chunk : hidden) hidden_.insert(hidden_.end(), chunk.begin(), chunk.end());
  for (auto& chunk : splits) {
    for (SplitTriangle& split : chunk) {
      state_[split.triangle] = static_cast<std::uint32_t>(pieces_.size());
      pieces_.push_back(std::move(split.pieces));
    }
  }
}

std::span<const structures::Triangle> ExposedSurface::of(std::uint32_t i) const {
  if (state_[i] == kWhole) return triangles_.subspan(i, 1);
  if (state_[i] == kHidden) return {};
  return pieces_[state_[i]];
}

std::vector<structures::Triangle> ExposedSurface::all() const {
  std::vector<structures::Triangle> surface;
  for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
    const auto exposed = of(i);
    surface.insert(surface.end(), exposed.begin(), exposed.end());
  }
  return surface;
}

}  // namespace tenon::bake
