#include "server/simulation/force_buffer.h"

#include <algorithm>
#include <cassert>

namespace tenon::simulation {
namespace {

Vector3 clamped(const Vector3& v, double limit) {
  const double norm = v.norm();
  return norm > limit ? Vector3(v * (limit / norm)) : v;
}

bool alive(const ForceCell& cell, Tick now) { return cell.used && now - cell.stamp < cell.lifetime_ticks; }

double weight(const ForceCell& cell, Tick now) {
  if (cell.lifetime_ticks == 0) return 1.0;
  if (!alive(cell, now)) return 0.0;
  return 1.0 - static_cast<double>(now - cell.stamp) / cell.lifetime_ticks;
}

}  // namespace

ForceBuffer::ForceBuffer(std::size_t own_cells) : cells_(own_cells + kContributions), own_cells_(own_cells) {
  used_.reserve(own_cells);
}

void ForceBuffer::write(std::size_t cell, const Wrench& F_Bq_W, Tick now) noexcept {
  assert(cell < own_cells_);
  const auto index = static_cast<std::uint32_t>(cell);
  if (!cells_[cell].used) used_.insert(std::lower_bound(used_.begin(), used_.end(), index), index);
  cells_[cell] = {F_Bq_W, now, 0, 0, true};
}

void ForceBuffer::clear(std::size_t cell) noexcept {
  assert(cell < own_cells_);
  if (!cells_[cell].used) return;
  used_.erase(std::lower_bound(used_.begin(), used_.end(), static_cast<std::uint32_t>(cell)));
  cells_[cell] = ForceCell{};
}

bool ForceBuffer::contribute(std::uint32_t source, const Wrench& F_Bq_W, std::uint32_t lifetime_ticks,
                             Tick now) noexcept {
  // [N], [Nm] the squared norm of larger values overflows
  constexpr double kMaxComponent = 1e100;
  const auto valid = [](const Vector3& v) {
    return v.allFinite() && v.cwiseAbs().maxCoeff() < kMaxComponent;
  };
  const auto contributions = std::span(cells_).subspan(own_cells_);
  auto slot = std::find_if(contributions.begin(), contributions.end(),
                           [&](const ForceCell& cell) { return cell.used && cell.source == source; });
  if (slot == contributions.end()) {
    slot = std::find_if(contributions.begin(), contributions.end(),
                        [&](const ForceCell& cell) { return !alive(cell, now); });
  }
  if (slot == contributions.end() || lifetime_ticks == 0 || !valid(F_Bq_W.force) || !valid(F_Bq_W.torque)) {
    ++rejected_;
    return false;
  }
  *slot = {{clamped(F_Bq_W.force, kMaxContributedForce), clamped(F_Bq_W.torque, kMaxContributedTorque)},
           now,
           source,
           std::min(lifetime_ticks, kMaxLifetimeTicks),
           true};
  contributing_ = static_cast<std::uint8_t>(contributing_ | 1U << (slot - contributions.begin()));
  return true;
}

void ForceBuffer::expire(Tick now) noexcept {
  if (contributing_ == 0) return;
  const auto contributions = std::span(cells_).subspan(own_cells_);
  for (std::size_t i = 0; i < contributions.size(); ++i) {
    if (!contributions[i].used || alive(contributions[i], now)) continue;
    contributions[i] = ForceCell{};
    contributing_ = static_cast<std::uint8_t>(contributing_ & ~(1U << i));
  }
}

Wrench ForceBuffer::total(Tick now) const noexcept {
  Wrench sum;
  for (const std::uint32_t cell : used_) sum += cells_[cell].F_Bq_W;
  if (contributing_ == 0) return sum;
  for (const ForceCell& cell : std::span(cells_).subspan(own_cells_)) sum += cell.F_Bq_W * weight(cell, now);
  return sum;
}

Wrench ForceBuffer::contributed(Tick now) const noexcept {
  Wrench sum;
  if (contributing_ == 0) return sum;
  for (const ForceCell& cell : std::span(cells_).subspan(own_cells_)) sum += cell.F_Bq_W * weight(cell, now);
  return sum;
}

}  // namespace tenon::simulation
