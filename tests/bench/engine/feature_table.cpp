#include "tests/bench/engine/feature_table.h"

#include <algorithm>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "server/collision/feature_query.h"
#include "server/simulation/coll_pair.h"
#include "tests/bench/engine/sessions.h"
#include "tests/bench/engine/timing.h"

namespace tenon::bench {

namespace {

constexpr Tick kEvery = 10;  // [ticks] between sampled ones

/// The poses of a pair at which it is traversed, and one at which the list is evaluated again.
struct Sample {
  std::uint32_t pair = 0;
  bool traversed = false;  ///< since the sample before
  double margin = 0.0;     ///< [m]
  Pose X_WA, X_WB;         ///< of the traversal
  Pose X_WA_now, X_WB_now;
};

/// Collects the samples of a rehearsal.
class Sampler {
 public:
  void record(const simulation::Environment& environment) {
    if (environment.tick() % kEvery != 0) return;
    for (const std::uint32_t i : environment.nearPairs()) {
      const simulation::PairMotion& pair = environment.pairs()[i];
      if (!pair.queried || pair.result == nullptr || !pair.result->traversal.valid) continue;
      const simulation::PairSpec& spec = environment.scene().pairs[i];
      const collision::TraversalState& at = pair.result->traversal;
      Sample sample{i,
                    true,
                    pair.result->query.complete_to,
                    at.X_WA,
                    at.X_WB,
                    environment.objects()[spec.a.value].X_WO,
                    environment.objects()[spec.b.value].X_WO};
      const auto before = last_.find(i);
      sample.traversed = before == last_.end() || !(samples_[before->second].X_WA == at.X_WA) ||
                         !(samples_[before->second].X_WB == at.X_WB);
      last_[i] = samples_.size();
      samples_.push_back(sample);
    }
  }
  [[nodiscard]] const std::vector<Sample>& samples() const { return samples_; }

 private:
  std::vector<Sample> samples_;
  std::map<std::uint32_t, std::size_t> last_;
};

/// The queries of samples, in one direction or both.
class Queries {
 public:
  Queries(const simulation::Scene& scene, const std::vector<Sample>& samples, int rounds)
      : scene_(scene), samples_(samples), rounds_(rounds) {}

  /// [us] Smallest time of each sample's traversal, and of a resampling.
  void time(bool both, std::vector<double>& traversal, std::vector<double>& resampling) {
    traversal.assign(samples_.size(), 1e9);
    resampling.assign(samples_.size(), 1e9);
    for (int round = 0; round < rounds_; ++round) {
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        const Sample& sample = samples_[i];
        const simulation::PairSpec& spec = scene_.pairs[sample.pair];
        const collision::PairFeatures features = simulation::featuresOf(scene_, spec);
        collision::PairQuery query = tickQuery(scene_, spec, sample.X_WA, sample.X_WB, sample.margin);
        traversal[i] = std::min(traversal[i], microsecondsOf([&] {
                                  collision::queryPair(query, *result_);
                                  if (both) collision::queryFeatures(query, features, *scratch_, *result_);
                                }));
        contacts_ += result_->contacts.size();
        query.X_WA = sample.X_WA_now;
        query.X_WB = sample.X_WB_now;
        resampling[i] = std::min(resampling[i], microsecondsOf([&] {
                                   both ? collision::resampleFeatures(query, features, 0.0, *result_)
                                        : collision::resampleContacts(query, 0.0, *result_);
                                 }));
      }
    }
  }

 private:
  const simulation::Scene& scene_;
  const std::vector<Sample>& samples_;
  int rounds_;
  std::size_t contacts_ = 0;  // read, so that no query is optimised away
  std::unique_ptr<collision::PairQueryResult> result_ = std::make_unique<collision::PairQueryResult>();
  std::unique_ptr<collision::FeatureScratch> scratch_ = std::make_unique<collision::FeatureScratch>();
};

/// Sum of the chosen times.
double sumOf(const std::vector<double>& times, const std::vector<std::size_t>& chosen) {
  return std::accumulate(chosen.begin(), chosen.end(), 0.0,
                         [&](double sum, std::size_t i) { return sum + times[i]; });
}

Percentiles percentilesOfChosen(const std::vector<double>& times, const std::vector<std::size_t>& chosen) {
  std::vector<double> list;
  for (const std::size_t i : chosen) list.push_back(times[i]);
  return percentilesOf(std::move(list));
}

}  // namespace

Result<Table> featureTable(const session::LoadedScene& loaded, int rounds, const ProgressCallback& progress) {
  Sampler sampler;
  rehearse::RehearsalOptions options;
  options.on_tick = [&](const session::SessionSimulation& simulation, const session::TickInput&,
                        const session::TickOutput&) { sampler.record(simulation.environment()); };
  progress("working through the scenario");
  const auto report = rehearsePeople(loaded, options);
  if (!report) return fail(report.error().what);

  progress("queries in one direction and in both");
  const simulation::Scene& scene = *loaded.scene;
  const std::vector<Sample>& samples = sampler.samples();
  Queries queries(scene, samples, rounds);
  std::vector<double> one, both, one_again, both_again;
  queries.time(false, one, one_again);
  queries.time(true, both, both_again);

  Table table;
  table.name = "both_sides";
  table.title = "Queries of pairs in one direction, and with the features of both parts";
  table.columns = {"pair",  "query",         "count",          "one direction us", "both us",
                   "ratio", "one median us", "both median us", "one p99 us",       "both p99 us"};
  table.notes = {
      fmt::format("mean times; smallest of {} rounds for each sample, one in {} ticks of a rehearsal "
                  "that ended as: {}",
                  rounds, kEvery, report->reason)};
  const auto add = [&](const std::string& name, auto&& wanted) {
    for (const bool traversal : {true, false}) {
      std::vector<std::size_t> chosen;
      for (std::size_t i = 0; i < samples.size(); ++i)
        if (wanted(samples[i]) && (!traversal || samples[i].traversed)) chosen.push_back(i);
      if (chosen.empty()) continue;
      const auto count = static_cast<double>(chosen.size());
      const double mean_one = sumOf(traversal ? one : one_again, chosen) / count;
      const double mean_both = sumOf(traversal ? both : both_again, chosen) / count;
      const Percentiles p_one = percentilesOfChosen(traversal ? one : one_again, chosen);
      const Percentiles p_both = percentilesOfChosen(traversal ? both : both_again, chosen);
      table.rows.push_back({name, traversal ? "traversal" : "resampling", count, mean_one, mean_both,
                            mean_both / mean_one, p_one.median, p_both.median, p_one.p99, p_both.p99});
    }
  };
  add("all", [](const Sample&) { return true; });
  for (std::uint32_t pair = 0; pair < scene.pairs.size(); ++pair) {
    const simulation::PairSpec& spec = scene.pairs[pair];
    add(scene.objects[spec.a.value].name + "-" + scene.objects[spec.b.value].name,
        [pair](const Sample& sample) { return sample.pair == pair; });
  }
  return table;
}

}  // namespace tenon::bench
