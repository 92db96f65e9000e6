#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace tenon::simulation {

/// Adapts the point budget to the measured compute time, between ticks only: inside a tick nothing depends on
/// measured time. A new budget is part of the next TickInput and thus of the journal, so a re-simulation
/// needs no clock (D-020).
///
/// kSlowTicks slow ticks within kWindow reduce the budget to what the machine can do at its measured rate; a
/// single slow tick may be due to the operating system. kFastTicks ticks without a slow one raise it by a
/// quarter.
///
/// Threads: one, that of the ticks. Real-time: update.
class Governor {
 public:
  static constexpr std::size_t kWindow = 64;         ///< [ticks] sliding window
  static constexpr std::size_t kSlowTicks = 3;       ///< slow ticks in the window that reduce the budget
  static constexpr std::uint64_t kFastTicks = 1000;  ///< [ticks] in a row that raise the budget
  /// [points] smallest budget: the coarsest levels of all pairs have to fit.
  static constexpr std::uint64_t kMinBudget = 2000;
  /// [points] a budget that has grown beyond this is removed (0: unlimited).
  static constexpr std::uint64_t kMaxBudget = 4'000'000;

  /// `goal` [s]: compute time above which a tick counts as slow.
  explicit Governor(double goal) : goal_(goal) {}

  /// To be called after each tick. `seconds` [s]: its compute time; `points`: points it tested; `budget`: its
  /// point budget, 0 when unlimited. Returns the budget of the next tick when it changes.
  [[nodiscard]] std::optional<std::uint64_t> update(double seconds, std::uint64_t points,
                                                    std::uint64_t budget) noexcept;

 private:
  void reset() noexcept;

  double goal_;  // [s]
  std::array<bool, kWindow> slow_{};
  std::size_t next_ = 0;
  std::size_t slow_ticks_ = 0;
  std::uint64_t fast_ticks_ = 0;
  double rate_ = 0.0;  // [points/s] highest of the slow ticks: other load on the machine only lowers it
};

}  // namespace tenon::simulation
