#include "server/session/reading_playout.h"

#include <algorithm>

#include "idl/types/resolution.h"

namespace tenon::session {

HandReading between(const HandReading& from, const HandReading& to, std::uint32_t seq) noexcept {
  const double share = static_cast<double>(seq - from.seq) / static_cast<double>(to.seq - from.seq);
  // chord instead of arc: of two samples 20 ms apart they differ by less than the resolution
  const Eigen::Vector4d q_from = from.X_WH.rotation().coeffs();
  Eigen::Vector4d q_to = to.X_WH.rotation().coeffs();
  if (q_from.dot(q_to) < 0.0) q_to = -q_to;
  const Vector3& p_from = from.X_WH.translation();
  Pose X_WH(p_from + share * (to.X_WH.translation() - p_from), Quaternion::Identity());
  X_WH.rotation().coeffs() = (q_from + share * (q_to - q_from)).normalized();
  const Twist V_WH{from.V_WH.linear + share * (to.V_WH.linear - from.V_WH.linear),
                   from.V_WH.angular + share * (to.V_WH.angular - from.V_WH.angular)};
  return {from.hand, seq, from.active && to.active, rounded(X_WH), rounded(V_WH), from.buttons};
}

void ReadingPlayout::add(const HandReading& reading) noexcept {
  if (heard_ && !isBefore(*heard_, reading.seq)) return;
  heard_ = reading.seq;
  if (waiting_.full()) {
    ++replaced_;
    dropFirst(1);
  }
  waiting_.push_back(reading);
}

void ReadingPlayout::clear() noexcept {
  waiting_.clear();
  heard_.reset();
  from_.reset();
  most_behind_ = {};
  in_window_ = 0;
}

const HandReading* ReadingPlayout::take(const HandReading& newest) noexcept {
  waiting_.clear();
  heard_ = newest.seq;
  from_ = taken_ = newest;
  return &taken_;
}

const HandReading* ReadingPlayout::takeBehind(std::uint32_t playout) noexcept {
  if (waiting_.empty()) return nullptr;
  const std::uint32_t due = waiting_[waiting_.size() - 1].seq - playout;
  std::size_t next = 0;
  while (next + 1 < waiting_.size() && !isBefore(due, waiting_[next + 1].seq)) ++next;
  from_ = taken_ = waiting_[next];
  replaced_ += static_cast<std::uint32_t>(next);
  dropFirst(next + 1);
  return &taken_;
}

std::uint32_t ReadingPlayout::behind() const noexcept {
  return from_ && !waiting_.empty() ? waiting_[waiting_.size() - 1].seq - taken_.seq : 0;
}

const HandReading* ReadingPlayout::takeBetween(std::uint32_t period, bool was_frozen) noexcept {
  const HandReading* const taken = advance(period, was_frozen);
  if (in_window_ == kWindow) {
    most_behind_ = {0, most_behind_[0]};
    in_window_ = 0;
  }
  ++in_window_;
  most_behind_[0] = std::max(most_behind_[0], behind());
  return taken;
}

const HandReading* ReadingPlayout::advance(std::uint32_t period, bool was_frozen) noexcept {
  if (!from_) return waiting_.empty() ? nullptr : take(HandReading(waiting_[waiting_.size() - 1]));
  const std::uint32_t ahead = behind();
  if (ahead == 0) return nullptr;
  const std::uint32_t usual = period > 1 ? kUsualPeriodsBehind * period : 1;  // [ticks] behind
  // an eighth faster: who is pushed by the hand feels little of it
  std::uint32_t step = ahead > usual && taken_.seq % 8 == 0 ? 2 : 1;
  if (ahead > kMostPeriodsBehind * period) step = 2;
  const bool is_lost = was_frozen || ahead > std::max(kMostPeriodsBehind * period, kMostFreezeTicks);
  if (is_lost && ahead > period) step = ahead - period;
  const std::uint32_t seq = taken_.seq + step;
  std::size_t passed = 0;
  while (passed < waiting_.size() && !isBefore(seq, waiting_[passed].seq)) ++passed;
  if (passed > 0) from_ = waiting_[passed - 1];
  dropFirst(passed);
  taken_ = from_->seq == seq ? *from_ : between(*from_, waiting_[0], seq);
  return &taken_;
}

void ReadingPlayout::dropFirst(std::size_t count) noexcept {
  std::copy(waiting_.begin() + count, waiting_.end(), waiting_.begin());
  waiting_.resize(waiting_.size() - count);
}

}  // namespace tenon::session
