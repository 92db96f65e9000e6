#include "server/simulation/governor.h"

#include <algorithm>

namespace tenon::simulation {
namespace {

/// [-] A budget is this fraction of what the machine can do in the time: the cost of a point varies.
constexpr double kSafetyFactor = 0.8;
/// [-] Factor on a budget at which ticks are still slow, and on one at which they have been fast.
constexpr double kReduction = 0.85;
constexpr double kGrowth = 1.25;

}  // namespace

std::optional<std::uint64_t> Governor::update(double seconds, std::uint64_t points,
                                              std::uint64_t budget) noexcept {
  const bool slow = seconds > goal_;
  slow_ticks_ -= slow_[next_] ? 1 : 0;
  slow_ticks_ += slow ? 1 : 0;
  slow_[next_] = slow;
  next_ = (next_ + 1) % kWindow;
  if (slow) {
    fast_ticks_ = 0;
    rate_ = std::max(slow_ticks_ == 1 ? 0.0 : rate_, static_cast<double>(points) / seconds);
    if (slow_ticks_ < kSlowTicks) return std::nullopt;
    double wanted = kSafetyFactor * goal_ * rate_;
    if (budget > 0) wanted = std::min(wanted, kReduction * static_cast<double>(budget));
    reset();
    auto next = static_cast<std::uint64_t>(
        std::clamp(wanted, static_cast<double>(kMinBudget), static_cast<double>(kMaxBudget)));
    if (budget > 0) next = std::min(next, budget);
    return next == budget ? std::nullopt : std::optional(next);
  }
  if (budget == 0 || ++fast_ticks_ < kFastTicks) return std::nullopt;
  fast_ticks_ = 0;
  const double grown = kGrowth * static_cast<double>(budget);
  return grown > static_cast<double>(kMaxBudget) ? 0 : static_cast<std::uint64_t>(grown);
}

void Governor::reset() noexcept {
  slow_.fill(false);
  slow_ticks_ = 0;
  fast_ticks_ = 0;
  rate_ = 0.0;
}

}  // namespace tenon::simulation
