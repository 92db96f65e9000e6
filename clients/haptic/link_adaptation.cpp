#include "clients/haptic/link_adaptation.h"

#include <chrono>
#include <utility>

namespace tenon::haptic {

namespace {

std::int64_t nowNs() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

}  // namespace

Result<void> LinkAdaptation::subscribe() {
  return link_.inbox().onFrom<ClockSync>(
      link_.member().session(), wire::kClockSync, [this](const ClockSync& answer, const wire::Origin& from) {
        if (answer.client != link_.welcome().client || answer.server_sent_ns == 0) return;
        if (link_.member().isServer(from)) clock_.receive(answer, nowNs());
      });
}

void LinkAdaptation::askClock() {
  ClockSync request;
  if (clock_.ask(link_.welcome().client, nowNs(), request)) static_cast<void>(link_.send(request));
}

/// Of the last second; a servo loop that is new counts from 0.
std::uint64_t LinkAdaptation::lateCycles(const Telemetry& telemetry) {
  const std::uint64_t counted = std::exchange(late_cycles_counted_, telemetry.loop_overruns);
  return telemetry.loop_overruns - (counted <= telemetry.loop_overruns ? counted : 0);
}

void LinkAdaptation::measure(Telemetry& telemetry, std::optional<double> slow_lost) {
  clock_.fill(telemetry, nowNs());
  choice_ = limits_.step({.input_gap = telemetry.input_gap,
                          .trip_jitter = telemetry.trip_jitter,
                          .age_jitter = telemetry.jitter,
                          .inputs_lost = telemetry.inputs_lost,
                          .answers_lost = slow_lost,
                          .input_period = rates_.inputPeriod(1)});
  telemetry.limits = choice_.limits;
  telemetry.playout_ticks = choice_.playout_ticks;
  late_cycles_ = lateCycles(telemetry);
  round_trip_ = telemetry.clock_known ? std::optional(telemetry.round_trip) : std::nullopt;
}

bool LinkAdaptation::chooseRates() {
  rates_.step(round_trip_, model_, clock_.lossKnown() ? std::optional(choice_.loss) : std::nullopt,
              choice_.jitter);
  return rates_.slowAnswers();
}

}  // namespace tenon::haptic
