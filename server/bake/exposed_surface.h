#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/bake/brick_level.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

class ParallelWork;

/// The part of a triangle soup that is exposed to the outside.
///
/// CAD exports are unions of overlapping solids, and walls inside the union are not part of its surface. If
/// they were kept, penetration depths inside would be too small. A triangle that is partly interior is split
/// into pieces of about a voxel along the border.
///
/// Threads: constant after construction. `triangles` must outlive it.
class ExposedSurface {
 public:
  /// `fine` (may be null) is used where it has the lattice points, `coarse` elsewhere.
  ExposedSurface(std::span<const structures::Triangle> triangles, const BrickLevel& coarse,
                 const BrickLevel* fine, ParallelWork& work);

  /// The exposed part of triangle i: itself, nothing, or pieces of it.
  [[nodiscard]] std::span<const structures::Triangle> of(std::uint32_t i) const;
  [[nodiscard]] bool whole(std::uint32_t i) const { return state_[i] == kWhole; }

  /// All exposed parts, in the order of the triangles.
  [[nodiscard]] std::vector<structures::Triangle> all() const;
  /// A triangle that is not exposed, or a part of it.
  struct HiddenPart {
    structures::Triangle part;
    std::uint32_t triangle;
  };
  /// All that is not exposed, in the same order.
  [[nodiscard]] const std::vector<HiddenPart>& hidden() const { return hidden_; }

 private:
  static constexpr std::uint32_t kWhole = 0xFFFFFFFFU;
  static constexpr std::uint32_t kHidden = 0xFFFFFFFEU;

  std::span<const structures::Triangle> triangles_;
  std::vector<std::uint32_t> state_;  // kWhole, kHidden, or an index into pieces_
  std::vector<std::vector<structures::Triangle>> pieces_;
  std::vector<HiddenPart> hidden_;
};

}  // namespace tenon::bake
