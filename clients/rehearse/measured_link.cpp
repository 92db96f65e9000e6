#include "clients/rehearse/measured_link.h"

#include <algorithm>

namespace tenon::rehearse {

void MeasuredLink::deliver(Tick now, haptic::Station& station) {
  link_.deliver(now, station, [&](const HandManifold& manifold) {
    loss_.received(manifold.hand, manifold.sent, nanoseconds(now));
    ages_.answerReceived(manifold, nanoseconds(now));
  });
  link_.deliverAnswers(now, [&](const ClockSync& answer) { clock_.receive(answer, nanoseconds(now)); });
  if (now % kPeriod != 0) return;
  measure(now);
  rates_.step(round_trip_, station.forceModel(),
              clock_.lossKnown() ? std::optional(choice_.loss) : std::nullopt, choice_.jitter);
  station.setLinkJitter(choice_.jitter + rates_.allowance());
  station.setLinkRoundTrip(round_trip_.value_or(0.0));
}

void MeasuredLink::measure(Tick now) {
  Telemetry telemetry;
  clock_.fill(telemetry, nanoseconds(now));
  ages_.fill(telemetry);
  const std::optional<double> lost = loss_.take();
  choice_ = chooser_.step({.input_gap = telemetry.input_gap,
                           .trip_jitter = telemetry.trip_jitter,
                           .age_jitter = telemetry.jitter,
                           .inputs_lost = telemetry.inputs_lost,
                           .answers_lost = rates_.slowAnswers() ? lost : std::nullopt,
                           .input_period = rates_.inputPeriod(1)});
  round_trip_ = telemetry.clock_known ? std::optional(telemetry.round_trip) : std::nullopt;
}

void MeasuredLink::send(std::span<const DeviceInput> inputs, Tick now) {
  const auto seq = static_cast<std::uint32_t>(now);
  std::uint32_t sent = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const auto input = pacer_.due(inputs[i], i, seq, rates_, choice_.playout_ticks);
    if (!input) continue;
    link_.send(*input, now);
    ++sent;
  }
  clock_.sent(seq, sent);
  ages_.inputSent(seq, nanoseconds(now), nanoseconds(1));
  ClockSync request;
  if (clock_.ask({}, nanoseconds(now), request)) link_.sendRequest(request, now);
}

void MeasuredLink::send(const session::OutgoingMessages& outgoing, Tick now) {
  const bool slow = rates_.slowAnswers();
  for (const WorldFrame& frame : slow ? outgoing.frames_100 : outgoing.frames) link_.send(frame, now);
  for (const HandManifold* manifold : slow ? outgoing.manifolds_50 : outgoing.manifolds) {
    HandManifold numbered = *manifold;
    numbered.sent = ++sent_[numbered.hand];
    link_.send(numbered, now);
  }
}

void MeasuredLink::receive(Tick now, ClientId client, session::SessionRegistry& registry,
                           FixedVector<session::HandReading, session::kMaxHands>& readings,
                           const std::function<void(const DeviceInput&, const std::string&)>& refused) {
  const auto put = [&](const DeviceInput& input) {
    if (const auto reading = registry.validateDeviceInput(input)) {
      buffer_.put(*reading);
    } else if (refused) {
      refused(input, reading.error().what);
    }
  };
  received_ += link_.receive(now, [&](const DeviceInput& input, std::uint32_t newest) {
    gaps_.received(nanoseconds(now));
    newest_seq_ = std::max(newest_seq_, input.sample.seq);
    buffer_.setPlayout(input.hand, choice_.playout_ticks);
    buffer_.setPeriod(input.hand, input.period);
    buffer_.setFreeze(input.hand, choice_.limits.freeze_ticks);
    // those before it whose own messages are lost or late
    DeviceInput one = input;
    for (std::size_t i = input.earlier.size(); i-- > 0 && choice_.playout_ticks > 0;) {
      one.sample = input.earlier[i];
      if (one.sample.seq > newest && one.sample.seq < input.sample.seq) put(one);
    }
    put(input);
  });
  link_.answerRequests(now, [&](ClockSync& sync) {
    sync.server_received_ns = sync.server_sent_ns = nanoseconds(now);
    sync.inputs_received = received_;
    sync.newest_seq = newest_seq_;
    sync.longest_gap = gaps_.longest(nanoseconds(now));
  });
  buffer_.collect(now, taken_);
  for (const session::HandReading& reading : taken_.readings) readings.push_back(reading);
  // the choice is the station's: it is here after the link's delay
  if (now % kPeriod == kPeriod / 2)
    registry.setLimits(client, choice_.limits, round_trip_.value_or(0.0),
                       [this](HandId hand) { return buffer_.keptBack(hand); });
}

}  // namespace tenon::rehearse
