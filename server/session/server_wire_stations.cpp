// What stations send of their hands and links, and what they get for it.
#include <algorithm>
#include <chrono>
#include <cstdint>

#include <fmt/format.h>

#include "server/session/server_wire.h"

namespace tenon::session {
namespace {

constexpr auto kBetweenLimits = std::chrono::milliseconds(500);  // changes of a station's limits
constexpr std::uint32_t kLoggedFreezeStep = 30;  // [ticks] smaller changes of a freeze limit are not logged

std::int64_t nowNanoseconds() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

}  // namespace

/// Of a client that has got a seat.
void ServerWire::beginInputs(const Welcome& welcome) {
  for (const HandId hand : welcome.hands) {
    if (!hand.valid()) continue;
    newest_seq_[hand.value] = 0;
    input_buffer_.restart(hand);
    passFreezeLimit(hand);
  }
  received_inputs_.erase(welcome.client);
  contributions_.end(welcome.client);  // of a former presence
}

void ServerWire::handle(const DeviceInput& input, const wire::Origin& from) {
  // of a station that is on its way back from an earlier life of the server
  if (input.server_epoch != options_.server_epoch && !registry_.ownsSeat(input.client, from)) return;
  if (!isGenuine(input.client, from, "device input")) return;
  const Presence* sender = registry_.findClient(input.client);
  if (sender != nullptr && !sender->alive && input.server_epoch == options_.server_epoch)
    return reception_->notifySeatLost(input.client, "its process or link was lost");
  const auto reading = registry_.validateDeviceInput(input);
  if (!reading) return refuse(reading.error().what);
  ReceivedInputs& received = received_inputs_[input.client];
  ++received.count;
  received.gaps.received(nowNanoseconds());
  received.newest_seq = std::max(received.newest_seq, reading->seq);
  std::uint32_t& newest = newest_seq_[input.hand.value];
  if (options_.lockstep && reading->seq == newest && newest == now_) resend_requested_ = true;
  if (reading->seq <= newest && newest - reading->seq < 0x80000000U) return;  // out of order, or a repetition
  if (options_.lockstep && reading->seq > now_ + 1)
    return reception_->dismiss(
        input.client, fmt::format("sent the input of tick {} when tick {} was the next, and is removed: in "
                                  "lockstep an input answers a received tick",
                                  reading->seq, now_ + 1));
  if (!options_.lockstep) input_buffer_.setPeriod(input.hand, input.period);
  if (input_buffer_.playout(input.hand) > 0) handleEarlier(input, newest);
  newest = reading->seq;
  input_buffer_.put(*reading);
}

/// Those after `newest`, whose own messages are lost or late.
void ServerWire::handleEarlier(const DeviceInput& input, std::uint32_t newest) {
  DeviceInput one = input;
  for (std::size_t i = input.earlier.size(); i-- > 0;) {
    one.sample = input.earlier[i];
    if (one.sample.seq <= newest || one.sample.seq >= input.sample.seq) continue;
    if (const auto reading = registry_.validateDeviceInput(one)) input_buffer_.put(*reading);
  }
}

void ServerWire::handle(const ClockSync& sync) {
  if (sync.server_sent_ns != 0) return;  // the server's own answer
  ClockSync answer = sync;
  answer.server_received_ns = nowNanoseconds();
  if (const auto inputs = received_inputs_.find(sync.client); inputs != received_inputs_.end()) {
    answer.inputs_received = inputs->second.count;
    answer.newest_seq = inputs->second.newest_seq;
    answer.longest_gap = inputs->second.gaps.longest(nowNanoseconds());
    for (const HandId hand : registry_.findClient(sync.client)->hands) {
      answer.inputs_replaced += input_buffer_.replaced(hand);
      answer.ticks_without_input += input_buffer_.missed(hand);
    }
  }
  answer.server_sent_ns = nowNanoseconds();
  writers_->clock.send(answer);
}

/// What a station asks for by what its link does. In lockstep the server waits for inputs: no limit applies.
void ServerWire::handle(const Telemetry& telemetry) {
  registry_.receive(telemetry);
  const auto inputs = received_inputs_.find(telemetry.client);
  if (options_.lockstep || inputs == received_inputs_.end()) return;
  const Presence& station = *registry_.findClient(telemetry.client);
  for (const HandId hand : station.hands)
    if (registry_.controllerOf(hand) == telemetry.client)
      input_buffer_.setPlayout(hand, telemetry.playout_ticks);
  if (telemetry.guidance_alone != inputs->second.guidance_alone) {
    inputs->second.guidance_alone = telemetry.guidance_alone;
    logDelay(station.name, telemetry);
  }
  const auto now = std::chrono::steady_clock::now();
  if (now - inputs->second.limits_set_at < kBetweenLimits) return;
  const double round_trip = telemetry.clock_known ? telemetry.round_trip : 0.0;
  const auto kept_back = [this](HandId hand) { return input_buffer_.keptBack(hand); };
  if (!registry_.setLimits(telemetry.client, telemetry.limits, round_trip, kept_back)) return;
  for (const HandId hand : station.hands)
    if (registry_.controllerOf(hand) == telemetry.client) passFreezeLimit(hand);
  inputs->second.limits_set_at = now;
  const HandLimits& limits = registry_.limitsOf(station.hands.front());
  std::uint32_t& logged = inputs->second.logged_freeze;
  if (std::max(limits.freeze_ticks, logged) - std::min(limits.freeze_ticks, logged) < kLoggedFreezeStep)
    return;
  logged = limits.freeze_ticks;
  log(Severity::kInfo, "link",
      fmt::format(
          "{}: a hand without input is held still after {} ms and parked after {} ms; inputs come up to "
          "{:.0f} ms apart, {:.2f} % are lost",
          station.name, limits.freeze_ticks, limits.park_ticks,
          1e3 * inputs->second.gaps.longest(nowNanoseconds()), 1e2 * telemetry.inputs_lost));
}

/// Half of the age of what a station renders is the link's delay, one way.
void ServerWire::logDelay(const std::string& person, const Telemetry& telemetry) {
  const double delay = 0.5 * telemetry.age;  // [s]
  log(Severity::kInfo, "link",
      telemetry.guidance_alone
          ? fmt::format("{}: contacts are not felt over this link: {:.0f} ms one way, {:.0f} ms at most; "
                        "guidance continues",
                        person, 1e3 * delay, 1e3 * kLongestContactDelay)
          : fmt::format("{}: contacts are felt again", person));
}

void ServerWire::passFreezeLimit(HandId hand) {
  input_buffer_.setFreeze(hand, std::max(static_cast<std::uint32_t>(options_.limits.freeze),
                                         registry_.limitsOf(hand).freeze_ticks));
}

void ServerWire::publishLimits() {
  for (SceneHand& hand : scene_hands_) {
    const auto station = received_inputs_.find(registry_.controllerOf(hand.hand));
    const bool guidance_alone = station != received_inputs_.end() && station->second.guidance_alone;
    if (hand.limits == registry_.limitsOf(hand.hand) && hand.guidance_alone == guidance_alone) continue;
    hand.limits = registry_.limitsOf(hand.hand);
    hand.guidance_alone = guidance_alone;
    writers_->hand.send(hand);
  }
}

}  // namespace tenon::session
