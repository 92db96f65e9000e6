#include "tests/bench/engine/tick_table.h"

#include <vector>

#include <fmt/format.h>

#include "tests/bench/engine/timing.h"
#include "tests/server/simulation/many_bodies.h"

namespace tenon::bench {

namespace {

constexpr int kSettle = 200;
constexpr int kTicks = 2000;

struct Crowd {
  int objects;
  int held;  ///< by hands that press and stir
};

}  // namespace

Table manyBodiesTable(const Say& say) {
  Table table;
  table.name = "many_bodies";
  table.title = "Whole ticks with many objects, all against all (item 7)";
  table.columns = {"objects", "in contact", "workers", "pairs", "looked at", "median us", "p99 us"};
  table.notes = {
      "cubes on a floor, some pressed into it and stirred by hands; looked at: pairs queried in a tick"};
  for (const Crowd crowd : {Crowd{10, 3}, Crowd{50, 3}, Crowd{50, 10}, Crowd{200, 10}, Crowd{200, 0}}) {
    say(fmt::format("ticks of {} objects", crowd.objects));
    const test::ManyBodies bodies(crowd.objects, crowd.held);
    for (const unsigned workers : {1U, 2U}) {
      EnvironmentOptions options;
      options.workers = workers;
      Environment environment(bodies.scene, options);
      for (int i = 0; i < kSettle; ++i) bodies.step(environment);
      std::vector<double> times;
      double looks = 0.0;
      for (int i = 0; i < kTicks; ++i) {
        bodies.act(environment, environment.tick() + 1);
        times.push_back(microsecondsOf([&] { environment.step(); }));
        looks += environment.work().queried_pairs;
      }
      const Percentiles all = percentilesOf(std::move(times));
      table.rows.push_back({static_cast<double>(crowd.objects), static_cast<double>(crowd.held),
                            static_cast<double>(workers), static_cast<double>(bodies.scene->pairs.size()),
                            looks / kTicks, all.median, all.p99});
    }
  }
  return table;
}

}  // namespace tenon::bench
