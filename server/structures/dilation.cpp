#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <vector>

#include "server/structures/field_builder.h"

namespace tenon::structures {

namespace {

using Entry = DistanceField::Entry;
constexpr int kVoxelsAlong = DistanceField::kBrickVoxels;
constexpr int kSamplesAlong = DistanceField::kBrickSide;
/// [voxels] A child whose samples end at kClampVoxels is right up to this dilation.
constexpr double kClampedChild = DistanceField::kClampVoxels - DistanceField::kBandVoxels;

using Corners = std::array<double, 8>;  // [m] of a brick, x fastest

/// [m] By its corners' values, at (x, y, z) / n. Faces of neighbours have the same bits.
double between(const Corners& c, int x, int y, int z, int n) {
  const double u = static_cast<double>(x) / n;
  const double v = static_cast<double>(y) / n;
  const double w = static_cast<double>(z) / n;
  const auto mean = [](double a, double b, double t) { return a * (1.0 - t) + b * t; };
  return mean(mean(mean(c[0], c[1], u), mean(c[2], c[3], u), v),
              mean(mean(c[4], c[5], u), mean(c[6], c[7], u), v), w);
}

/// Takes the dilations from the samples of a field's bricks.
class Dilator {
 public:
  explicit Dilator(FieldStorage& storage) : storage_(storage), r_(storage.layout.refinement) {}

  void run() {
    const auto& bricks = storage_.layout.bricks;
    std::size_t number = 0;
    for (int z = 0; z < bricks[2]; ++z) {
      for (int y = 0; y < bricks[1]; ++y) {
        for (int x = 0; x < bricks[0]; ++x, ++number) {
          const Corners corners = cornersOf(x, y, z);
          const double largest = *std::max_element(corners.begin(), corners.end());
          storage_.layout.dilation = std::max(storage_.layout.dilation, largest);
          storage_.layout.slope = std::max(storage_.layout.slope, 1.0 + slopeOf(corners));
          if (largest > 0.0) dilateBrick(number, corners, largest);
        }
      }
    }
    storage_.layout.margin = std::max(storage_.layout.margin - storage_.layout.dilation, 0.0);
    if (dropped_) removeDropped();
  }

 private:
  [[nodiscard]] Corners cornersOf(int x, int y, int z) const {
    const auto& bricks = storage_.layout.bricks;
    Corners corners{};
    for (int k = 0; k < 8; ++k) {
      const auto cx = static_cast<std::size_t>(x + (k & 1));
      const auto cy = static_cast<std::size_t>(y + (k >> 1 & 1));
      const auto cz = static_cast<std::size_t>(z + (k >> 2 & 1));
      const auto row = static_cast<std::size_t>(bricks[0]) + 1;
      const auto rows = static_cast<std::size_t>(bricks[1]) + 1;
      corners[static_cast<std::size_t>(k)] = storage_.dilations[(cz * rows + cy) * row + cx];
    }
    return corners;
  }

  /// [-] An upper bound of the gradient in a brick.
  [[nodiscard]] double slopeOf(const Corners& corners) const {
    double squared = 0.0;
    for (std::size_t axis = 1; axis < 8; axis *= 2) {
      double steepest = 0.0;
      for (std::size_t k = 0; k < 8; ++k) {
        if ((k & axis) == 0) steepest = std::max(steepest, std::abs(corners[k + axis] - corners[k]));
      }
      squared += steepest * steepest;
    }
    return std::sqrt(squared) / (kVoxelsAlong * storage_.layout.voxel);
  }

  void dilateBrick(std::size_t number, const Corners& corners, double largest) {
    std::int16_t& far = storage_.far[number];
    const Entry entry = storage_.index[number];
    const double voxel = storage_.layout.voxel;
    if (entry == DistanceField::kFarInside) return;  // deeper: the bound holds
    const double centre = entry < 0 ? largest : between(corners, 1, 1, 1, 2);
    far = quantizedFar(static_cast<double>(far) / DistanceField::kFarPerVoxel - centre / voxel, 1.0, false);
    if (entry < 0) return;
    if (entry < DistanceField::kRefined) return dilateSamples(entry, corners, {0, 0, 0}, 1);
    const auto first = static_cast<std::size_t>(entry - DistanceField::kRefined);
    const auto children = static_cast<std::size_t>(r_ * r_ * r_);
    for (std::size_t k = 0; k < children; ++k) {
      Entry& child = storage_.index[first + k];
      if (child < 0) continue;
      const auto i = static_cast<int>(k);
      const std::array<int, 3> cell{i % r_, i / r_ % r_, i / (r_ * r_)};
      if (reaches(child, corners, cell)) {
        dilateSamples(child, corners, cell, r_);
      } else {
        child = DistanceField::kFarOutside;
        dropped_ = true;
      }
    }
    dilateSamples(storage_.index[first + children], corners, {0, 0, 0}, 1);
  }

  [[nodiscard]] std::int16_t* samplesOf(Entry brick) {
    return storage_.samples.data() + static_cast<std::size_t>(brick) * DistanceField::kBrickSamples;
  }

  /// Whether a child has exact samples as far as the dilation in it needs.
  [[nodiscard]] bool reaches(Entry child, const Corners& corners, const std::array<int, 3>& cell) {
    constexpr auto kClamped =
        static_cast<std::int16_t>(DistanceField::kClampVoxels * DistanceField::kQuantaPerVoxel);
    const std::int16_t* s = samplesOf(child);
    if (*std::max_element(s, s + DistanceField::kBrickSamples) != kClamped) return true;
    double largest = 0.0;
    for (int k = 0; k < 8; ++k) {
      largest = std::max(
          largest, between(corners, cell[0] + (k & 1), cell[1] + (k >> 1 & 1), cell[2] + (k >> 2 & 1), r_));
    }
    return largest * r_ <= kClampedChild * storage_.layout.voxel;
  }

  void dilateSamples(Entry brick, const Corners& corners, const std::array<int, 3>& cell, int divisions) {
    const double quanta = DistanceField::kQuantaPerVoxel * divisions / storage_.layout.voxel;
    std::int16_t* s = samplesOf(brick);
    for (int z = 0; z < kSamplesAlong; ++z) {
      for (int y = 0; y < kSamplesAlong; ++y) {
        for (int x = 0; x < kSamplesAlong; ++x, ++s) {
          const double dilation = between(corners, cell[0] * kVoxelsAlong + x, cell[1] * kVoxelsAlong + y,
                                          cell[2] * kVoxelsAlong + z, divisions * kVoxelsAlong);
          const double value = *s - dilation * quanta;
          *s = static_cast<std::int16_t>(std::lround(std::clamp(value, -32767.0, 32767.0)));
        }
      }
    }
  }

  /// Closes the gaps that dropped children leave among the bricks of samples.
  void removeDropped() {
    const auto isBrick = [](Entry entry) { return entry >= 0 && entry < DistanceField::kRefined; };
    constexpr std::size_t kBrick = DistanceField::kBrickSamples;
    std::vector<Entry> number(storage_.samples.size() / kBrick, -1);
    for (const Entry entry : storage_.index)
      if (isBrick(entry)) number[static_cast<std::size_t>(entry)] = 0;
    Entry kept = 0;
    for (std::size_t brick = 0; brick < number.size(); ++brick) {
      if (number[brick] < 0) continue;
      std::copy_n(storage_.samples.data() + brick * kBrick, kBrick,
                  storage_.samples.data() + static_cast<std::size_t>(kept) * kBrick);
      number[brick] = kept++;
    }
    storage_.samples.resize(static_cast<std::size_t>(kept) * kBrick);
    for (Entry& entry : storage_.index)
      if (isBrick(entry)) entry = number[static_cast<std::size_t>(entry)];
  }

  FieldStorage& storage_;
  const int r_;
  bool dropped_ = false;  ///< a child at least
};

}  // namespace

DistanceField makeDilatedField(FieldStorage storage, std::span<const float> dilations) {
  const bool none = std::all_of(dilations.begin(), dilations.end(), [](float d) { return d == 0.0F; });
  if (none) return makeField(std::move(storage));
  storage.dilations.assign(dilations.begin(), dilations.end());
  Dilator(storage).run();
  return makeField(std::move(storage));
}

}  // namespace tenon::structures
