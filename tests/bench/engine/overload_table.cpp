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

constexpr Tick kCourseSettle = 300;
constexpr Tick kCourseTicks = 1800;
constexpr double kGoal = 0.7e-3;  // [s] of a governed tick
constexpr double kLate = 1000.0;  // [us]

using Budgets = std::map<Tick, std::uint64_t>;

/// [s] of this thread.
double ownTime() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Course {
  Percentiles tick;           ///< [us]
  double late_percent = 0.0;  ///< of ticks
  double points = 0.0;        ///< tested a tick
  std::uint64_t budget = 0;   ///< at the end
  std::uint64_t hash = 0;
  Budgets budgets;  ///< what the governor changed, and for which tick
};

Course courseOf(const test::Overload& overload, bool governed) {
  Course course;
  Environment environment(overload.scene, {});
  Governor governor(kGoal);
  std::vector<double> times;
  while (environment.tick() < kCourseTicks) {
    overload.act(environment, environment.tick() + 1);
    const double start = ownTime();
    environment.step();
    const double seconds = ownTime() - start;
    const std::uint64_t tested = environment.work().points_visited;
    if (environment.tick() > kCourseSettle) {
      times.push_back(1e6 * seconds);
      course.points += static_cast<double>(tested) / static_cast<double>(kCourseTicks - kCourseSettle);
    }
    if (!governed) continue;
    const auto budget = governor.judge(seconds, tested, environment.workLimits().points);
    if (!budget) continue;
    course.budgets[environment.tick() + 1] = *budget;
    environment.setBudget(*budget);
  }
  const auto late = std::count_if(times.begin(), times.end(), [](double time) { return time > kLate; });
  course.late_percent = 100.0 * static_cast<double>(late) / static_cast<double>(times.size());
  course.tick = percentilesOf(std::move(times));
  course.budget = environment.workLimits().points;
  course.hash = environment.hash();
  return course;
}

bool repeats(const test::Overload& overload, const Course& course) {
  EnvironmentOptions options;
  options.workers = 2;
  Environment environment(overload.scene, options);
  while (environment.tick() < kCourseTicks) {
    const auto budget = course.budgets.find(environment.tick() + 1);
    if (budget != course.budgets.end()) environment.setBudget(budget->second);
    overload.step(environment);
  }
  return environment.hash() == course.hash;
}

}  // namespace

Table overloadTable(const Say& say) {
  Table table;
  table.name = "overload";
  table.title = "More than a tick's work, with and without graceful degradation (item 8)";
  table.columns = {"blocks", "governed",      "median us", "p99 us",
                   "late %", "points a tick", "budget",    "again, same bits"};
  table.notes = {
      "finely sampled blocks lie on a floor under hands that stir them; late: over 1 ms; governed: towards "
      "0.7 ms",
      "time of the thread alone, so that what others run meanwhile does not count",
      "again: the budgets of this run, without a clock and with two workers"};
  for (const int blocks : {12, 40}) {
    const test::Overload overload(blocks);
    for (const bool governed : {false, true}) {
      say(fmt::format("ticks of {} blocks{}", blocks, governed ? ", governed" : ""));
      const Course course = courseOf(overload, governed);
      table.rows.push_back({static_cast<double>(blocks), governed ? "yes" : "no", course.tick.median,
                            course.tick.p99, course.late_percent, course.points,
                            course.budget == 0 ? Cell::none() : Cell(static_cast<double>(course.budget)),
                            repeats(overload, course) ? "yes" : "NO"});
    }
  }
  return table;
}

}  // namespace tenon::bench
