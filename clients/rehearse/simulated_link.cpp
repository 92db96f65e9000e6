#include "clients/rehearse/simulated_link.h"

#include <algorithm>

namespace tenon::rehearse {

std::optional<Tick> LinkDirection::arrival(Tick now) {
  if (isLost(now)) return std::nullopt;
  const Tick longer = options_.jitter > 0
                          ? static_cast<Tick>(random_.uniform(0.0, static_cast<double>(options_.jitter + 1)))
                          : 0;
  return now + options_.delay + longer;
}

bool LinkDirection::isLost(Tick now) {
  if (options_.loss <= 0.0) return false;
  if (options_.burst == 0) return random_.uniform(0.0, 1.0) < options_.loss;
  // Gilbert's model: the shares of both states follow from the mean length of a gap
  const double leave = 1.0 / static_cast<double>(options_.burst);
  const double enter = leave * options_.loss / (1.0 - options_.loss);
  for (; now_ < now; ++now_) in_burst_ = random_.uniform(0.0, 1.0) < (in_burst_ ? 1.0 - leave : enter);
  return in_burst_;
}

void SimulatedLink::send(const DeviceInput& input, Tick now) {
  if (const auto arrival = up_.arrival(now)) inputs_.put(input, *arrival);
}

void SimulatedLink::send(const WorldFrame& frame, Tick now) {
  if (const auto arrival = down_.arrival(now)) frames_.put(frame, *arrival + 1);
}

void SimulatedLink::send(const HandManifold& manifold, Tick now) {
  if (const auto arrival = down_.arrival(now)) manifolds_.put(manifold, *arrival + 1);
}

std::uint32_t SimulatedLink::receive(Tick now,
                                     const std::function<void(const DeviceInput&, std::uint32_t)>& take) {
  std::uint32_t count = 0;
  inputs_.deliver(now, [&](const DeviceInput& input) {
    ++count;
    const std::uint32_t seq = input.sample.seq;
    auto known = std::find_if(newest_.begin(), newest_.end(),
                              [&](const auto& one) { return one.first == input.hand; });
    if (known == newest_.end()) known = newest_.insert(known, {input.hand, seq - 1});
    const std::uint32_t newest = known->second;
    if (static_cast<std::int32_t>(seq - newest) <= 0) return;
    known->second = seq;
    take(input, newest);
  });
  return count;
}

void SimulatedLink::deliver(Tick now, haptic::Station& station,
                            const std::function<void(const HandManifold&)>& heard) {
  frames_.deliver(now, [&](const WorldFrame& frame) { station.receive(frame); });
  manifolds_.deliver(now, [&](const HandManifold& manifold) {
    if (station.receive(manifold)) heard(manifold);
  });
}

void SimulatedLink::sendRequest(const ClockSync& request, Tick now) {
  if (const auto arrival = requests_up_.arrival(now)) requests_.put(request, *arrival);
}

void SimulatedLink::answerRequests(Tick now, const std::function<void(ClockSync&)>& answer) {
  requests_.deliver(now, [&](ClockSync sync) {
    answer(sync);
    if (const auto arrival = answers_down_.arrival(now)) answers_.put(sync, *arrival + 1);
  });
}

void SimulatedLink::deliverAnswers(Tick now, const std::function<void(const ClockSync&)>& take) {
  answers_.deliver(now, take);
}

}  // namespace tenon::rehearse
