#include "tests/bench/engine/truth_table.h"

#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/bench/engine/timing.h"
#include "tests/support/contact_errors.h"

namespace tenon::bench {

namespace {

struct QueryVariant {
  const char* name;
  bool correct_ridges;
};
constexpr QueryVariant kQueryVariants[] = {{"as ticks ask", false}, {"with ridge correction", true}};

}  // namespace

Table truthTable(const BenchPair& pair, int rounds, const ProgressCallback& progress) {
  Table table{
      "truth",
      "Errors of gaps and net forces with respect to the solids (aim: force 3 %, p90 10 %, in 10 us)",
      {"query", "poses", "count", "points inside", "gap error mm", "p99 mm", "missed %", "force error %",
       "p90 %", "median us", "p99 us"},
      {},
      {"the control box in the engine bay, which is dilated where its walls are thin; poses and reference by "
       "exact distances to the union of the bay's solids, with that dilation",
       "touching: at the dilated surface, where ticks hold a part; pressed: 0.5 to 5 mm deep in the mesh",
       "medians unless stated otherwise; gap: of listed contacts, touching up to 1 mm, else inside; missed: "
       "points "
       "inside that the query reports outside; force error: of the sum of all penalties, relative to the "
       "exact "
       "one"}};
  const auto result = std::make_unique<collision::PairQueryResult>();
  const auto scratch = std::make_unique<collision::FeatureScratch>();
  for (const bool touching : {true, false}) {
    const std::vector<Pose>& poses = touching ? pair.poses.touching : pair.poses.pressed;
    for (const auto& [name, correct_ridges] : kQueryVariants) {
      progress(fmt::format("errors: {}", name));
      const auto query = [&](std::size_t i) {
        collision::PairQuery asked = pair.tickQuery(poses[i]);
        asked.correct_ridges = correct_ridges;
        return asked;
      };
      const Percentiles times = timed(poses.size(), rounds, [&](std::size_t i) {
        const collision::PairQuery asked = query(i);
        collision::queryPair(asked, *result);
        collision::queryFeatures(asked, pair.features, *scratch, *result);
      });
      test::ContactErrors errors(touching ? pair.tickQuery(Pose()).margin : 0.0);
      for (std::size_t i = 0; i < poses.size(); ++i) {
        collision::PairQuery asked = query(i);
        asked.sum_penalty = true;
        collision::queryPair(asked, *result);
        errors.add(asked, *result, pair.truth);
      }
      table.rows.push_back({name, touching ? "touching" : "pressed", static_cast<double>(poses.size()),
                            static_cast<double>(errors.pointsInside()), 1e3 * errors.depth(0.5),
                            1e3 * errors.depth(0.99), 100.0 * errors.missed(), 100.0 * errors.force(0.5),
                            100.0 * errors.force(0.9), times.median, times.p99});
    }
  }
  return table;
}

}  // namespace tenon::bench
