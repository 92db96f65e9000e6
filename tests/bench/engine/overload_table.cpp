#include "tests/bench/engine/overload_table.h"

#include <algorithm>
#include <ctime>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "server/simulation/governor.h"
#include "tests/bench/engine/timing.h"
#include "tests/server/simulation/overload.h"

namespace tenon::bench {
namespace {

constexpr Tick kSettleTicks = 300;
constexpr Tick kTotalTicks = 1800;
constexpr double kGovernedTime = 0.7e-3;  // [s] tick time that the governor aims at
constexpr double kDeadline = 1000.0;      // [us]

using Budgets = std::map<Tick, std::uint64_t>;

/// [s] CPU time of this thread.
double threadTime() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct OverloadRun {
  Percentiles tick;           ///< [us]
  double late_percent = 0.0;  ///< [%] of ticks
  double points = 0.0;        ///< tested per tick
  std::uint64_t budget = 0;   ///< at the end
  std::uint64_t hash = 0;
  Budgets budgets;  ///< changes by the governor, by the tick they take effect in
};

OverloadRun runOverload(const test::Overload& overload, bool governed) {
  OverloadRun result;
  simulation::Environment environment(overload.scene, {});
  simulation::Governor governor(kGovernedTime);
  std::vector<double> times;
  while (environment.tick() < kTotalTicks) {
    overload.act(environment, environment.tick() + 1);
    const double start = threadTime();
    environment.step();
    const double seconds = threadTime() - start;
    const std::uint64_t tested = environment.work().points_visited;
    if (environment.tick() > kSettleTicks) {
      times.push_back(1e6 * seconds);
      result.points += static_cast<double>(tested) / static_cast<double>(kTotalTicks - kSettleTicks);
    }
    if (!governed) continue;
    const auto budget = governor.update(seconds, tested, environment.workLimits().points);
    if (!budget) continue;
    result.budgets[environment.tick() + 1] = *budget;
    environment.setBudget(*budget);
  }
  const auto late = std::count_if(times.begin(), times.end(), [](double time) { return time > kDeadline; });
  result.late_percent = 100.0 * static_cast<double>(late) / static_cast<double>(times.size());
  result.tick = percentilesOf(std::move(times));
  result.budget = environment.workLimits().points;
  result.hash = environment.hash();
  return result;
}

bool repeatsBitwise(const test::Overload& overload, const OverloadRun& result) {
  simulation::EnvironmentOptions options;
  options.workers = 2;
  simulation::Environment environment(overload.scene, options);
  while (environment.tick() < kTotalTicks) {
    const auto budget = result.budgets.find(environment.tick() + 1);
    if (budget != result.budgets.end()) environment.setBudget(budget->second);
    overload.step(environment);
  }
  return environment.hash() == result.hash;
}

}  // namespace

Table overloadTable(const ProgressCallback& progress) {
  Table table;
  table.name = "overload";
  table.title = "Overload with and without graceful degradation (item 8)";
  table.columns = {"blocks", "governed",        "median us", "p99 us",
                   "late %", "points per tick", "budget",    "replay bit-equal"};
  table.notes = {
      "finely sampled blocks on a floor, moved by hands; late: over 1 ms; governed: aims at 0.7 ms",
      "CPU time of the thread, so that other programs do not count",
      "replay: with the budgets of this run, without a clock and with two workers"};
  for (const int blocks : {12, 40}) {
    const test::Overload overload(blocks);
    for (const bool governed : {false, true}) {
      progress(fmt::format("ticks of {} blocks{}", blocks, governed ? ", governed" : ""));
      const OverloadRun result = runOverload(overload, governed);
      table.rows.push_back(
          {static_cast<double>(blocks), governed ? "yes" : "no", result.tick.median, result.tick.p99,
           result.late_percent, result.points,
           result.budget == 0 ? TableCell::none() : TableCell(static_cast<double>(result.budget)),
           repeatsBitwise(overload, result) ? "yes" : "NO"});
    }
  }
  return table;
}

}  // namespace tenon::bench
