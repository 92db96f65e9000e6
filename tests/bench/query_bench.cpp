#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "server/collision/pair_query.h"
#include "server/collision/query_kernels.h"
#include "server/structures/haptic_structures.h"
#include "tests/bench/engine/pose_sets.h"
#include "tests/bench/engine/timing.h"

/// Queries of baked structures: `query_bench FIELD SHELL x y z [options of Google Benchmark]`, where the
/// shell's body belongs at x y z [m] in the field's body and comes there along -z. Every instruction set,
/// free, near and in contact, pruned and flat, with warm and with cold caches: times compare only within one
/// run.
namespace tenon::bench {
namespace {

constexpr std::size_t kPoses = 1500;
constexpr int kRounds = 5;

using StructuresPtr = std::shared_ptr<const HapticStructures>;

struct Scene {
  StructuresPtr field, shell;
  PoseSets poses;
};

struct Case {
  const char* name;
  const std::vector<Pose> PoseSets::*poses;
  bool prune;
  bool tick;  ///< as the island solver asks: dilated, with a margin and thinned; else with the sum of forces
  bool cold;
};

constexpr Case kCases[] = {
    {"Free", &PoseSets::free, true, false, false},
    {"Near", &PoseSets::near, true, false, false},
    {"Contact", &PoseSets::contact, true, false, false},
    {"ContactTick", &PoseSets::contact, true, true, false},
    {"ContactCold", &PoseSets::contact, true, false, true},
    {"FreeCold", &PoseSets::free, true, false, true},
    {"ContactFlat", &PoseSets::contact, false, false, false},
};

PairQuery queryOf(const Scene& scene, const Case& which, const Pose& X_BA) {
  PairQuery query{&scene.shell->shell, &scene.field->field, X_BA, Pose()};
  query.prune = which.prune;
  query.sum = !which.tick;
  query.thin = which.tick;
  if (which.tick) {
    query.dilation = 0.00065;
    query.margin = 0.001;
  }
  return query;
}

/// One iteration is the whole set of poses, `kRounds` times; the counters are what matters.
void run(benchmark::State& state, const Scene& scene, const Case& which, std::string_view isa) {
  chooseKernels(isa);
  std::vector<Pose> poses = scene.poses.*which.poses;
  // a flush takes 10 ms
  if (which.cold) {
    for (std::size_t i = 0; 5 * i < poses.size(); ++i) poses[i] = poses[5 * i];
    poses.resize((poses.size() + 4) / 5);
  }
  const auto result = std::make_unique<PairQueryResult>();
  ColdCaches evict;
  Percentiles times;
  for (auto _ : state) {
    const auto ask = [&](std::size_t i) { queryPair(queryOf(scene, which, poses[i]), *result); };
    times = timed(poses.size(), which.cold ? 2 : kRounds, ask, [&] {
      if (which.cold) evict();
    });
  }
  double contacts = 0.0;
  double visited = 0.0;
  for (const Pose& X_BA : poses) {
    queryPair(queryOf(scene, which, X_BA), *result);
    contacts += result->counts.points_colliding;
    visited += result->counts.points_visited;
  }
  const auto count = static_cast<double>(poses.size());
  chooseKernels(supportedKernels().back().isa);
  state.counters["median_us"] = times.median;
  state.counters["p99_us"] = times.p99;
  state.counters["poses"] = count;
  state.counters["points"] = static_cast<double>(scene.shell->shell.points().size());
  state.counters["visited"] = visited / count;
  state.counters["colliding"] = contacts / count;
}

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (argc != 6) {
    std::fprintf(stderr, "query_bench FIELD SHELL x y z [--benchmark_...]\n");
    return 2;
  }
  const auto field = openStructures(argv[1]);
  const auto shell = openStructures(argv[2]);
  for (const auto* structures : {&field, &shell}) {
    if (*structures) continue;
    std::fprintf(stderr, "query_bench: %s\n", structures->error().what.c_str());
    return 1;
  }
  Insertion insertion;
  insertion.X_BT = Pose(Vector3(std::atof(argv[3]), std::atof(argv[4]), std::atof(argv[5])));
  const Scene scene{*field, *shell, insertionPoses((*shell)->shell, (*field)->field, insertion, kPoses)};
  for (const QueryKernels& kernels : supportedKernels()) {
    for (const Case& which : kCases) {
      benchmark::RegisterBenchmark((std::string(which.name) + "/" + std::string(kernels.isa)).c_str(), run,
                                   std::cref(scene), std::cref(which), kernels.isa)
          ->Iterations(1)
          ->Unit(benchmark::kMillisecond);
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace tenon::bench

int main(int argc, char** argv) { return tenon::bench::main(argc, argv); }
