#include "server/bake/exposed_surface.h"

#include <cmath>

#include "server/bake/parallel.h"

namespace tenon {

namespace {

using Cell = BrickLevel::Cell;
// A place of the surface is exposed when an empty ball about an outside sample comes this near to it
// [voxels]: enough for concave corners, where no ball reaches the edge itself.
constexpr double kTouch = 0.6;
constexpr std::size_t kChunk = 4096;

enum class Exposure { kUnknown, kHidden, kExposed };

Exposure exposureIn(const BrickLevel& level, const Vector3& p_MP) {
  const Cell cell = level.cellAt(p_MP);
  bool all_known = true;
  for (int k = 0; k < 64; ++k) {
    // the cell's own corners first: mostly one of them tells
    constexpr std::array kOrder{0, 1, -1, 2};
    const Cell lattice = cell + Cell(kOrder[static_cast<std::size_t>((k & 1) | (k >> 2 & 2))],
                                     kOrder[static_cast<std::size_t>((k >> 1 & 1) | (k >> 3 & 2))],
                                     kOrder[static_cast<std::size_t>((k >> 2 & 1) | (k >> 4 & 2))]);
    const BrickLevel::Point point = level.at(lattice);
    all_known = all_known && point.known;
    if (!point.free || !point.known) continue;
    const double away = (level.position(lattice) - p_MP).norm() / level.voxel;
    if (away <= point.distance + kTouch) return Exposure::kExposed;
  }
  return all_known ? Exposure::kHidden : Exposure::kUnknown;
}

/// Sorts the pieces of one triangle.
class Cutter {
 public:
  Cutter(const BrickLevel& coarse, const BrickLevel* fine) : coarse_(coarse), fine_(fine) {}

  enum class Part { kAll, kNone, kSome };

  Part exposedPart(const Triangle& t, std::vector<Triangle>& pieces) const {
    int longest = 0;
    double squared = 0.0;
    for (int edge = 0; edge < 3; ++edge) {
      const double length =
          (t[static_cast<std::size_t>((edge + 1) % 3)] - t[static_cast<std::size_t>(edge)]).squaredNorm();
      if (length > squared) {
        squared = length;
        longest = edge;
      }
    }
    const Vector3 centre = (t[0] + t[1] + t[2]) / 3.0;
    const double voxel = voxelAt(centre);
    if (squared <= voxel * voxel) return isExposed(centre) ? Part::kAll : Part::kNone;

    const auto a = static_cast<std::size_t>(longest);
    const std::size_t b = (a + 1) % 3;
    const Vector3 middle = (t[a] + t[b]) / 2;
    Triangle first = t;
    Triangle second = t;
    first[b] = middle;
    second[a] = middle;
    const Part of_first = exposedPart(first, pieces);
    const Part of_second = exposedPart(second, pieces);
    if (of_first == of_second && of_first != Part::kSome) return of_first;
    if (of_first == Part::kAll) pieces.push_back(first);
    if (of_second == Part::kAll) pieces.push_back(second);
    return Part::kSome;
  }

 private:
  [[nodiscard]] double voxelAt(const Vector3& p) const {
    const bool in_fine = fine_ != nullptr && fine_->at(fine_->cellAt(p)).known;
    return in_fine ? fine_->voxel : coarse_.voxel;
  }
  [[nodiscard]] bool isExposed(const Vector3& p) const {
    if (fine_ != nullptr) {
      const Exposure exposure = exposureIn(*fine_, p);
      if (exposure != Exposure::kUnknown) return exposure == Exposure::kExposed;
    }
    return exposureIn(coarse_, p) == Exposure::kExposed;
  }

  const BrickLevel& coarse_;
  const BrickLevel* fine_;
};

}  // namespace

ExposedSurface::ExposedSurface(std::span<const Triangle> triangles, const BrickLevel& coarse,
                               const BrickLevel* fine, ParallelWork& work)
    : triangles_(triangles), state_(triangles.size(), kWhole) {
  // pieces are collected by chunk and numbered afterwards, so that threads leave no trace in the order
  struct Cut {
    std::uint32_t triangle;
    std::vector<Triangle> pieces;
  };
  std::vector<std::vector<Cut>> cuts((triangles.size() + kChunk - 1) / kChunk);
  const Cutter cutter(coarse, fine);
  work.run(cuts.size(), 1, [&](std::size_t chunk) {
    const std::size_t end = std::min(triangles.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      std::vector<Triangle> pieces;
      const Cutter::Part part = cutter.exposedPart(triangles[i], pieces);
      if (part == Cutter::Part::kNone) state_[i] = kHidden;
      if (part == Cutter::Part::kSome)
        cuts[chunk].push_back({static_cast<std::uint32_t>(i), std::move(pieces)});
    }
  });
  for (auto& chunk : cuts) {
    for (Cut& cut : chunk) {
      state_[cut.triangle] = static_cast<std::uint32_t>(pieces_.size());
      pieces_.push_back(std::move(cut.pieces));
    }
  }
}

std::span<const Triangle> ExposedSurface::of(std::uint32_t i) const {
  if (state_[i] == kWhole) return triangles_.subspan(i, 1);
  if (state_[i] == kHidden) return {};
  return pieces_[state_[i]];
}

std::vector<Triangle> ExposedSurface::all() const {
  std::vector<Triangle> surface;
  for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
    const auto left = of(i);
    surface.insert(surface.end(), left.begin(), left.end());
  }
  return surface;
}

}  // namespace tenon
