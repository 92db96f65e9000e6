#include "clients/haptic/servo_loop.h"

namespace tenon::haptic {

namespace {
constexpr std::uint32_t kTelemetryEvery = 1000;  // [cycles]
constexpr std::int64_t kCycleNs = 1'000'000;
}  // namespace

void StationOutput::fill(const Station& station, std::uint32_t now) noexcept {
  seq = now;
  inputs.clear();
  states.clear();
  for (const DeviceInput& input : station.inputs()) inputs.push_back(input);
  for (const HandState& state : station.states()) states.push_back(state);
}

void PeakForces::add(const StationOutput& output) noexcept {
  for (std::size_t i = 0; i < output.states.size(); ++i) {
    const auto force = static_cast<float>(output.states[i].F_Ho_W.force.norm());
    float peak = forces_[i].load(std::memory_order_relaxed);
    // who takes alone competes, once in a HandState: two tries suffice
    for (int tries = 0; tries < 2 && force > peak; ++tries)
      if (forces_[i].compare_exchange_strong(peak, force, std::memory_order_relaxed)) break;
  }
}

Telemetry ServoLoop::statistics() {
  Telemetry telemetry;
  force_age_.fill(telemetry);
  return telemetry;
}

void ServoLoop::receiveAll(std::int64_t now) noexcept {
  for (; frames_.front() != nullptr; frames_.pop()) station_.receive(*frames_.front());
  for (; manifolds_.front() != nullptr; manifolds_.pop()) {
    const HandManifold& manifold = *manifolds_.front();
    if (station_.receive(manifold)) force_age_.answerReceived(manifold, now);
  }
  for (; guidances_.front() != nullptr; guidances_.pop()) station_.receive(*guidances_.front());
  for (; steps_.front() != nullptr; steps_.pop()) station_.receive(*steps_.front());
  for (; matrices_.front() != nullptr; matrices_.pop()) station_.receive(*matrices_.front());
  if (stop_.update()) station_.receive(stop_.value());
}

void ServoLoop::cycle() noexcept {
  const std::int64_t now = clock_->now().count();
  // before a raise that came after them, which asks for another one
  for (; presses_.front() != nullptr; presses_.pop()) station_.press();
  receiveAll(now);
  station_.setForceModel(force_model_);
  const Finish finish = finish_;
  if (finish == Finish::kRest || finish == Finish::kDisarm) station_.finish(finish == Finish::kDisarm);
  if (last_cycle_ != 0) station_.setCycle(static_cast<double>(now - last_cycle_) * 1e-9);
  last_cycle_ = now;
  station_.setLinkJitter(link_jitter_);
  station_.setLinkRoundTrip(link_round_trip_);
  station_.step(++seq_);
  if (finish == Finish::kRest || finish == Finish::kDisarm) {
    Finish asked = finish;
    if (station_.finished()) finish_.compare_exchange_strong(asked, Finish::kDone);
  }
  force_age_.inputSent(seq_, now, kCycleNs);
  output_.back().fill(station_, seq_);
  peaks_.add(output_.back());
  output_.publish();
  StationEvent event;
  while (station_.takeEvent(event)) events_.push(event);
  if (seq_ % kTelemetryEvery == 0) {
    force_age_.fill(telemetry_.back());
    telemetry_.publish();
  }
  wake_();
}

}  // namespace tenon::haptic
