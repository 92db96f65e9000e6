#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/bake/brick_level.h"
#include "server/structures/triangle.h"

namespace tenon {

class ParallelWork;

/// The part of a soup of triangles that the outside touches.
///
/// CAD exports are unions: solids overlap, and the walls inside them are no surface of the whole. Left in,
/// they would make everything within look shallow. A triangle that is partly inside is cut into pieces of
/// about a voxel along the border. Threads: constant after construction.
class ExposedSurface {
 public:
  /// `fine` (may be null) answers where it knows the place, `coarse` elsewhere.
  ExposedSurface(std::span<const Triangle> triangles, const BrickLevel& coarse, const BrickLevel* fine,
                 ParallelWork& work);

  /// What is left of triangle i: itself, nothing, or pieces of it.
  [[nodiscard]] std::span<const Triangle> of(std::uint32_t i) const;
  [[nodiscard]] bool whole(std::uint32_t i) const { return state_[i] == kWhole; }

  /// All of it, in the order of the triangles.
  [[nodiscard]] std::vector<Triangle> all() const;

 private:
  static constexpr std::uint32_t kWhole = 0xFFFFFFFFU;
  static constexpr std::uint32_t kHidden = 0xFFFFFFFEU;

  std::span<const Triangle> triangles_;
  std::vector<std::uint32_t> state_;  // or the number of a list of pieces
  std::vector<std::vector<Triangle>> pieces_;
};

}  // namespace tenon
