#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "server/collision/island_solver.h"
#include "server/collision/pair_query.h"
#include "server/collision/query_kernels.h"
#include "tests/support/analytic_structures.h"

/// Times of a query and of a solve, compared with sampling every point in the same run; times are comparable
/// only within one run. Scene: a box of about 10,000 points that is dragged over a floor and into a corner.
namespace tenon::bench {
namespace {

constexpr int kPoses = 256;

const test::StructuresPtr& box() {
  static const test::StructuresPtr structures = test::boxStructures({0.3, 0.2, 0.1}, 0.003, 0.0046);
  return structures;
}

const test::StructuresPtr& corner() {
  static const test::StructuresPtr structures = test::dilated(test::cornerStructures(0.6, 0.003), 0.0027);
  return structures;
}

/// Poses about 1 mm apart with an edge some millimetres deep in the floor; `height` [m] > 0 lifts the box
/// off.
std::vector<Pose> posePath(double height) {
  std::vector<Pose> poses;
  for (int i = 0; i < kPoses; ++i) {
    const Vector3 p(0.17 + 0.001 * i, 0.12 + 0.0005 * i, 0.06 + height);
    poses.emplace_back(p, expRotation({0.12, 0.002 * (i % 40), 0.0}));
  }
  return poses;
}

collision::PairQuery queryAt(const Pose& X_WA) {
  return {&box()->shell, &corner()->field, X_WA, Pose(), 0.001};
}

/// A query with the kernels of one instruction set.
void Query(benchmark::State& state, std::string_view isa, double height, bool prune) {
  collision::chooseKernels(isa);
  const std::vector<Pose> poses = posePath(height);
  const auto result = std::make_unique<collision::PairQueryResult>();
  std::vector<double> times;
  double visited = 0.0;
  double contacts = 0.0;
  std::size_t i = 0;
  for (auto _ : state) {
    collision::PairQuery query = queryAt(poses[i++ % kPoses]);
    query.prune = prune;
    const auto begin = std::chrono::steady_clock::now();
    collision::queryPair(query, *result);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
    times.push_back(took.count());
    visited += result->counts.points_visited;
    contacts += static_cast<double>(result->contacts.size());
  }
  collision::chooseKernels(collision::supportedKernels().back().isa);
  std::sort(times.begin(), times.end());
  state.counters["median_us"] = times[times.size() / 2];
  state.counters["p99_us"] = times[times.size() * 99 / 100];
  state.counters["points"] = static_cast<double>(box()->shell.points().size());
  state.counters["visited"] = benchmark::Counter(visited, benchmark::Counter::kAvgIterations);
  state.counters["contacts"] = benchmark::Counter(contacts, benchmark::Counter::kAvgIterations);
}

void registerQueries() {
  for (const collision::QueryKernels& kernels : collision::supportedKernels()) {
    const std::string isa(kernels.isa);
    const auto add = [&](const char* name, double height, bool prune) {
      benchmark::RegisterBenchmark((std::string("Query/") + name + "/" + isa).c_str(), Query, kernels.isa,
                                   height, prune)
          ->Unit(benchmark::kMicrosecond);
    };
    add("InContact", 0.0, true);
    add("Free", 0.05, true);
    add("NoPruning", 0.0, false);
  }
}

void EveryPoint(benchmark::State& state) {
  const std::vector<Pose> poses = posePath(0.0);
  std::size_t i = 0;
  for (auto _ : state) {
    const collision::PairQuery query = queryAt(poses[i++ % kPoses]);
    const Pose X_BA = query.X_WB.inverse() * query.X_WA;
    const Matrix3 R_BA = X_BA.matrix();
    double deepest = 0.0;
    for (const structures::ShellPoint& point : query.shell_A->points()) {
      const structures::FieldSample sample =
          query.field_B->sample(X_BA.translation() + R_BA * point.p_MP.cast<double>());
      deepest = std::min(deepest, sample.distance);
    }
    benchmark::DoNotOptimize(deepest);
  }
}
BENCHMARK(EveryPoint)->Unit(benchmark::kMicrosecond);

/// One QP with all contacts of a body that is slightly rotated in the corner.
void Solve(benchmark::State& state) {
  const auto result = std::make_unique<collision::PairQueryResult>();
  const Pose X_WB(Vector3(0.1525, 0.1025, 0.0525), expRotation({0.003, 0.002, 0.0}));
  collision::queryPair(queryAt(X_WB), *result);
  collision::MovableBody body;
  body.X_WB = X_WB;
  body.radius = box()->shell.radius();
  body.springs.push_back({Pose(X_WB.translation() - Vector3::Constant(0.02)), Vector3::Zero(), 2000.0, 20.0});
  std::vector<collision::ContactConstraint> rows;
  for (const collision::Contact& contact : result->contacts) {
    rows.push_back(
        {0, collision::ContactConstraint::kStatic, contact.n_W, contact.p_WP, std::max(contact.gap, 0.0)});
  }
  collision::MotionSolver solver(1, rows.size());
  std::vector<Displacement> motions(1);
  std::vector<double> multipliers(rows.size());
  double iterations = 0.0;
  for (auto _ : state) {
    iterations += solver.solve(std::span(&body, 1), rows, motions, multipliers).iterations;
  }
  state.counters["rows"] = static_cast<double>(rows.size());
  state.counters["iterations"] = benchmark::Counter(iterations, benchmark::Counter::kAvgIterations);
}
BENCHMARK(Solve)->Unit(benchmark::kMicrosecond);

/// Whole ticks of the held box. The hand moves back and forth along y at `speed` [m/s] from X_WH.
void Tick(benchmark::State& state, const Pose& X_WH, double speed) {
  std::vector<collision::MovableBody> bodies(1);
  // starts above the corner, without contact
  bodies[0].X_WB = Pose(X_WH.translation() + Vector3(0.1, 0.1, 0.15), X_WH.rotation());
  bodies[0].radius = box()->shell.radius();
  bodies[0].springs.push_back({bodies[0].X_WB, Vector3::Zero(), 2000.0, 20.0});
  std::vector<collision::IslandPair> pairs(1);
  pairs[0].body_a = 0;
  pairs[0].shell_A = &box()->shell;
  pairs[0].field_B = &corner()->field;
  std::vector<collision::IslandPairResult> results(1);
  results[0].multipliers.resize(collision::kMaxPairContacts);
  pairs[0].last = &results[0];
  collision::IslandSolver solver(1, 1);
  int tick = 0;
  const auto step = [&] {
    const double hand_y = speed * 0.001 * std::abs(tick % 400 - 200);
    ++tick;
    bodies[0].springs[0].X_WG = Pose(X_WH.translation() + Vector3(0.0, hand_y, 0.0), X_WH.rotation());
    return solver.solve(bodies, pairs, collision::SolveLimits{}, results);
  };
  for (int i = 0; i < 200; ++i) step();
  double traversals = 0.0;
  double steps = 0.0;
  double contacts = 0.0;
  for (auto _ : state) {
    const collision::SolveReport report = step();
    traversals += report.traversals;
    steps += report.steps;
    contacts += static_cast<double>(results[0].query.contacts.size());
  }
  state.counters["traversals"] = benchmark::Counter(traversals, benchmark::Counter::kAvgIterations);
  state.counters["steps"] = benchmark::Counter(steps, benchmark::Counter::kAvgIterations);
  state.counters["contacts"] = benchmark::Counter(contacts, benchmark::Counter::kAvgIterations);
}
const Pose kFlatOnBoth(Vector3(0.14, 0.13, 0.045), expRotation({0.05, 0.0, 0.02}));
const Pose kOnAnEdge(Vector3(0.25, 0.16, 0.06), expRotation({0.3, 0.0, 0.0}));
const Pose kTilted(Vector3(0.25, 0.2, 0.1), expRotation({0.5, 0.4, 0.0}));
BENCHMARK_CAPTURE(Tick, FlatInCorner, kFlatOnBoth, 0.5)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(Tick, FlatInCornerStill, kFlatOnBoth, 0.0)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(Tick, Edge, kOnAnEdge, 0.5)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(Tick, Tilted, kTilted, 0.5)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace tenon::bench

int main(int argc, char** argv) {
  tenon::bench::registerQueries();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
