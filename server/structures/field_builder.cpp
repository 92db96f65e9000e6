#include "server/structures/field_builder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

namespace tenon::structures {

namespace {

using Entry = DistanceField::Entry;
constexpr int kSide = DistanceField::kBrickSide;

/// Samples one brick and appends it when any of its samples is within the band.
class BrickSampler {
 public:
  BrickSampler(const AnalyticDistance& distance, HugeVector<std::int16_t>& samples)
      : distance_(distance), samples_(samples) {}

  Entry sample(const Vector3& p_MBo, double voxel) {
    const double edge = voxel * DistanceField::kBrickVoxels;
    const double at_centre = distance_(p_MBo + Vector3::Constant(edge / 2));
    const Entry far = at_centre < 0.0 ? DistanceField::kFarInside : DistanceField::kFarOutside;
    if (std::abs(at_centre) >= (DistanceField::kBandVoxels + DistanceField::kBrickRadius) * voxel) return far;

    std::array<std::int16_t, DistanceField::kBrickSamples> brick{};
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t next = 0;
    for (int z = 0; z < kSide; ++z) {
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) {
          const double d = distance_(p_MBo + Vector3(x, y, z) * voxel);
          nearest = std::min(nearest, std::abs(d));
          brick[next++] = quantizedSample(d, voxel);
        }
      }
    }
    if (nearest >= DistanceField::kBandVoxels * voxel) return far;
    samples_.insert(samples_.end(), brick.begin(), brick.end());
    return static_cast<Entry>(samples_.size() / DistanceField::kBrickSamples) - 1;
  }

 private:
  const AnalyticDistance& distance_;
  HugeVector<std::int16_t>& samples_;
};

}  // namespace

namespace {

DistanceField::Layout layoutOf(const FieldStorage& storage) {
  DistanceField::Layout layout = storage.layout;
  layout.index = storage.index;
  layout.samples = storage.samples;
  layout.far = storage.far;
  layout.dilations = storage.dilations;
  layout.valley_index = storage.valley_index;
  layout.valley_bricks = storage.valley_bricks;
  layout.valley_cells = storage.valley_cells;
  layout.valley_planes = storage.valley_planes;
  return layout;
}

}  // namespace

DistanceField viewOf(const FieldStorage& storage) { return {layoutOf(storage), nullptr}; }

DistanceField makeField(FieldStorage storage) {
  const auto owner = std::make_shared<const FieldStorage>(std::move(storage));
  return {layoutOf(*owner), owner};
}

DistanceField withValleys(const DistanceField& field, std::span<const BrickValleys> valleys) {
  if (valleys.empty()) return field;
  struct Owner {
    FieldStorage valleys;
    DistanceField field;
  };
  const auto owner = std::make_shared<Owner>();
  owner->field = field;
  FieldStorage& storage = owner->valleys;
  storage.valley_index.assign(field.layout().samples.size() / DistanceField::kBrickSamples,
                              DistanceField::kNoValley);
  for (const BrickValleys& brick : valleys) {
    storage.valley_index[static_cast<std::size_t>(brick.brick)] =
        static_cast<std::int32_t>(storage.valley_bricks.size());
    storage.valley_bricks.push_back({static_cast<std::uint32_t>(storage.valley_cells.size()), brick.cells});
    // neighbouring cells mostly have the same planes
    const std::size_t first_of_brick = storage.valley_planes.size();
    for (const auto& planes : brick.planes) {
      const auto same = [](const ValleyPlane& a, const ValleyPlane& b) {
        return a.n_M == b.n_M && a.offset == b.offset;
      };
      const auto found =
          std::search(storage.valley_planes.begin() + static_cast<std::ptrdiff_t>(first_of_brick),
                      storage.valley_planes.end(), planes.begin(), planes.end(), same);
      const auto first = static_cast<std::uint32_t>(found - storage.valley_planes.begin());
      if (found == storage.valley_planes.end())
        storage.valley_planes.insert(storage.valley_planes.end(), planes.begin(), planes.end());
      storage.valley_cells.push_back(first * DistanceField::kMaxValleyPlanes +
                                     static_cast<std::uint32_t>(planes.size()) - 1);
    }
  }
  DistanceField::Layout layout = field.layout();
  layout.valley_index = storage.valley_index;
  layout.valley_bricks = storage.valley_bricks;
  layout.valley_cells = storage.valley_cells;
  layout.valley_planes = storage.valley_planes;
  return {layout, owner};
}

FieldStorage makeGrid(const Eigen::AlignedBox3d& surface_box_M, double voxel) {
  FieldStorage storage;
  const double edge = voxel * DistanceField::kBrickVoxels;
  storage.layout.voxel = voxel;
  storage.layout.band = DistanceField::kBandVoxels * voxel;
  storage.layout.margin = edge;
  storage.layout.p_MoFo_M = surface_box_M.min() - Vector3::Constant(edge);
  std::size_t count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double bricks = std::max(1.0, std::ceil(surface_box_M.sizes()[axis] / edge - 1e-9)) + 2.0;
    storage.layout.bricks[axis] = static_cast<std::int32_t>(bricks);
    count *= static_cast<std::size_t>(storage.layout.bricks[axis]);
  }
  storage.index.assign(count, DistanceField::kFarOutside);
  storage.far.assign(count, 0);
  return storage;
}

std::int16_t quantizedSample(double distance, double voxel, double clamp) {
  const double voxels = std::clamp(distance / voxel, -clamp, clamp);
  return static_cast<std::int16_t>(std::lround(voxels * DistanceField::kQuantaPerVoxel));
}

std::int16_t quantizedFar(double bound, double voxel, bool inside_brick) {
  const double scaled = bound / voxel * DistanceField::kFarPerVoxel;
  const double rounded = inside_brick ? std::ceil(scaled) : std::floor(scaled);
  return static_cast<std::int16_t>(std::clamp(rounded, -32767.0, 32767.0));
}

DistanceField buildField(const AnalyticDistance& distance, const Eigen::AlignedBox3d& surface_box_M,
                         double voxel, std::span<const Eigen::AlignedBox3d> refine_M, int refinement) {
  FieldStorage storage = makeGrid(surface_box_M, voxel);
  DistanceField::Layout& layout = storage.layout;
  layout.refinement = std::max(refinement, 1);
  const double edge = voxel * DistanceField::kBrickVoxels;
  BrickSampler sampler(distance, storage.samples);

  std::size_t number = 0;
  for (int z = 0; z < layout.bricks[2]; ++z) {
    for (int y = 0; y < layout.bricks[1]; ++y) {
      for (int x = 0; x < layout.bricks[0]; ++x, ++number) {
        const Vector3 p_MBo = layout.p_MoFo_M + Vector3(x, y, z) * edge;
        const double at_centre = distance(p_MBo + Vector3::Constant(edge / 2));
        const Entry coarse = sampler.sample(p_MBo, voxel);
        storage.index[number] = coarse;
        storage.far[number] = quantizedFar(at_centre, voxel, coarse == DistanceField::kFarInside);
        const Eigen::AlignedBox3d box(p_MBo, p_MBo + Vector3::Constant(edge));
        const bool refined = layout.refinement > 1 && coarse >= 0 &&
                             std::abs(at_centre) < DistanceField::kBrickRadius * voxel &&
                             std::any_of(refine_M.begin(), refine_M.end(),
                                         [&box](const auto& region) { return region.intersects(box); });
        if (!refined) continue;

        // its children, then the coarse brick itself
        const double fine_voxel = voxel / layout.refinement;
        storage.index[number] = DistanceField::kRefined + static_cast<Entry>(storage.index.size());
        for (int k = 0; k < layout.refinement; ++k) {
          for (int j = 0; j < layout.refinement; ++j) {
            for (int i = 0; i < layout.refinement; ++i) {
              const Vector3 p_BC = Vector3(i, j, k) * (fine_voxel * DistanceField::kBrickVoxels);
              storage.index.push_back(sampler.sample(p_MBo + p_BC, fine_voxel));
            }
          }
        }
        storage.index.push_back(coarse);
      }
    }
  }
  return makeField(std::move(storage));
}

}  // namespace tenon::structures
