#include "tests/bench/engine/query_table.h"

#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "server/collision/query_kernels.h"
#include "tests/bench/engine/reference_engines.h"
#include "tests/bench/engine/timing.h"

namespace tenon::bench {

namespace {

struct PoseKind {
  const char* name;
  const std::vector<Pose>& poses;
};

class QueryTable {
 public:
  QueryTable(const BenchPair& pair, int rounds) : pair_(pair), rounds_(rounds) {
    table_.name = "query";
    table_.title = "Query of the control box in the engine bay, beside other engines";
    table_.columns = {"engine", "poses", "count", "median us", "p99 us", "max us", "contacts"};
    table_.notes = {
        fmt::format(
            "smallest time of {} rounds per pose, of all engines; cold: 100 MB written before each query; "
            "contacts: mean per pose; kernels: {}",
            rounds, collision::chosenKernels().isa),
        "poses by exact distances: touching: where ticks hold a part, at its dilated surface; pressed: 0.5 "
        "to 5 mm "
        "deep in the mesh",
        "Tenon: the list of a tick's solver, points and features of both parts up to 1 mm from the dilated "
        "surface; "
        "other engines: pairs of triangles, without a depth suitable for haptics"};
  }

  Table make(const ProgressCallback& progress) {
    const PoseKind kinds[] = {{"pressed", pair_.poses.pressed},
                              {"touching", pair_.poses.touching},
                              {"near", pair_.poses.near},
                              {"free", pair_.poses.free}};
    progress("queries");
    for (const PoseKind& kind : kinds) add(kind, false);
    add({"touching, cold", pair_.poses.touching}, true);
    progress("building the hierarchies of other engines");
    for (const auto& engine : referenceEngines(pair_.box_mesh, pair_.bay_mesh)) {
      progress(engine->name());
      for (const PoseKind& kind : kinds) add(*engine, kind);
    }
    return std::move(table_);
  }

 private:
  void query(const Pose& X_BA) {
    const collision::PairQuery query = pair_.tickQuery(X_BA);
    collision::queryPair(query, *result_);
    collision::queryFeatures(query, pair_.features, *scratch_, *result_);
  }

  void add(const PoseKind& kind, bool cold) {
    double contacts = 0.0;
    for (const Pose& X_BA : kind.poses) {
      query(X_BA);
      contacts += static_cast<double>(result_->contacts.size());
    }
    const auto work = [&](std::size_t i) { query(kind.poses[i]); };
    addRow("Tenon", kind,
           cold ? timed(kind.poses.size(), rounds_, work, [this] { evict_(); })
                : timed(kind.poses.size(), rounds_, work),
           contacts);
  }

  void add(ReferenceEngine& engine, const PoseKind& kind) {
    double contacts = 0.0;
    const Percentiles times = timed(kind.poses.size(), rounds_, [&](std::size_t i) {
      contacts += static_cast<double>(engine.contacts(kind.poses[i])) / rounds_;
    });
    addRow(engine.name(), kind, times, contacts);
  }

  /// `contacts`: of all poses together.
  void addRow(const std::string& engine, const PoseKind& kind, const Percentiles& times, double contacts) {
    const auto count = static_cast<double>(kind.poses.size());
    if (count > 0.0)
      table_.rows.push_back({engine, kind.name, count, times.median, times.p99, times.max, contacts / count});
  }

  const BenchPair& pair_;
  int rounds_;
  std::unique_ptr<collision::PairQueryResult> result_ = std::make_unique<collision::PairQueryResult>();
  std::unique_ptr<collision::FeatureScratch> scratch_ = std::make_unique<collision::FeatureScratch>();
  ColdCaches evict_;
  Table table_;
};

}  // namespace

Table queryTable(const BenchPair& pair, int rounds, const ProgressCallback& progress) {
  return QueryTable(pair, rounds).make(progress);
}

}  // namespace tenon::bench
