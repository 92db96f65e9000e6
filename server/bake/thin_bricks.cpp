#include "server/bake/thin_bricks.h"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "server/bake/parallel.h"

namespace tenon::bake {

namespace {

constexpr int kMargin = 2;
/// [voxels] kMargin beyond a sample at a flat surface a solid is at least 1.13 deep.
constexpr double kDeep = 1.05;
constexpr int kPatchSide = BrickLevel::kSide + 2 * kMargin;
using Patch = std::array<std::uint8_t, static_cast<std::size_t>(kPatchSide) * kPatchSide * kPatchSide>;

constexpr std::size_t indexOf(int x, int y, int z) {
  return static_cast<std::size_t>((z * kPatchSide + y) * kPatchSide + x);
}

/// Spreads marks by kMargin along an axis; `stride` is that between its neighbours.
void spread(Patch& patch, std::size_t stride) {
  Patch wide = patch;
  for (std::size_t shift = stride; shift <= kMargin * stride; shift += stride) {
    for (std::size_t i = shift; i < patch.size(); ++i) {
      // marks that wrap around end in the margin, which is not read
      wide[i] |= patch[i - shift];
      wide[i - shift] |= patch[i];
    }
  }
  patch = wide;
}

bool isThin(const BrickLevel& coarse, std::size_t node) {
  const std::int32_t slot = coarse.slot[node];
  if (slot < 0) return false;
  constexpr int kAtSurface =
      static_cast<int>(structures::DistanceField::kHalfDiagonal * structures::DistanceField::kQuantaPerVoxel);
  const auto at_surface = [](int sample) { return std::abs(sample) <= kAtSurface; };
  const std::int16_t* samples = coarse.samplesOf(slot);
  if (std::none_of(samples, samples + BrickLevel::kSamples, at_surface)) return false;
  Patch deep{};
  coarse.visitAround(node, kMargin, kMargin + 1, [&](const BrickLevel::Cell& offset, const auto& point) {
    deep[indexOf(offset.x() + kMargin, offset.y() + kMargin, offset.z() + kMargin)] =
        point.known && !point.free && point.distance >= kDeep;
  });
  for (const std::size_t stride : {indexOf(1, 0, 0), indexOf(0, 1, 0), indexOf(0, 0, 1)})
    spread(deep, stride);
  for (int k = 0; k < BrickLevel::kSamples; ++k) {
    if (!at_surface(samples[k])) continue;
    const BrickLevel::Cell at = BrickLevel::cellOfSample(k) + BrickLevel::Cell::Constant(kMargin);
    if (deep[indexOf(at.x(), at.y(), at.z())] == 0) return true;
  }
  return false;
}

}  // namespace

bool BrickMarks::anyIn(const Eigen::AlignedBox3d& box_M) const {
  const BrickLevel::Cell low = brickAt(box_M.min());
  const BrickLevel::Cell high = brickAt(box_M.max());
  constexpr double kMany = 1000.0;
  if ((high - low + BrickLevel::Cell::Ones()).cast<double>().prod() > kMany) return true;
  for (int z = low.z(); z <= high.z(); ++z) {
    for (int y = low.y(); y <= high.y(); ++y) {
      for (int x = low.x(); x <= high.x(); ++x) {
        if (marks_[nodeOf({x, y, z})] != 0) return true;
      }
    }
  }
  return false;
}

BrickMarks thinBricks(const BrickLevel& coarse, ParallelWork& work) {
  std::vector<std::uint8_t> thin(coarse.nodes(), 0);
  work.run(coarse.nodes(), 64, [&](std::size_t node) { thin[node] = isThin(coarse, node) ? 1 : 0; });
  return {coarse, std::move(thin)};
}

}  // namespace tenon::bake
