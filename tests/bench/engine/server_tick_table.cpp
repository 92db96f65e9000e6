#include "tests/bench/engine/server_tick_table.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "server/simulation/coll_pair.h"
#include "tests/bench/engine/sessions.h"
#include "tests/bench/engine/timing.h"

namespace tenon::bench {

namespace {

/// Wall times, and those of them during which no other thread had the processor.
struct TimeList {
  std::vector<double> all, undisturbed;  ///< [us]

  void add(double us, bool is_undisturbed) {
    all.push_back(us);
    if (is_undisturbed) undisturbed.push_back(us);
  }
};

/// Times of ticks, and of one query in each tick of contact: that of the pair with most contacts, at the
/// poses that the tick ends with.
class TickMonitor {
 public:
  void record(const session::SessionSimulation& simulation, const session::TickOutput& output) {
    const simulation::Environment& environment = simulation.environment();
    const simulation::PairMotion* fullest = nullptr;
    std::uint32_t pair = 0;
    for (const std::uint32_t i : environment.nearPairs()) {
      const simulation::PairMotion& motion = environment.pairs()[i];
      if (!motion.queried || motion.result == nullptr ||
          motion.result->query.smallest_gap > collision::kTouchGap)
        continue;
      if (fullest != nullptr &&
          fullest->result->query.contacts.size() >= motion.result->query.contacts.size())
        continue;
      fullest = &motion;
      pair = i;
    }
    const double us = 1e6 * output.stats.compute_seconds;
    const bool undisturbed = !preempted_.sinceLastCall();
    (fullest != nullptr ? contact : free).add(us, undisturbed);
    if (fullest == nullptr) return;
    contacts += static_cast<double>(fullest->result->query.contacts.size());
    const simulation::Scene& scene = environment.scene();
    const simulation::PairSpec& spec = scene.pairs[pair];
    const collision::PairQuery query =
        tickQuery(scene, spec, environment.objects()[spec.a.value].X_WO,
                  environment.objects()[spec.b.value].X_WO, fullest->result->query.complete_to);
    const collision::PairFeatures features = simulation::featuresOf(scene, spec);
    const double query_us = microsecondsOf([&] {
      collision::queryPair(query, *result_);
      collision::queryFeatures(query, features, *scratch_, *result_);
    });
    queries.add(query_us, !preempted_.sinceLastCall());
  }

  TimeList contact, free, queries;
  double contacts = 0.0;  ///< listed, of the fullest pair, over all ticks

 private:
  Preemption preempted_;
  std::unique_ptr<collision::PairQueryResult> result_ = std::make_unique<collision::PairQueryResult>();
  std::unique_ptr<collision::FeatureScratch> scratch_ = std::make_unique<collision::FeatureScratch>();
};

}  // namespace

Result<Table> serverTickTable(const session::LoadedScene& loaded, std::size_t ticks,
                              const ProgressCallback& progress) {
  TickMonitor monitor;
  rehearse::RehearsalOptions options;
  options.on_tick = [&](const session::SessionSimulation& simulation, const session::TickInput&,
                        const session::TickOutput& output) { monitor.record(simulation, output); };
  while (monitor.contact.all.size() + monitor.free.all.size() < ticks) {
    progress(fmt::format("ticks of session {}", options.seed));
    const auto report = rehearsePeople(loaded, options);
    if (!report) return fail(report.error().what);
    ++options.seed;
  }
  if (monitor.contact.all.empty()) return fail("nothing came into contact");
  Table table{
      "server_ticks",
      "Complete server ticks by wall time (the paper's limit: 1 ms)",
      {"what", "count", "median us", "p99 us", "p99.9 us", "max us", "over 1 ms"},
      {},
      {fmt::format(
           "{} sessions of simulated people, seeds 1 to {}; one worker, no work budget: state machine, "
           "queries, solver of all objects, state hash, output, journal entry, checkpoint",
           options.seed - 1, options.seed - 1),
       fmt::format("in contact: a pair that was asked touches; query alone: in each of these the pair with "
                   "most contacts ({:.0f} in "
                   "the mean), once, right after its tick",
                   monitor.contacts / static_cast<double>(monitor.contact.all.size())),
       "undisturbed: while the thread was not preempted by what else the machine did"}};
  const auto add = [&](const std::string& name, const std::vector<double>& us) {
    const Percentiles times = percentilesOf(us);
    const auto late = std::count_if(us.begin(), us.end(), [](double tick) { return tick > 1000.0; });
    table.rows.push_back({name, static_cast<double>(us.size()), times.median, times.p99, times.p999,
                          times.max, static_cast<double>(late)});
  };
  const auto addBoth = [&](const std::string& name, const TimeList& times) {
    add(name, times.all);
    add(name + ", undisturbed", times.undisturbed);
  };
  addBoth("ticks in contact", monitor.contact);
  addBoth("free ticks", monitor.free);
  addBoth("query alone", monitor.queries);
  return table;
}

}  // namespace tenon::bench
