#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/simulation/coll_pair.h"
#include "server/simulation/scene.h"

namespace tenon::simulation {

/// Distributes the point budget of a tick among the pairs that are due (paper §3.2, graceful degradation).
///
/// The worst case of a pair is computed at the start: the shell points of a on the part of its surface that
/// fits into b's bounding box. Budgets are proportional to the worst case, scaled by the last load over the
/// critical load: pairs with many contacts get more than pairs that hardly touch.
///
/// Threads: one at a time. Real-time: distribute, pointsFor.
class WorkBudget {
 public:
  static constexpr std::uint32_t kUnlimited = 0xFFFFFFFFU;

  /// `max_due`: most pairs that are due in one tick.
  WorkBudget(const Scene& scene, std::size_t max_due);

  /// `due`: indices of the due pairs; a slot is a position in this list.
  void distribute(const WorkLimits& limits, std::span<const std::uint32_t> due,
                  std::span<const CollPair> pairs) noexcept;
  /// Points that the pair in this slot may test; kUnlimited without limits.
  [[nodiscard]] std::uint32_t pointsFor(std::size_t slot) const { return budgets_[slot]; }
  /// [points] most points of the pair's shell that may be in contact.
  [[nodiscard]] double worstCase(std::size_t pair) const { return worst_case_[pair]; }

 private:
  std::vector<double> worst_case_;      // [points] by pair
  std::vector<double> weights_;         // [points] by slot
  std::vector<std::uint32_t> budgets_;  // [points] by slot
};

}  // namespace tenon::simulation
