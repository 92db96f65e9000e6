#include "server/bake/voxel_set.h"

#include <algorithm>
#include <cmath>

namespace tenon::bake {

namespace {

// About 130 bytes per block: half a gigabyte.
constexpr std::size_t kMaxBlocks = 4'000'000;
constexpr double kMaxDistance = 1e8;  // [blocks] from the origin
constexpr double kMaxVisited = 1e9;   // [blocks] in the box of one solid

}  // namespace

bool VoxelSet::add(const structures::DistanceField& field, const Pose& X_WM, double dilation) {
  const Eigen::AlignedBox3d box_M = field.box();
  Eigen::AlignedBox3d box_W;
  for (int corner = 0; corner < 8; ++corner) {
    box_W.extend(X_WM * box_M.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
  }
  const double edge = cell_ * kBlock;
  const Vector3 low = (box_W.min() / edge).array().floor();
  const Vector3 high = (box_W.max() / edge).array().floor();
  if (!(low.cwiseAbs().maxCoeff() < kMaxDistance) || !(high.cwiseAbs().maxCoeff() < kMaxDistance))
    return false;
  if (!((high - low + Vector3::Ones()).prod() < kMaxVisited)) return false;
  const Cell first = low.cast<int>();
  const Cell last = high.cast<int>();
  const Pose X_MW = X_WM.inverse();
  for (int z = first.z(); z <= last.z(); ++z) {
    for (int y = first.y(); y <= last.y(); ++y) {
      for (int x = first.x(); x <= last.x(); ++x) {
        addBlock({x, y, z}, field, X_MW, dilation);
        if (blocks_.size() > kMaxBlocks) return false;
      }
    }
  }
  return true;
}

void VoxelSet::addBlock(const Cell& block, const structures::DistanceField& field, const Pose& X_MW,
                        double dilation) {
  const double edge = cell_ * kBlock;
  const Vector3 p_WB = block.cast<double>() * edge;
  const Vector3 middle = X_MW * (p_WB + Vector3::Constant(edge / 2));
  const double radius = 0.867 * edge;
  if (field.lowerBound(middle, radius) > dilation) return;
  const std::array key{block.x(), block.y(), block.z()};
  if (field.undilated(middle).distance < -radius) {
    blocks_[key].fill(~std::uint64_t{0});
    return;
  }
  const auto known = blocks_.find(key);
  Bits bits{};
  if (known != blocks_.end()) bits = known->second;
  bool any = false;
  for (int k = 0; k < kBlock * kBlock * kBlock; ++k) {
    const auto z = static_cast<std::size_t>(k / (kBlock * kBlock));
    const std::uint64_t bit = std::uint64_t{1} << static_cast<unsigned>(k % (kBlock * kBlock));
    if ((bits[z] & bit) != 0) continue;
    const Vector3 in_block(k % kBlock + 0.5, k / kBlock % kBlock + 0.5, static_cast<double>(z) + 0.5);
    const double distance = field.undilated(X_MW * (p_WB + in_block * cell_)).distance;
    if (distance < 0.0 || distance < dilation) {
      bits[z] |= bit;
      any = true;
    }
  }
  if (any) blocks_[key] = bits;
}

std::size_t VoxelSet::count() const {
  std::size_t sum = 0;
  for (const auto& [key, bits] : blocks_) {
    for (const std::uint64_t word : bits) sum += static_cast<std::size_t>(std::popcount(word));
  }
  return sum;
}

}  // namespace tenon::bake
