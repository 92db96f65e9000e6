#include "tests/bench/engine/insertion.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "clients/trainee/trainee_station.h"
#include "server/session/scene_loader.h"
#include "tests/bench/engine/timing.h"
#include "tests/system/rehearsal.h"

namespace tenon::bench {

namespace {

constexpr const char* kStep = "mount_control_box";

/// Listens to a session until the step is done, and keeps what it hears of that step.
class Watch {
 public:
  Watch(const LoadedScene& loaded, SessionStory& story)
      : hand_(loaded.scenario->handNamed("right")), story_(story) {
    const auto& states = loaded.scenario->states;
    for (std::uint32_t i = 0; i < states.size(); ++i)
      if (states[i].name == kStep) step_ = i;
  }

  void hear(const TickInput& input, const TickOutput& output) {
    for (const HandReading& reading : input.readings)
      if (reading.hand == hand_) X_WH_ = reading.X_WH;
    if (output.step.step > step_) done_ = true;
    if (done_ || output.step.step != step_) return;
    if (first_ == 0) first_ = output.tick;
    const double time = static_cast<double>(output.tick - first_) * kTickSeconds;
    const HandManifold& manifold = output.manifolds[hand_.value];
    double depth = 0.0;
    for (const PairState& state : output.pairs) {
      const PairContact& pair = state.contact;
      if (pair.a == manifold.object || pair.b == manifold.object) depth = std::max(depth, pair.depth);
    }
    add(story_.trainee_force, time, manifold.F_Ho_W.force.norm());
    add(story_.gap, time, (manifold.X_WO.translation() - (X_WH_ * manifold.X_HO).translation()).norm());
    add(story_.depth, time, depth);
    add(story_.load, time, output.stats.load_percent);
    add(story_.compute, time, output.stats.compute_seconds);
    add(story_.compute_max, time, output.stats.compute_seconds);
    story_.duration = time;
    if (output.step.contact_seconds > 0.0) story_.whole.contact_seconds = output.step.contact_seconds;
  }

  [[nodiscard]] bool done() const { return done_; }

 private:
  static void add(Series& series, double time, double value) { series.push_back({time, value}); }

  HandId hand_;
  SessionStory& story_;
  std::uint32_t step_ = 0;
  Tick first_ = 0;
  bool done_ = false;
  Pose X_WH_;
};

double most(const Series& series) {
  double value = 0.0;
  for (const SeriesPoint& point : series) value = std::max(value, point.value);
  return value;
}

/// Over the time in which there is any.
double mean(const Series& series) {
  double sum = 0.0;
  double count = 0.0;
  for (const SeriesPoint& point : series) {
    sum += point.value;
    count += point.value > 0.0 ? 1.0 : 0.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

Percentiles computeTimes(const Series& series) {
  std::vector<double> microseconds;
  for (const SeriesPoint& point : series) microseconds.push_back(1e6 * point.value);
  return percentilesOf(std::move(microseconds));
}

void summarize(SessionStory& story, const Percentiles& compute) {
  Figures& whole = story.whole;
  whole.peak_force = most(story.trainee_force);
  whole.mean_force = mean(story.trainee_force);
  whole.gap = most(story.gap);
  whole.depth = most(story.depth);
  whole.load = most(story.load);
  story.compute_median = 1e-6 * compute.median;
  story.compute_p99 = 1e-6 * compute.p99;
  story.compute_worst = 1e-6 * compute.most;
  story.title = "Control box insertion";
  story.session = "bench";
  story.began_ns = std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
  story.lockstep = true;
  story.steps = 1;
  story.has_run = true;
  story.run.phase = RunPhase::kSucceeded;
  StepVisit visit;
  visit.name = kStep;
  visit.title = "mount the control box";
  visit.phase = StepPhase::kDone;
  visit.end = story.duration;
  visit.figures = whole;
  story.visits.push_back(visit);
}

}  // namespace

Result<Insertion9> rehearseInsertion(const std::filesystem::path& scenario,
                                     const std::filesystem::path& cache, double detail, const Say& say) {
  say("loading the engine bay");
  const auto loaded = loadScene(scenario, {.cache = cache, .detail = detail});
  if (!loaded) return fail(loaded.error().what);
  auto trainee = TraineeStation::open({});
  if (!trainee) return fail(trainee.error().what);
  std::vector<std::unique_ptr<Station>> stations;
  stations.push_back(std::move(*trainee));
  Insertion9 insertion;
  Watch watch(*loaded, insertion.story);
  RehearsalOptions options;
  options.ticked = [&](const TickInput& input, const TickOutput& output) { watch.hear(input, output); };
  options.enough = [&] { return watch.done(); };
  say("mounting the control box");
  const auto report = rehearse(*loaded, std::move(stations), options);
  if (!report) return fail(report.error().what);
  if (!watch.done()) return fail("the control box was not mounted: " + report->reason);
  const Percentiles compute = computeTimes(insertion.story.compute);
  summarize(insertion.story, compute);
  const Figures& whole = insertion.story.whole;
  insertion.table = {
      "insertion",
      "The control box is mounted by a simulated trainee (Fig. 9; the paper: 0.75 ms at its peak)",
      {"seconds", "in contact s", "peak force N", "gap mm", "field depth mm", "load %", "tick median us",
       "tick p99 us", "tick most us"},
      {{insertion.story.duration, whole.contact_seconds, whole.peak_force, 1e3 * whole.gap, 1e3 * whole.depth,
        whole.load, compute.median, compute.p99, compute.most}},
      {"the whole tick with all ten objects of the exercise, one worker; gap: device to proxy"}};
  return insertion;
}

}  // namespace tenon::bench
