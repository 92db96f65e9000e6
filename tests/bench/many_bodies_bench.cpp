#include <algorithm>
#include <chrono>
#include <ctime>
#include <vector>

#include <benchmark/benchmark.h>

#include "tests/server/simulation/many_bodies.h"

/// How long a whole tick takes with many objects that may all meet each other: cubes on a floor, of which
/// some are pressed into it by hands and stirred. Median and p99 over the ticks after the first contacts.
namespace tenon {
namespace {

constexpr int kSettle = 200;
constexpr int kTicks = 4000;

/// [us] of this thread: what others run meanwhile does not count.
double ownTime() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

double share(std::vector<double>& sorted, double of) {
  return sorted[static_cast<std::size_t>(of * static_cast<double>(sorted.size() - 1))];
}

void ManyBodies(benchmark::State& state, int count, int held) {
  const test::ManyBodies bodies(count, held);
  EnvironmentOptions options;
  options.workers = static_cast<unsigned>(state.range(0));
  Environment environment(bodies.scene, options);
  for (int i = 0; i < kSettle; ++i) bodies.step(environment);
  std::vector<double> times;
  times.reserve(kTicks);
  std::vector<double> own_times;
  own_times.reserve(kTicks);
  double near = 0.0;
  double looks = 0.0;
  double touching = 0.0;
  double hash_microseconds = 0.0;
  for (auto _ : state) {
    bodies.act(environment, environment.tick() + 1);
    const double own_start = ownTime();
    const auto start = std::chrono::steady_clock::now();
    environment.step();
    const auto end = std::chrono::steady_clock::now();
    own_times.push_back(ownTime() - own_start);
    const auto hash_start = std::chrono::steady_clock::now();
    benchmark::DoNotOptimize(environment.hash());
    const std::chrono::duration<double, std::micro> hashing = std::chrono::steady_clock::now() - hash_start;
    hash_microseconds += hashing.count();
    const std::chrono::duration<double> took = end - start;
    state.SetIterationTime(took.count());
    times.push_back(1e6 * took.count());
    near += environment.work().near_pairs;
    looks += environment.work().queried_pairs;
    for (const ObjectId cube : bodies.cubes) {
      touching += environment.objects()[cube.value].in_contact ? 1.0 : 0.0;
    }
  }
  std::sort(times.begin(), times.end());
  state.counters["median_us"] = share(times, 0.5);
  state.counters["p99_us"] = share(times, 0.99);
  std::sort(own_times.begin(), own_times.end());
  state.counters["own_median_us"] = share(own_times, 0.5);
  state.counters["own_p99_us"] = share(own_times, 0.99);
  state.counters["pairs"] = static_cast<double>(bodies.scene->pairs.size());
  state.counters["near"] = benchmark::Counter(near, benchmark::Counter::kAvgIterations);
  state.counters["looks"] = benchmark::Counter(looks, benchmark::Counter::kAvgIterations);
  state.counters["touching"] = benchmark::Counter(touching, benchmark::Counter::kAvgIterations);
  state.counters["hash_us"] = benchmark::Counter(hash_microseconds, benchmark::Counter::kAvgIterations);
}

void onOneAndTwoWorkers(benchmark::internal::Benchmark* bench) {
  bench->Arg(1)->Arg(2)->ArgName("workers")->Iterations(kTicks)->UseManualTime()->Unit(
      benchmark::kMicrosecond);
}
BENCHMARK_CAPTURE(ManyBodies, TenWithThreeInContact, 10, 3)->Apply(onOneAndTwoWorkers);
BENCHMARK_CAPTURE(ManyBodies, FiftyWithThreeInContact, 50, 3)->Apply(onOneAndTwoWorkers);
BENCHMARK_CAPTURE(ManyBodies, FiftyWithTenInContact, 50, 10)->Apply(onOneAndTwoWorkers);
BENCHMARK_CAPTURE(ManyBodies, TwoHundredWithThreeInContact, 200, 3)->Apply(onOneAndTwoWorkers);
BENCHMARK_CAPTURE(ManyBodies, TwoHundredWithTenInContact, 200, 10)->Apply(onOneAndTwoWorkers);
BENCHMARK_CAPTURE(ManyBodies, TwoHundredApart, 200, 0)->Apply(onOneAndTwoWorkers);

}  // namespace
}  // namespace tenon
