#include "tests/bench/engine/query_table.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "server/collision/pair_query.h"
#include "server/collision/query_kernels.h"
#include "tests/bench/engine/reference_engines.h"
#include "tests/bench/engine/timing.h"

namespace tenon::bench {

namespace {

/// Every n-th pose, about `count` in total.
std::vector<Pose> subset(const std::vector<Pose>& poses, std::size_t count) {
  const std::size_t step = std::max<std::size_t>(1, poses.size() / count);
  std::vector<Pose> chosen;
  for (std::size_t i = 0; i < poses.size(); i += step) chosen.push_back(poses[i]);
  return chosen;
}

class QueryTable {
 public:
  QueryTable(const BenchScene& scene, int rounds) : scene_(scene), rounds_(rounds) {
    table_.name = "query";
    table_.title =
        "Query of the control box in the engine bay (item 3: in contact 8 and 30 us with AVX-512, 40 and 100 "
        "scalar; free 1; cold 200)";
    table_.columns = {"engine", "poses", "count", "median us", "p99 us", "contacts", "ratio to Tenon"};
    table_.notes = {
        fmt::format(
            "Tenon: smallest time of {} rounds per pose, other engines: one round; cold: 100 MB written "
            "before each query; contacts: mean per pose; ratio to Tenon: of the median to that of the "
            "fastest "
            "kernels, in contact or free",
            rounds),
        "Tenon computes wrench, depth and gradient normals of all points inside; other engines list pairs of "
        "triangles, without a depth suitable for haptics"};
  }

  Table make(const ProgressCallback& progress) {
    const auto all = collision::supportedKernels();
    best_ = timedQueries(scene_.poses.contact, true, false).median;
    best_free_ = timedQueries(scene_.poses.free, true, false).median;
    for (auto kernels = all.rbegin(); kernels != all.rend(); ++kernels) {
      const std::string isa(kernels->isa);
      progress("queries with " + isa);
      collision::chooseKernels(isa);
      add(isa, "contact", scene_.poses.contact, true, false);
      add(isa, "near", scene_.poses.near, true, false);
      add(isa, "free", scene_.poses.free, true, false);
      add(isa, "contact, cold", subset(scene_.poses.contact, 60), true, true);
      add(isa, "contact, no pruning", subset(scene_.poses.contact, 60), false, false);
    }
    collision::chooseKernels(all.back().isa);
    progress("building the hierarchies of other engines");
    for (const auto& engine : referenceEngines(scene_.box_mesh, scene_.bay_mesh)) {
      progress(engine->name());
      add(*engine, "contact", subset(scene_.poses.contact, 60), best_);
      add(*engine, "free", subset(scene_.poses.free, 60), best_free_);
    }
    return std::move(table_);
  }

 private:
  [[nodiscard]] collision::PairQuery queryAt(const Pose& X_BA, bool prune) const {
    collision::PairQuery query{&scene_.box->shell, &scene_.bay->field, X_BA, Pose()};
    query.sum_penalty = true;
    query.prune = prune;
    return query;
  }

  Percentiles timedQueries(const std::vector<Pose>& poses, bool prune, bool cold) {
    const auto query = [&](std::size_t i) { collision::queryPair(queryAt(poses[i], prune), *result_); };
    if (!cold) return timed(poses.size(), rounds_, query);
    return timed(poses.size(), rounds_, query, [this] { evict_(); });
  }

  void add(const std::string& isa, const std::string& kind, const std::vector<Pose>& poses, bool prune,
           bool cold) {
    if (poses.empty()) return;
    const Percentiles times = timedQueries(poses, prune, cold);
    double contacts = 0.0;
    for (const Pose& X_BA : poses) {
      collision::queryPair(queryAt(X_BA, true), *result_);
      contacts += result_->counts.points_colliding;
    }
    addRow("Tenon, " + isa, kind, poses.size(), times, contacts,
           kind.starts_with("contact") ? best_ : best_free_);
  }

  void add(ReferenceEngine& engine, const std::string& kind, const std::vector<Pose>& poses,
           double reference_us) {
    double contacts = 0.0;
    const Percentiles times = timed(
        poses.size(), 1, [&](std::size_t i) { contacts += static_cast<double>(engine.contacts(poses[i])); });
    addRow(engine.name(), kind, poses.size(), times, contacts, reference_us);
  }

  void addRow(const std::string& engine, const std::string& kind, std::size_t count, const Percentiles& times,
              double contacts, double reference_us) {
    const auto poses = static_cast<double>(count);
    table_.rows.push_back(
        {engine, kind, poses, times.median, times.p99, contacts / poses, times.median / reference_us});
  }

  const BenchScene& scene_;
  int rounds_;
  std::unique_ptr<collision::PairQueryResult> result_ = std::make_unique<collision::PairQueryResult>();
  ColdCaches evict_;
  double best_ = 1.0, best_free_ = 1.0;  ///< [us]
  Table table_;
};

}  // namespace

Table queryTable(const BenchScene& scene, int rounds, const ProgressCallback& progress) {
  return QueryTable(scene, rounds).make(progress);
}

}  // namespace tenon::bench
