#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/simulation/coll_pair.h"
#include "server/simulation/scene.h"

namespace tenon {

/// Shares the work of a tick among the pairs that have to be looked at (paper §3.2, graceful degradation).
///
/// The worst case of a pair is known from the start: as many points of its shell as lie on the skin that fits
/// into the other's box. Of a tick's points it gets that share among the pairs at hand, scaled by how near
/// its last load came to the critical one: who has much to do takes from those that hardly touch.
///
/// Threads: one at a time. Real-time: share, of.
class WorkBudget {
 public:
  static constexpr std::uint32_t kUnlimited = 0xFFFFFFFFU;

  /// Room for so many pairs at a time.
  WorkBudget(const Scene& scene, std::size_t rooms);

  /// `due` lists pairs by number.
  void share(const WorkLimits& limits, std::span<const std::uint32_t> due,
             std::span<const CollPair> pairs) noexcept;
  /// Points for the pair at this place of the list; kUnlimited without limits.
  [[nodiscard]] std::uint32_t of(std::size_t slot) const { return shares_[slot]; }
  /// Points of the pair's shell that may touch at worst.
  [[nodiscard]] double worstCase(std::size_t pair) const { return worst_[pair]; }

 private:
  std::vector<double> worst_;          // by pair
  std::vector<double> wanted_;         // by slot
  std::vector<std::uint32_t> shares_;  // by slot
};

}  // namespace tenon
