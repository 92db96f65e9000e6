#include <cstdio>

#include <benchmark/benchmark.h>

#include "tests/bench/engine/methods.h"

/// The god object beside the paper's penalty force and blocking heuristic, in the same scenes. Prints a
/// table; `--benchmark_format=json` or `--benchmark_out` give the figures as counters.
namespace tenon::bench {
namespace {

void Method(benchmark::State& state, ContactMethod method) {
  MethodFigures figures;
  for (auto _ : state) figures = measureMethod(method);
  state.counters["sheets_passed"] = figures.sheets_passed;
  state.counters["sheet_overlap_mm"] = 1e3 * figures.sheet_overlap;
  state.counters["corner_overlap_mm"] = 1e3 * figures.corner_overlap;
  state.counters["slide_lag_mm"] = 1e3 * figures.slide_lag;
  state.counters["force_step_N"] = figures.force_step;
  state.counters["still_force_N"] = figures.still_force_range;
  state.counters["tick_median_us"] = figures.tick.median;
  state.counters["tick_p99_us"] = figures.tick.p99;
  std::fputs(methodTable({figures}).c_str(), stderr);
}
BENCHMARK_CAPTURE(Method, GodObject, ContactMethod::kIsland)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Method, Blocking, ContactMethod::kBlocking)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Method, Penalty, ContactMethod::kPenalty)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tenon::bench
