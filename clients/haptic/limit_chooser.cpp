#include "clients/haptic/limit_chooser.h"

#include <algorithm>
#include <cmath>

namespace tenon::haptic {

namespace {
constexpr double kMachines = 0.020;  // [s] of a silence that is not the link's
constexpr double kStep = 10.0;       // [ticks] of a limit
constexpr double kRare = 1e-6;       // [-] share of inputs that begin an expected gap
constexpr double kLongestGap = 0.3;  // [s] a longer one is a partition, which says nothing of the link
constexpr double kJitterOfWholeTicks = 0.002;  // [s] above it inputs come in no order that keeping back helps
constexpr double kAnswersWeight = 0.1;         // [-] of a measurement in the mean loss of answers
constexpr double kForgotten = 0.01;            // [-] of that in a second that tells nothing of it
constexpr double kMostLoss = 0.2;  // [-] above it a second had an interruption, or keeping back helps no more

/// [s] of inputs lost one after the other, as rarely as kRare.
double expectedGap(double lost, std::uint32_t period) {
  if (!(lost > 0.0)) return 0.0;
  const double share = std::min(lost, 0.9);
  return period * kTickSeconds * std::ceil(std::log(kRare) / std::log(share));
}

std::uint32_t playoutFor(double lost, double trip_jitter) {
  if (!(lost > 0.0) || trip_jitter > kJitterOfWholeTicks) return 0;
  std::uint32_t ticks = 0;
  for (double left = lost; left > LimitChooser::kAllowedLoss && ticks < LimitChooser::kMostPlayout;
       left *= lost)
    ++ticks;
  return ticks;
}
}  // namespace

LinkChoice LimitChooser::step(const LinkMeasurement& now) noexcept {
  if (ignored_ == 0) {
    last_[count_++ % kMemory] = now;
    averageAnswers(now.answers_lost);
  }
  if (ignored_ > 0) --ignored_;
  LinkMeasurement worst;
  double steady_loss = 0.0;  // [-] without interruptions
  for (const LinkMeasurement& one : last_) {
    // the order of comparisons leaves out NaN
    if (one.input_gap > worst.input_gap && one.input_gap <= kLongestGap) worst.input_gap = one.input_gap;
    if (one.trip_jitter > worst.trip_jitter) worst.trip_jitter = one.trip_jitter;
    if (one.age_jitter > worst.age_jitter) worst.age_jitter = one.age_jitter;
    if (one.inputs_lost > worst.inputs_lost) worst.inputs_lost = one.inputs_lost;
    if (one.inputs_lost > steady_loss && one.inputs_lost <= kMostLoss) steady_loss = one.inputs_lost;
  }
  const double gap = std::min(
      kLongestGap,
      std::max(worst.input_gap, worst.trip_jitter + expectedGap(worst.inputs_lost, now.input_period)));
  const double wanted = kStep * std::ceil((kMachines + 2.0 * gap) / kTickSeconds / kStep);
  LinkChoice choice;
  choice.limits.freeze_ticks = std::clamp(static_cast<std::uint32_t>(wanted), kFreezeTicks, kMostFreezeTicks);
  choice.limits.park_ticks = kParkTicks + 10 * (choice.limits.freeze_ticks - kFreezeTicks);
  choice.loss = std::max(steady_loss, answers_lost_);
  choice.jitter = worst.age_jitter;
  // sparse inputs carry no earlier ones: the server fills what is between them
  choice.playout_ticks = now.input_period > 1 ? 0 : playoutFor(steady_loss, worst.trip_jitter);
  return choice;
}

/// What made a station hear at 1 kHz, where it is not known, is forgotten slowly. Seconds above kMostLoss
/// count once more of them follow each other than an interruption takes.
void LimitChooser::averageAnswers(std::optional<double> lost) noexcept {
  above_most_ = lost > kMostLoss ? above_most_ + 1 : 0;
  if (lost && (*lost <= kMostLoss || above_most_ > kInterrupted)) {
    answers_lost_ += kAnswersWeight * (std::min(*lost, kMostLoss) - answers_lost_);
  } else {
    answers_lost_ -= kForgotten * answers_lost_;
  }
}

}  // namespace tenon::haptic
