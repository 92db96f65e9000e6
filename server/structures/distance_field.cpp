#include "server/structures/distance_field.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace tenon::structures {

namespace {

/// [voxels] Quantisation error of a sample (half a quantum), rounded up.
constexpr double kRounding = 1e-3;

/// The value at `t` [-] between those of the corners of a unit cube, x fastest.
double trilinear(const std::array<double, 8>& corners, const Vector3& t) {
  std::array<double, 4> along_x{};
  for (std::size_t k = 0; k < 4; ++k)
    along_x[k] = corners[2 * k] * (1.0 - t.x()) + corners[2 * k + 1] * t.x();
  const double low = along_x[0] * (1.0 - t.y()) + along_x[1] * t.y();
  const double high = along_x[2] * (1.0 - t.y()) + along_x[3] * t.y();
  return low * (1.0 - t.z()) + high * t.z();
}

double distanceToBox(const Eigen::AlignedBox3d& box, const Vector3& p) {
  const Vector3 outside = (box.min() - p).cwiseMax(p - box.max()).cwiseMax(0.0);
  return outside.norm();
}

}  // namespace

/// The coarse brick that a point lies in, its index entry, and the point in it [bricks], in [0, 1].
struct DistanceField::BrickLocation {
  std::array<std::size_t, 3> brick{};
  std::size_t number = 0;
  Entry entry = kFarOutside;
  Vector3 p_brick = Vector3::Zero();
};

DistanceField::DistanceField(const Layout& layout, std::shared_ptr<const void> owner)
    : layout_(layout),
      brick_edge_(layout.voxel * kBrickVoxels),
      inverse_brick_edge_(1.0 / (layout.voxel * kBrickVoxels)),
      owner_(std::move(owner)) {}

Eigen::AlignedBox3d DistanceField::box() const {
  const Vector3 size(layout_.bricks[0], layout_.bricks[1], layout_.bricks[2]);
  return {layout_.p_MoFo_M, layout_.p_MoFo_M + size * brick_edge_};
}

bool DistanceField::locate(const Vector3& p_MP, BrickLocation& location) const noexcept {
  const Vector3 p = (p_MP - layout_.p_MoFo_M) * inverse_brick_edge_;
  std::array<std::size_t, 3>& brick = location.brick;
  for (int axis = 0; axis < 3; ++axis) {
    // the comparison is false for NaN, which counts as outside
    if (!(p[axis] >= 0.0 && p[axis] < layout_.bricks[axis])) return false;
    brick[axis] = static_cast<std::size_t>(p[axis]);
    location.p_brick[axis] = p[axis] - static_cast<double>(brick[axis]);
  }
  const auto nx = static_cast<std::size_t>(layout_.bricks[0]);
  const auto ny = static_cast<std::size_t>(layout_.bricks[1]);
  location.number = (brick[2] * ny + brick[1]) * nx + brick[0];
  location.entry = layout_.index[location.number];
  return true;
}

bool DistanceField::interpolate(Entry brick, const Vector3& p_brick, double voxel, double band,
                                FieldSample& sample) const noexcept {
  const Vector3 p = p_brick * kBrickVoxels;
  const int x = std::min(static_cast<int>(p.x()), kBrickVoxels - 1);
  const int y = std::min(static_cast<int>(p.y()), kBrickVoxels - 1);
  const int z = std::min(static_cast<int>(p.z()), kBrickVoxels - 1);
  const double u = p.x() - x;
  const double v = p.y() - y;
  const double w = p.z() - z;
  const std::int16_t* s = layout_.samples.data() + static_cast<std::size_t>(brick) * kBrickSamples +
                          (z * kBrickSide + y) * kBrickSide + x;
  constexpr int kY = kBrickSide;
  constexpr int kZ = kBrickSide * kBrickSide;

  // interpolate along x, then y, then z; d* are differences along x, e* along y
  const double d00 = s[1] - s[0];
  const double d10 = s[kY + 1] - s[kY];
  const double d01 = s[kZ + 1] - s[kZ];
  const double d11 = s[kZ + kY + 1] - s[kZ + kY];
  const double c00 = s[0] + d00 * u;
  const double c10 = s[kY] + d10 * u;
  const double c01 = s[kZ] + d01 * u;
  const double c11 = s[kZ + kY] + d11 * u;
  const double e0 = c10 - c00;
  const double e1 = c11 - c01;
  const double c0 = c00 + e0 * v;
  const double c1 = c01 + e1 * v;
  const double d0 = d00 + (d10 - d00) * v;
  const double d1 = d01 + (d11 - d01) * v;

  constexpr double kPerQuantum = 1.0 / kQuantaPerVoxel;
  sample.distance = (c0 + (c1 - c0) * w) * kPerQuantum * voxel;
  sample.gradient = Vector3(d0 + (d1 - d0) * w, e0 + (e1 - e0) * w, c1 - c0) * kPerQuantum;
  sample.exact = std::abs(sample.distance) <= band;
  return sample.exact;
}

double DistanceField::farMagnitude(const BrickLocation& location) const noexcept {
  // in a brick without samples all lattice points are beyond the band
  const double beyond_band = layout_.band - layout_.dilation - kHalfDiagonal * layout_.voxel;
  const Vector3 p_CP = (location.p_brick - Vector3::Constant(0.5)) * brick_edge_;
  const double at_centre = std::abs(layout_.far[location.number]) * layout_.voxel / kFarPerVoxel;
  return std::max(beyond_band, at_centre - p_CP.norm());
}

FieldSample DistanceField::sample(const Vector3& p_MP) const noexcept {
  FieldSample sample;
  BrickLocation location;
  if (!locate(p_MP, location)) {
    sample.distance = distanceToBox(box(), p_MP) + layout_.margin;
    return sample;
  }
  Entry brick = location.entry;
  if (brick < 0) {
    const double magnitude = farMagnitude(location);
    sample.distance = brick == kFarInside ? -magnitude : magnitude;
    return sample;
  }
  if (brick >= kRefined) {
    // the child's value where it is within the child's band, else that of the coarse brick
    const int r = layout_.refinement;
    const Vector3 p = location.p_brick * r;
    std::array<int, 3> child{};
    Vector3 p_child;
    for (int axis = 0; axis < 3; ++axis) {
      child[axis] = std::min(static_cast<int>(p[axis]), r - 1);
      p_child[axis] = p[axis] - child[axis];
    }
    const Entry* children = layout_.index.data() + (brick - kRefined);
    const Entry fine = children[(child[2] * r + child[1]) * r + child[0]];
    const double fine_voxel = layout_.voxel / r;
    if (fine >= 0 && interpolate(fine, p_child, fine_voxel, kBandVoxels * fine_voxel, sample)) return sample;
    brick = children[r * r * r];
  }
  if (interpolate(brick, location.p_brick, layout_.voxel, layout_.band, sample)) return sample;
  const double magnitude = std::abs(sample.distance) - kHalfDiagonal * layout_.voxel;
  sample.distance = std::copysign(std::max(magnitude, 0.0), sample.distance);
  sample.gradient = Vector3::Zero();
  return sample;
}

bool DistanceField::cellAt(const Vector3& p_MP, FieldCell& cell) const noexcept {
  BrickLocation location;
  if (!locate(p_MP, location) || location.entry < 0) return false;
  FieldSample sample;
  const auto take = [&](Entry brick, const Vector3& p_brick, double voxel, double band) {
    if (brick < 0 || !interpolate(brick, p_brick, voxel, band, sample)) return false;
    const Vector3 p = p_brick * kBrickVoxels;
    const Eigen::Vector3i low = p.cast<int>().cwiseMin(kBrickVoxels - 1);
    const std::int16_t* s = layout_.samples.data() + static_cast<std::size_t>(brick) * kBrickSamples +
                            (low.z() * kBrickSide + low.y()) * kBrickSide + low.x();
    for (int k = 0; k < 8; ++k) {
      cell.samples[static_cast<std::size_t>(k)] =
          static_cast<double>(s[((k >> 2) * kBrickSide + (k >> 1 & 1)) * kBrickSide + (k & 1)]) /
          kQuantaPerVoxel;
    }
    cell.p_cell = p - low.cast<double>();
    cell.voxel = voxel;
    return true;
  };
  Entry brick = location.entry;
  if (brick >= kRefined) {
    const int r = layout_.refinement;
    const Vector3 p = location.p_brick * r;
    const Eigen::Vector3i child = p.cast<int>().cwiseMin(r - 1);
    const Entry* children = layout_.index.data() + (brick - kRefined);
    const double voxel = layout_.voxel / r;
    if (take(children[(child.z() * r + child.y()) * r + child.x()], p - child.cast<double>(), voxel,
             kBandVoxels * voxel))
      return true;
    brick = children[r * r * r];
  }
  return take(brick, location.p_brick, layout_.voxel, layout_.band);
}

std::span<const ValleyPlane> DistanceField::planesIn(Entry brick, const Vector3& p_brick) const noexcept {
  const std::int32_t number = layout_.valley_index[static_cast<std::size_t>(brick)];
  if (number == kNoValley) return {};
  const ValleyBrick& valley = layout_.valley_bricks[static_cast<std::size_t>(number)];
  const Eigen::Vector3i cell = (p_brick * kBrickVoxels).cast<int>().cwiseMin(kBrickVoxels - 1);
  const auto z = static_cast<std::size_t>(cell.z());
  const auto bit = static_cast<unsigned>(cell.y() * kBrickVoxels + cell.x());
  if ((valley.cells[z] >> bit & 1U) == 0) return {};
  auto before = static_cast<std::size_t>(std::popcount(valley.cells[z] & ((std::uint64_t{1} << bit) - 1U)));
  for (std::size_t k = 0; k < z; ++k) before += static_cast<std::size_t>(std::popcount(valley.cells[k]));
  const std::uint32_t planes = layout_.valley_cells[valley.first + before];
  return layout_.valley_planes.subspan(planes / kMaxValleyPlanes, planes % kMaxValleyPlanes + 1);
}

std::span<const ValleyPlane> DistanceField::planesAt(const Vector3& p_MP) const noexcept {
  BrickLocation location;
  if (layout_.valley_index.empty() || !locate(p_MP, location) || location.entry < 0) return {};
  if (location.entry < kRefined) return planesIn(location.entry, location.p_brick);
  // cells with planes are near the surface, where children have samples
  const int r = layout_.refinement;
  const Vector3 p = location.p_brick * r;
  const Eigen::Vector3i child = p.cast<int>().cwiseMin(r - 1);
  const Entry fine = layout_.index[static_cast<std::size_t>((location.entry - kRefined) +
                                                            (child.z() * r + child.y()) * r + child.x())];
  return fine < 0 ? std::span<const ValleyPlane>() : planesIn(fine, p - child.cast<double>());
}

FieldSample DistanceField::undilated(const Vector3& p_MP) const noexcept {
  FieldSample sample = this->sample(p_MP);
  sample.distance += dilationAt(p_MP);
  return sample;
}

double DistanceField::dilationIn(std::size_t x, std::size_t y, std::size_t z,
                                 const Vector3& p_brick) const noexcept {
  const auto row = static_cast<std::size_t>(layout_.bricks[0]) + 1;
  const std::size_t layer = row * (static_cast<std::size_t>(layout_.bricks[1]) + 1);
  const float* low = layout_.dilations.data() + z * layer + y * row + x;
  return trilinear({low[0], low[1], low[row], low[row + 1], low[layer], low[layer + 1], low[layer + row],
                    low[layer + row + 1]},
                   p_brick);
}

double DistanceField::dilationAt(const Vector3& p_MP) const noexcept {
  BrickLocation location;
  if (layout_.dilations.empty() || !locate(p_MP, location)) return 0.0;
  return dilationIn(location.brick[0], location.brick[1], location.brick[2], location.p_brick);
}

double DistanceField::largestDilation(const Eigen::AlignedBox3d& box_M) const noexcept {
  if (layout_.dilations.empty()) return 0.0;
  const Vector3 low = ((box_M.min() - layout_.p_MoFo_M) * inverse_brick_edge_).cwiseMax(0.0);
  const Vector3 high = ((box_M.max() - layout_.p_MoFo_M) * inverse_brick_edge_)
                           .cwiseMin(Vector3(layout_.bricks[0], layout_.bricks[1], layout_.bricks[2]));
  double largest = 0.0;
  for (double z = std::floor(low.z()); z < high.z(); ++z) {
    for (double y = std::floor(low.y()); y < high.y(); ++y) {
      for (double x = std::floor(low.x()); x < high.x(); ++x) {
        const double number = (z * layout_.bricks[1] + y) * layout_.bricks[0] + x;
        if (layout_.index[static_cast<std::size_t>(number)] < 0) continue;
        // a trilinear function is largest at a corner of the part of the box that is in the brick
        for (unsigned corner = 0; corner < 8; ++corner) {
          const Vector3 p(std::clamp((corner & 1U) != 0 ? high.x() - x : low.x() - x, 0.0, 1.0),
                          std::clamp((corner & 2U) != 0 ? high.y() - y : low.y() - y, 0.0, 1.0),
                          std::clamp((corner & 4U) != 0 ? high.z() - z : low.z() - z, 0.0, 1.0));
          largest = std::max(largest, dilationIn(static_cast<std::size_t>(x), static_cast<std::size_t>(y),
                                                 static_cast<std::size_t>(z), p));
        }
      }
    }
  }
  return largest;
}

double DistanceField::lowerBound(const Vector3& p_MP, double radius) const noexcept {
  // A sample is at least the value at a reference point minus the slope times the length between them. The
  // interpolant is a weighted mean of the 8 samples about the point; the mean of their squared lengths
  // exceeds the point's own squared length by at most 3/4 voxel^2.
  const auto bound = [this, radius](double value, double away) {
    const double spread = kHalfDiagonal * layout_.voxel;
    return value - layout_.slope * std::sqrt((away + radius) * (away + radius) + spread * spread) -
           kRounding * layout_.voxel;
  };
  BrickLocation location;
  if (!locate(p_MP, location)) return bound(distanceToBox(box(), p_MP) + layout_.margin, 0.0);
  // no point in the box is deeper than half its diagonal
  if (location.entry == kFarInside) return -0.5 * box().diagonal().norm();
  const Vector3 p_CP = (location.p_brick - Vector3::Constant(0.5)) * brick_edge_;
  const double at_centre = layout_.far[location.number] * layout_.voxel / kFarPerVoxel;
  const double from_centre = bound(at_centre, p_CP.norm());
  if (location.entry != kFarOutside) return from_centre;
  // the lattice point nearest to p is beyond the band
  return std::max(from_centre, bound(layout_.band - layout_.dilation, kHalfDiagonal * layout_.voxel));
}

double DistanceField::voxelAt(const Vector3& p_MP) const noexcept {
  BrickLocation location;
  if (!locate(p_MP, location) || location.entry < kRefined) return layout_.voxel;
  const int r = layout_.refinement;
  std::array<int, 3> child{};
  for (int axis = 0; axis < 3; ++axis)
    child[axis] = std::min(static_cast<int>(location.p_brick[axis] * r), r - 1);
  const Entry fine = layout_.index[(location.entry - kRefined) + (child[2] * r + child[1]) * r + child[0]];
  return fine >= 0 ? layout_.voxel / r : layout_.voxel;
}

}  // namespace tenon::structures
