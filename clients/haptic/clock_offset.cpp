#include "clients/haptic/clock_offset.h"

#include <algorithm>

namespace tenon::haptic {

void ClockOffset::add(const ClockSync& answer, std::int64_t now_ns) noexcept {
  const std::int64_t in_server = answer.server_sent_ns - answer.server_received_ns;
  const std::int64_t round_trip = now_ns - answer.sent_ns - in_server;
  if (in_server < 0 || round_trip < 0) return;
  const std::int64_t forth = answer.server_received_ns - answer.sent_ns;
  const std::int64_t back = answer.server_sent_ns - now_ns;
  exchanges_[count_++ % kExchanges] = {round_trip, back + (forth - back) / 2, now_ns};
}

const ClockOffset::Exchange& ClockOffset::best() const noexcept {
  return *std::min_element(exchanges_.begin(), exchanges_.end(),
                           [](const Exchange& a, const Exchange& b) { return a.round_trip < b.round_trip; });
}

double ClockOffset::offset() const noexcept { return static_cast<double>(best().offset) * 1e-9; }

double ClockOffset::error(std::int64_t now_ns) const noexcept {
  if (!known()) return std::numeric_limits<double>::infinity();
  const Exchange& exchange = best();
  return 0.5e-9 * static_cast<double>(exchange.round_trip) +
         1e-9 * kDrift * static_cast<double>(now_ns - exchange.at);
}

double ClockOffset::roundTrip() const noexcept {
  return known() ? 1e-9 * static_cast<double>(shortestTrip(kTrips)) : 0.0;
}

/// [ns] Of the last `count` exchanges.
std::int64_t ClockOffset::shortestTrip(std::uint64_t count) const noexcept {
  std::int64_t shortest = std::numeric_limits<std::int64_t>::max();
  for (std::uint64_t i = 0; i < std::min(count, count_); ++i)
    shortest = std::min(shortest, exchanges_[(count_ - 1 - i) % kExchanges].round_trip);
  return shortest;
}

double ClockOffset::tripJitter() const noexcept {
  std::array<std::int64_t, kExchanges> trips{};
  const std::size_t count = std::min<std::size_t>(count_, kExchanges);
  if (count == 0) return 0.0;
  for (std::size_t i = 0; i < count; ++i) trips[i] = exchanges_[i].round_trip;
  const auto rank = trips.begin() + static_cast<std::ptrdiff_t>(count * 9 / 10);
  std::nth_element(trips.begin(), rank, trips.begin() + static_cast<std::ptrdiff_t>(count));
  return 1e-9 * static_cast<double>(*rank - best().round_trip);
}

}  // namespace tenon::haptic
