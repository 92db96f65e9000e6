#pragma once

#include <utility>
#include <vector>

#include "server/bake/brick_level.h"

namespace tenon {

/// Floods the free space of a level by words of 64 samples; bricks without samples are one step each.
///
/// Threads: one.
class Flood {
 public:
  using Mask = BrickLevel::Mask;
  /// Per own sample of a brick whether the flood passes between it and the next one along each axis, which
  /// may be the neighbour's.
  struct Links {
    Mask x{}, y{}, z{};
  };

  /// Marks in `reached`, a mask for each slot. Bricks without samples are passed, and become free, only with
  /// `through_empty`.
  Flood(BrickLevel& level, const std::vector<Links>& links, std::vector<Mask>& reached, bool through_empty);

  void seed(std::size_t node, const Mask& mask);
  void run();

  /// The nodes with samples reached since the last call, in order.
  [[nodiscard]] std::vector<std::size_t> takeTouched();
  /// Whether a brick without samples was in the way since the last call.
  [[nodiscard]] bool takeStopped() { return std::exchange(stopped_, false); }

  /// Links of a brick's samples for which joined(sample, next sample) is true.
  template <typename Joined>
  [[nodiscard]] static Links linksWhere(Joined&& joined);

 private:
  void spread(std::size_t slot);
  [[nodiscard]] const Links& linksOf(std::size_t node) const;

  BrickLevel& level_;
  const std::vector<Links>& links_;
  std::vector<Mask>& reached_;
  bool through_empty_;
  bool stopped_ = false;
  std::vector<std::uint8_t> queued_;
  std::vector<std::size_t> waiting_;
  std::vector<std::size_t> touched_;
};

template <typename Joined>
Flood::Links Flood::linksWhere(Joined&& joined) {
  constexpr int kSide = BrickLevel::kSide;
  Links links;
  for (int z = 0; z < BrickLevel::kVoxels; ++z) {
    for (int bit = 0; bit < 64; ++bit) {
      const int sample = BrickLevel::sampleIndex({bit % 8, bit / 8, z});
      const auto set = [&](Mask& mask, int next) {
        mask[static_cast<std::size_t>(z)] |= static_cast<std::uint64_t>(joined(sample, sample + next))
                                             << static_cast<unsigned>(bit);
      };
      set(links.x, 1);
      set(links.y, kSide);
      set(links.z, kSide * kSide);
    }
  }
  return links;
}

}  // namespace tenon
