#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace tenon {

/// Keeps ticks short by changing their budget of points, between ticks only: measured times never decide
/// anything inside one (DESIGN section 5). What it decides goes into the next TickInput, so a re-run needs no
/// clock.
///
/// A few slow ticks at a time cut the budget to what the machine has shown it can do in the time; a single
/// one may be the operating system's. A calm second gives a quarter back.
///
/// Threads: one, that of the ticks. Real-time: judge.
class Governor {
 public:
  static constexpr std::size_t kWindow = 64;    ///< [ticks] in which
  static constexpr std::size_t kSlowTicks = 3;  ///< so many slow ones are too many
  static constexpr std::uint64_t kCalmTicks = 1000;
  /// No budget is smaller: every pair's coarsest level has to fit.
  static constexpr std::uint64_t kLeastBudget = 2000;
  /// A budget that has grown beyond this limits nothing.
  static constexpr std::uint64_t kMostBudget = 4'000'000;

  /// Ticks should take less than `goal` [s].
  explicit Governor(double goal) : goal_(goal) {}

  /// After a tick that took `seconds` for `points` tested with a budget of `budget` points (0: none): the
  /// budget of the next, when it has to change.
  [[nodiscard]] std::optional<std::uint64_t> judge(double seconds, std::uint64_t points,
                                                   std::uint64_t budget) noexcept;

 private:
  void forget() noexcept;

  double goal_;
  std::array<bool, kWindow> slow_{};
  std::size_t next_ = 0;
  std::size_t slow_ticks_ = 0;
  std::uint64_t calm_ticks_ = 0;
  double rate_ = 0.0;  // [points/s] the best of the slow ticks: what else went on only lowers it
};

}  // namespace tenon
