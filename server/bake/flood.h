#pragma once

#include <utility>
#include <vector>

#include "server/bake/brick_level.h"

namespace tenon::bake {

/// Flood fill of a level's lattice points, 64 samples per word. Bricks without samples are filled as a whole.
///
/// Threads: one.
class Flood {
 public:
  using Mask = BrickLevel::Mask;
  /// For each own sample of a brick, whether it is connected to the next one along each axis (which the
  /// neighbouring brick may own).
  struct Links {
    Mask x{}, y{}, z{};
  };

  /// Marks reached samples in `reached`, one mask per slot. With `through_empty` bricks without samples are
  /// filled and become free; otherwise they block the flood.
  Flood(BrickLevel& level, const std::vector<Links>& links, std::vector<Mask>& reached, bool through_empty);

  /// Adds samples of a node to start from.
  void seed(std::size_t node, const Mask& mask);
  /// Fills until no further sample is reached.
  void run();

  /// The nodes with samples reached since the last call, in ascending order.
  [[nodiscard]] std::vector<std::size_t> takeReachedNodes();
  /// Whether a brick without samples blocked the flood since the last call.
  [[nodiscard]] bool takeBlocked() { return std::exchange(blocked_, false); }

  /// Links of a brick's samples for which connected(sample, next sample) is true.
  template <typename Connected>
  [[nodiscard]] static Links linksWhere(Connected&& connected);

 private:
  void fillBrick(std::size_t slot);
  [[nodiscard]] const Links& linksOf(std::size_t node) const;

  BrickLevel& level_;
  const std::vector<Links>& links_;
  std::vector<Mask>& reached_;
  bool through_empty_;
  bool blocked_ = false;
  std::vector<std::uint8_t> queued_;
  std::vector<std::size_t> pending_;
  std::vector<std::size_t> reached_nodes_;
};

template <typename Connected>
Flood::Links Flood::linksWhere(Connected&& connected) {
  constexpr int kSide = BrickLevel::kSide;
  Links links;
  for (int z = 0; z < BrickLevel::kVoxels; ++z) {
    for (int bit = 0; bit < 64; ++bit) {
      const int sample = BrickLevel::sampleIndex({bit % 8, bit / 8, z});
      const auto set = [&](Mask& mask, int next) {
        mask[static_cast<std::size_t>(z)] |= static_cast<std::uint64_t>(connected(sample, sample + next))
                                             << static_cast<unsigned>(bit);
      };
      set(links.x, 1);
      set(links.y, kSide);
      set(links.z, kSide * kSide);
    }
  }
  return links;
}

}  // namespace tenon::bake
