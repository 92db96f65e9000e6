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

/// [-] since the last Telemetry; none: not known.
std::optional<double> LinkAdaptation::answersLost(const Telemetry& telemetry, bool slow_answers) {
  const std::uint64_t answers = telemetry.samples - std::exchange(answers_counted_, telemetry.samples);
  if (!slow_answers || answers < 2) return std::nullopt;
  return telemetry.answers_lost;
}

void LinkAdaptation::measure(Telemetry& telemetry, bool slow_answers) {
  clock_.fill(telemetry, nowNs());
  choice_ = limits_.step({.input_gap = telemetry.input_gap,
                          .trip_jitter = telemetry.trip_jitter,
                          .age_jitter = telemetry.jitter,
                          .inputs_lost = telemetry.inputs_lost,
                          .answers_lost = answersLost(telemetry, slow_answers),
                          .input_period = rates_.inputPeriod(1)});
  telemetry.limits = choice_.limits;
  telemetry.playout_ticks = choice_.playout_ticks;
  late_cycles_ = telemetry.loop_overruns - std::exchange(late_cycles_counted_, telemetry.loop_overruns);
  round_trip_ = telemetry.clock_known ? std::optional(telemetry.round_trip) : std::nullopt;
}

bool LinkAdaptation::chooseRates() {
  rates_.step(round_trip_, model_, clock_.lossKnown() ? std::optional(choice_.loss) : std::nullopt,
              choice_.jitter);
  return rates_.slowAnswers();
}

}  // namespace tenon::haptic
