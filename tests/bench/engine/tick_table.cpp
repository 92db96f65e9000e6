#include "tests/bench/engine/tick_table.h"

#include <vector>

#include <fmt/format.h>

#include "tests/bench/engine/timing.h"
#include "tests/server/simulation/many_bodies.h"

namespace tenon::bench {

namespace {

constexpr int kSettleTicks = 200;
constexpr int kTicks = 2000;

struct CrowdSize {
  int objects;
  int held;  ///< by hands that press and move them
};

}  // namespace

Table manyBodiesTable(const ProgressCallback& progress) {
  Table table;
  table.name = "many_bodies";
  table.title = "Whole ticks with many objects, all against all (item 7)";
  table.columns = {"objects", "in contact", "workers", "pairs", "queried pairs", "median us", "p99 us"};
  table.notes = {"cubes on a floor, some pressed into it and moved by hands; queried pairs: mean per tick"};
  for (const CrowdSize size :
       {CrowdSize{10, 3}, CrowdSize{50, 3}, CrowdSize{50, 10}, CrowdSize{200, 10}, CrowdSize{200, 0}}) {
    progress(fmt::format("ticks of {} objects", size.objects));
    const test::ManyBodies bodies(size.objects, size.held);
    for (const unsigned workers : {1U, 2U}) {
      simulation::EnvironmentOptions options;
      options.workers = workers;
      simulation::Environment environment(bodies.scene, options);
      for (int i = 0; i < kSettleTicks; ++i) bodies.step(environment);
      std::vector<double> times;
      double queries = 0.0;
      for (int i = 0; i < kTicks; ++i) {
        bodies.act(environment, environment.tick() + 1);
        times.push_back(microsecondsOf([&] { environment.step(); }));
        queries += environment.work().queried_pairs;
      }
      const Percentiles times_us = percentilesOf(std::move(times));
      table.rows.push_back({static_cast<double>(size.objects), static_cast<double>(size.held),
                            static_cast<double>(workers), static_cast<double>(bodies.scene->pairs.size()),
                            queries / kTicks, times_us.median, times_us.p99});
    }
  }
  return table;
}

}  // namespace tenon::bench
