#include "tests/bench/engine/insertion.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "tests/bench/engine/sessions.h"
#include "tests/bench/engine/timing.h"

namespace tenon::bench {

namespace {

constexpr const char* kStep = "mount_control_box";

/// Records force, penetration, load and computation time of the insertion step until it is done.
class InsertionMonitor {
 public:
  InsertionMonitor(const session::LoadedScene& loaded, report::SessionAnalysis& analysis)
      : hand_(loaded.scenario->handNamed("right")), analysis_(analysis) {
    const auto& states = loaded.scenario->states;
    for (std::uint32_t i = 0; i < states.size(); ++i)
      if (states[i].name == kStep) step_ = i;
  }

  void record(const session::TickInput& input, const session::TickOutput& output) {
    for (const session::HandReading& reading : input.readings)
      if (reading.hand == hand_) X_WH_ = reading.X_WH;
    if (output.step.step > step_) done_ = true;
    if (done_ || output.step.step != step_) return;
    if (first_ == 0) first_ = output.tick;
    const double time = static_cast<double>(output.tick - first_) * kTickSeconds;
    if (preempted_.sinceLastCall())
      ++preempted_ticks_;
    else
      undisturbed_.push_back(1e6 * output.stats.compute_seconds);
    const HandManifold& manifold = output.manifolds[hand_.value];
    double depth = 0.0;
    for (const session::PairState& state : output.pairs) {
      const PairContact& pair = state.contact;
      if (pair.a == manifold.object || pair.b == manifold.object) depth = std::max(depth, pair.depth);
    }
    add(analysis_.trainee_force, time, manifold.F_Ho_W.force.norm());
    add(analysis_.gap, time, (manifold.X_WO.translation() - (X_WH_ * manifold.X_HO).translation()).norm());
    add(analysis_.depth, time, depth);
    add(analysis_.load, time, output.stats.load_percent);
    add(analysis_.compute, time, output.stats.compute_seconds);
    add(analysis_.compute_max, time, output.stats.compute_seconds);
    analysis_.duration = time;
    if (output.step.contact_seconds > 0.0) analysis_.whole.contact_seconds = output.step.contact_seconds;
  }

  [[nodiscard]] bool done() const { return done_; }
  /// [us] Of ticks during which the thread was not preempted.
  [[nodiscard]] Percentiles times() const { return percentilesOf(undisturbed_); }
  [[nodiscard]] std::size_t preemptedTicks() const { return preempted_ticks_; }

 private:
  static void add(report::Series& series, double time, double value) { series.push_back({time, value}); }

  HandId hand_;
  report::SessionAnalysis& analysis_;
  std::uint32_t step_ = 0;
  Tick first_ = 0;
  bool done_ = false;
  Pose X_WH_;
  Preemption preempted_;
  std::vector<double> undisturbed_;  ///< [us]
  std::size_t preempted_ticks_ = 0;
};

double largest(const report::Series& series) {
  double value = 0.0;
  for (const report::SeriesPoint& point : series) value = std::max(value, point.value);
  return value;
}

/// Mean of the positive values.
double mean(const report::Series& series) {
  double sum = 0.0;
  double count = 0.0;
  for (const report::SeriesPoint& point : series) {
    sum += point.value;
    count += point.value > 0.0 ? 1.0 : 0.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

void summarize(report::SessionAnalysis& analysis, const Percentiles& compute) {
  report::SessionMetrics& whole = analysis.whole;
  whole.peak_force = largest(analysis.trainee_force);
  whole.mean_force = mean(analysis.trainee_force);
  whole.gap = largest(analysis.gap);
  whole.depth = largest(analysis.depth);
  whole.load = largest(analysis.load);
  analysis.compute_median = 1e-6 * compute.median;
  analysis.compute_p99 = 1e-6 * compute.p99;
  analysis.compute_worst = 1e-6 * compute.max;
  analysis.title = "Control box insertion";
  analysis.session = "bench";
  analysis.began_ns = std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
  analysis.lockstep = true;
  analysis.steps = 1;
  analysis.has_run = true;
  analysis.run.phase = RunPhase::kSucceeded;
  report::StepVisit visit;
  visit.name = kStep;
  visit.title = "mount the control box";
  visit.phase = StepPhase::kDone;
  visit.end = analysis.duration;
  visit.metrics = whole;
  analysis.visits.push_back(visit);
}

}  // namespace

Result<InsertionResult> rehearseInsertion(const session::LoadedScene& loaded,
                                          const ProgressCallback& progress) {
  InsertionResult insertion;
  InsertionMonitor monitor(loaded, insertion.analysis);
  rehearse::RehearsalOptions options;
  options.on_tick = [&](const session::SessionSimulation&, const session::TickInput& input,
                        const session::TickOutput& output) { monitor.record(input, output); };
  options.stop_when = [&] { return monitor.done(); };
  progress("mounting the control box");
  const auto report = rehearsePeople(loaded, options);
  if (!report) return fail(report.error().what);
  if (!monitor.done()) return fail("the control box was not mounted: " + report->reason);
  const Percentiles compute = monitor.times();
  summarize(insertion.analysis, compute);
  const report::SessionMetrics& whole = insertion.analysis.whole;
  insertion.table = {
      "insertion",
      "A simulated trainee mounts the control box (Fig. 9; the paper: peak 0.75 ms)",
      {"seconds", "in contact s", "peak force N", "gap mm", "field depth mm", "load %", "tick median us",
       "tick p99 us", "tick max us"},
      {{insertion.analysis.duration, whole.contact_seconds, whole.peak_force, 1e3 * whole.gap,
        1e3 * whole.depth, whole.load, compute.median, compute.p99, compute.max}},
      {fmt::format(
          "complete server ticks with all ten objects of the exercise, one worker; {} ticks in which the "
          "thread was preempted are skipped; gap: device to proxy",
          monitor.preemptedTicks())}};
  return insertion;
}

}  // namespace tenon::bench
