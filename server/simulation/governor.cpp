#include "server/simulation/governor.h"

#include <algorithm>

namespace tenon {
namespace {

/// Of what the machine can do in the time, a budget is this share: ticks differ in what a point costs them.
constexpr double kShare = 0.8;
/// A budget that is kept and still too much is cut by this, and one that is too small grows by it.
constexpr double kCut = 0.85;
constexpr double kGrowth = 1.25;

}  // namespace

std::optional<std::uint64_t> Governor::judge(double seconds, std::uint64_t points,
                                             std::uint64_t budget) noexcept {
  const bool slow = seconds > goal_;
  slow_ticks_ -= slow_[next_] ? 1 : 0;
  slow_ticks_ += slow ? 1 : 0;
  slow_[next_] = slow;
  next_ = (next_ + 1) % kWindow;
  if (slow) {
    calm_ticks_ = 0;
    rate_ = std::max(slow_ticks_ == 1 ? 0.0 : rate_, static_cast<double>(points) / seconds);
    if (slow_ticks_ < kSlowTicks) return std::nullopt;
    double wanted = kShare * goal_ * rate_;
    if (budget > 0) wanted = std::min(wanted, kCut * static_cast<double>(budget));
    forget();
    auto next = static_cast<std::uint64_t>(
        std::clamp(wanted, static_cast<double>(kLeastBudget), static_cast<double>(kMostBudget)));
    if (budget > 0) next = std::min(next, budget);
    return next == budget ? std::nullopt : std::optional(next);
  }
  if (budget == 0 || ++calm_ticks_ < kCalmTicks) return std::nullopt;
  calm_ticks_ = 0;
  const double grown = kGrowth * static_cast<double>(budget);
  return grown > static_cast<double>(kMostBudget) ? 0 : static_cast<std::uint64_t>(grown);
}

void Governor::forget() noexcept {
  slow_.fill(false);
  slow_ticks_ = 0;
  calm_ticks_ = 0;
  rate_ = 0.0;
}

}  // namespace tenon
