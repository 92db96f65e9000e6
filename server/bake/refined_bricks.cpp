#include "server/bake/refined_bricks.h"

#include <algorithm>

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;

bool hasSurface(const BrickLevel& coarse, std::size_t node) {
  const std::int32_t slot = coarse.slot[node];
  if (slot < 0) return false;
  constexpr int kCentre = (4 * BrickLevel::kSide + 4) * BrickLevel::kSide + 4;
  const std::int16_t* s = coarse.samplesOf(slot);
  const double at_centre = s[kCentre] / double{structures::DistanceField::kQuantaPerVoxel};
  if (at_centre < std::min(BrickLevel::kBrickRadius, structures::DistanceField::kClampVoxels)) return true;
  // clamped at the centre: the surface is at a corner or not in the brick at all
  return *std::min_element(s, s + BrickLevel::kSamples) <= structures::DistanceField::kQuantaPerVoxel;
}

}  // namespace

RefinedBricks bricksToRefine(const BrickLevel& coarse, const BakeOptions& options, const BrickMarks& thin) {
  RefinedBricks refined;
  if (options.refinement <= 1) return refined;
  enum Mark : std::uint8_t { kNot, kWanted, kDeep };
  std::vector<std::uint8_t> marks(coarse.nodes(), kNot);
  const double edge = coarse.voxel * BrickLevel::kVoxels;
  for (std::size_t node = 0; node < coarse.nodes(); ++node) {
    const Vector3 p_MBo = coarse.position(coarse.brickOf(node) * BrickLevel::kVoxels);
    const Eigen::AlignedBox3d box(p_MBo, p_MBo + Vector3::Constant(edge));
    const bool wanted = std::any_of(options.refine.begin(), options.refine.end(),
                                    [&box](const RefineBox& region) { return region.box_M.intersects(box); });
    if (wanted && hasSurface(coarse, node)) marks[node] = kWanted;
  }
  for (std::size_t node = 0; node < coarse.nodes(); ++node) {
    if (marks[node] != kWanted) continue;
    for (int k = 0; k < 27; ++k) {
      const std::int64_t next =
          coarse.nodeAt(coarse.brickOf(node) + Cell(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
      if (next < 0) continue;
      const auto neighbour = static_cast<std::size_t>(next);
      if (marks[neighbour] == kNot && thin[neighbour] && hasSurface(coarse, neighbour))
        marks[neighbour] = kDeep;
    }
  }
  for (std::size_t node = 0; node < coarse.nodes(); ++node) {
    if (marks[node] == kNot) continue;
    refined.bricks.push_back(static_cast<std::uint32_t>(node));
    refined.deep.push_back(marks[node] == kDeep ? 1 : 0);
  }
  return refined;
}

}  // namespace tenon::bake
