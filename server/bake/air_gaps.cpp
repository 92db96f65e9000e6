#include "server/bake/air_gaps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "server/bake/parallel.h"
#include "server/bake/triangle_pieces.h"
#include "server/bake/triangle_tree.h"

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;
using structures::Triangle;

constexpr double kPiece = 2.5;       // [voxels] edge of a piece of the surface, which is asked at its centre
constexpr double kWidest = 2.0;      // [voxels]
constexpr double kNone = 0.97;       // [voxels]
constexpr double kFacing = 0.5;      // [-] least cosine between the normals of a gap's surfaces
constexpr double kStart = 0.1;       // [narrowest gaps] above its piece a gap is measured
constexpr double kCertain = 0.1;     // [voxels] A sample nearer to the surface may be on either side.
constexpr std::size_t kSamples = 2;  // to which lines are tried
constexpr int kMaxLines = 6;         // to other gaps, of a gap that is not known to be air

/// Between a point of the surface and the next surface along its normal.
struct Gap {
  Vector3 p_MC;      // the middle
  Vector3 across_M;  // from the middle to the next surface
  int lines = 0;     // that were tried
  bool air = false;
};

class GapFinder {
 public:
  GapFinder(const BrickLevel& coarse, const TriangleTree& tree, double narrowest)
      : coarse_(coarse), tree_(tree), narrowest_(narrowest) {}

  void collect(std::span<const Triangle> triangles, ParallelWork& work) {
    constexpr std::size_t kChunk = 64;
    std::vector<std::vector<Gap>> found((triangles.size() + kChunk - 1) / kChunk);
    work.run(found.size(), 1, [&](std::size_t chunk) {
      const std::size_t end = std::min(triangles.size(), (chunk + 1) * kChunk);
      for (std::size_t i = chunk * kChunk; i < end; ++i) collectAt(triangles[i], found[chunk]);
    });
    for (const std::vector<Gap>& gaps : found) gaps_.insert(gaps_.end(), gaps.begin(), gaps.end());
  }

  /// From gaps that are air to those that they see.
  void spread() {
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> unknown;
    std::vector<std::uint32_t> next;
    for (std::uint32_t i = 0; i < gaps_.size(); ++i) {
      if (gaps_[i].air) {
        next.push_back(i);
      } else {
        unknown[keyOf(placeOf(gaps_[i]))].push_back(i);
      }
    }
    while (!next.empty()) {
      const Gap from = gaps_[next.back()];
      next.pop_back();
      const Cell cell = placeOf(from);
      for (int k = 0; k < 27; ++k) {
        const auto near = unknown.find(keyOf(cell + Cell(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
        if (near == unknown.end()) continue;
        std::erase_if(near->second, [&](std::uint32_t i) {
          Gap& to = gaps_[i];
          if (to.lines >= kMaxLines || !sees(from, to)) return false;
          to.air = true;
          next.push_back(i);
          return true;
        });
      }
    }
  }

  [[nodiscard]] std::vector<AirGap> gaps() const {
    std::unordered_map<std::uint32_t, AirGap> by_brick;
    for (const Gap& gap : gaps_) {
      if (!gap.air) continue;
      const double width = 2.0 * gap.across_M.norm();
      // both walls may be in other bricks than the middle
      for (const double side : {-1.0, 0.0, 1.0}) {
        const Cell cell = coarse_.cellAt(gap.p_MC + side * gap.across_M);
        const std::int64_t node = coarse_.nodeAt({cell.x() >> 3, cell.y() >> 3, cell.z() >> 3});
        if (node < 0) continue;
        const auto brick = static_cast<std::uint32_t>(node);
        AirGap& narrowest = by_brick.try_emplace(brick, AirGap{brick, width, gap.p_MC}).first->second;
        if (width < narrowest.width) narrowest = {brick, width, gap.p_MC};
      }
    }
    std::vector<AirGap> gaps;
    gaps.reserve(by_brick.size());
    for (const auto& [brick, gap] : by_brick) gaps.push_back(gap);
    std::sort(gaps.begin(), gaps.end(), [](const AirGap& a, const AirGap& b) {
      return a.width != b.width ? a.width < b.width : a.brick < b.brick;
    });
    return gaps;
  }

 private:
  /// The cube of two voxels that its middle is in: longer than a piece is wide.
  [[nodiscard]] Cell placeOf(const Gap& gap) const {
    const Cell cell = coarse_.cellAt(gap.p_MC);
    return {cell.x() >> 1, cell.y() >> 1, cell.z() >> 1};
  }
  [[nodiscard]] static std::uint64_t keyOf(const Cell& cell) {
    constexpr std::uint64_t kMask = (1U << 21U) - 1U;
    return (static_cast<std::uint64_t>(cell.x()) & kMask) |
           (static_cast<std::uint64_t>(cell.y()) & kMask) << 21U |
           (static_cast<std::uint64_t>(cell.z()) & kMask) << 42U;
  }

  void collectAt(const Triangle& t, std::vector<Gap>& found) const {
    const Vector3 normal_M = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
    if (!normal_M.allFinite()) return;
    const auto fits = [&](const Vector3&, double length) { return length <= kPiece * coarse_.voxel; };
    forEachPiece(t, fits, [&](const Vector3& p, double) {
      for (const double side : {1.0, -1.0}) {
        // at half the width of the widest gap, no surface is nearer than p: there is none
        if (distanceAt(p + side * coarse_.voxel * normal_M) >= kNone) continue;
        const Vector3 start = p + kStart * side * narrowest_ * normal_M;
        const Vector3 along = kWidest * side * coarse_.voxel * normal_M;
        const TriangleTree::Intersection next = tree_.firstIntersection(start, along);
        if (next.triangle == nullptr) continue;
        const Vector3 p_MQ = start + next.fraction * along;
        const double width = (p_MQ - p).norm();
        if (width < narrowest_ || width >= kWidest * coarse_.voxel || !faces(normal_M, *next.triangle))
          continue;
        Gap gap{0.5 * (p + p_MQ), 0.5 * (p_MQ - p)};
        gap.air = seesOutside(gap);
        found.push_back(gap);
      }
    });
  }

  /// [voxels] The interpolated unsigned distance, up to the band.
  [[nodiscard]] double distanceAt(const Vector3& p_MP) const {
    const Cell cell = coarse_.cellAt(p_MP);
    const Cell brick(cell.x() >> 3, cell.y() >> 3, cell.z() >> 3);
    const std::int64_t node = coarse_.nodeAt(brick);
    const std::int32_t slot = node < 0 ? -1 : coarse_.slot[static_cast<std::size_t>(node)];
    if (slot < 0) return structures::DistanceField::kBandVoxels;
    const Vector3 p_brick = (p_MP - coarse_.position(brick * BrickLevel::kVoxels)) / coarse_.voxel;
    return coarse_.interpolated(static_cast<std::size_t>(node), p_brick);
  }

  static bool faces(const Vector3& normal_M, const Triangle& t) {
    const Vector3 other = (t[1] - t[0]).cross(t[2] - t[0]);
    return std::abs(normal_M.dot(other)) >= kFacing * other.norm();
  }

  /// Whether a sample at the corners of the middle's cell is outside, and no surface is between: the two that
  /// are least high above the middle are asked.
  [[nodiscard]] bool seesOutside(const Gap& gap) const {
    const Cell cell = coarse_.cellAt(gap.p_MC);
    std::array<std::pair<double, Vector3>, 8> lines;
    std::size_t count = 0;
    for (int k = 0; k < 8; ++k) {
      const Cell lattice = cell + Cell(k & 1, k >> 1 & 1, k >> 2 & 1);
      const BrickLevel::Point point = coarse_.at(lattice);
      if (!point.known || !point.free || point.distance < kCertain) continue;
      const Vector3 away = coarse_.position(lattice) - gap.p_MC;
      const double radius = (point.distance - 1e-3) * coarse_.voxel;
      if (away.squaredNorm() < radius * radius) return true;
      lines[count++] = {std::abs(away.dot(gap.across_M)), away};
    }
    const auto end = lines.begin() + static_cast<std::ptrdiff_t>(count);
    std::stable_sort(lines.begin(), end, [](const auto& a, const auto& b) { return a.first < b.first; });
    return std::any_of(
        lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(std::min(count, kSamples)),
        [&](const auto& line) { return tree_.firstIntersection(gap.p_MC, line.second).triangle == nullptr; });
  }

  /// Whether no surface is between two gaps, each of which is about as high as the other.
  [[nodiscard]] bool sees(const Gap& from, Gap& to) const {
    const Vector3 away = to.p_MC - from.p_MC;
    if (std::abs(away.dot(from.across_M)) > from.across_M.squaredNorm() ||
        std::abs(away.dot(to.across_M)) > to.across_M.squaredNorm())
      return false;
    ++to.lines;
    return tree_.firstIntersection(from.p_MC, away).triangle == nullptr;
  }

  const BrickLevel& coarse_;
  const TriangleTree& tree_;
  const double narrowest_;  // [m]
  std::vector<Gap> gaps_;
};

}  // namespace

std::vector<AirGap> findAirGaps(const BrickLevel& coarse, std::span<const Triangle> triangles,
                                const TriangleTree& tree, double narrowest, ParallelWork& work) {
  GapFinder finder(coarse, tree, narrowest);
  finder.collect(triangles, work);
  finder.spread();
  return finder.gaps();
}

}  // namespace tenon::bake
