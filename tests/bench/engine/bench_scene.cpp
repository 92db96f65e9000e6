#include "tests/bench/engine/bench_scene.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/scenario_parts.h"
#include "server/simulation/coll_pair.h"
#include "tests/bench/engine/measured_child.h"

namespace tenon::bench {

namespace {

constexpr std::size_t kPoses = 150;      // of each kind
constexpr double kRegionMargin = 0.02;   // [m] round the path: solids farther away are not nearest
constexpr double kMarginAtRest = 0.001;  // [m] up to which island solvers list contacts

Result<part_generator::PartMesh> generated(const std::string& name, double detail) {
  const part_generator::PartSet set = part_generator::engineBayParts();
  for (const part_generator::ScenarioPart& part : set.parts)
    if (part.name == name) return part.make(detail);
  return fail("there is no generated part " + name);
}

/// The triangles as a mesh; corners are not shared.
bake::TriangleMesh meshOf(const part_generator::PartMesh& part) {
  bake::TriangleMesh mesh;
  for (const auto& corners : part.triangles) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vector3& corner : corners) mesh.vertices.push_back(corner.cast<float>());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// The solids of a part that intersect a box.
test::SolidUnion solidsIn(const part_generator::PartMesh& part, const Eigen::AlignedBox3d& box) {
  std::vector<test::SolidUnion::Solid> solids;
  for (const part_generator::PartMesh::Shell& shell : part.shells) {
    const auto begin = part.triangles.begin() + static_cast<std::ptrdiff_t>(shell.first);
    test::SolidUnion::Solid solid{{begin, begin + static_cast<std::ptrdiff_t>(shell.count)}, shell.closed};
    Eigen::AlignedBox3d own;
    for (const auto& triangle : solid.triangles) {
      for (const Vector3& corner : triangle) own.extend(corner);
    }
    if (own.intersects(box)) solids.push_back(std::move(solid));
  }
  return test::SolidUnion(std::move(solids));
}

}  // namespace

collision::PairQuery tickQuery(const simulation::Scene& scene, const simulation::PairSpec& pair,
                               const Pose& X_WA, const Pose& X_WB, double margin) {
  collision::PairQuery query{&scene.objects[pair.a.value].structures->shell,
                             &scene.objects[pair.b.value].structures->field, X_WA, X_WB,
                             std::max(margin, kMarginAtRest)};
  query.reduce = true;
  return query;
}

Result<Table> bakeTable(const std::filesystem::path& scenario, const std::filesystem::path& cache,
                        double detail, const ProgressCallback& progress) {
  progress("first start: generating, baking and checking the scene");
  std::error_code error;
  std::filesystem::remove_all(cache, error);
  const auto usage = runMeasured("tenon-check", {scenario.string(), "--cache", cache.string(), "--detail",
                                                 fmt::format("{}", detail), "--quiet"});
  if (!usage) return fail(usage.error().what);
  const auto loaded = session::loadScene(scenario, {.cache = cache, .detail = detail});
  if (!loaded) return fail(loaded.error().what);
  Table table{"bake",
              "First start of the engine bay: parts are generated, baked and checked (aim: 60 s)",
              {"object", "voxel mm", "finest mm", "bricks", "points", "wall s", "CPU s", "peak MB"},
              {},
              {"the whole scene by `tenon check`, with an empty cache"}};
  for (const simulation::ObjectSpec& object : loaded->scene->objects) {
    if (object.structures == nullptr) continue;
    const auto& [field, shell] = std::tie(object.structures->field, object.structures->shell);
    table.rows.push_back({object.name, 1e3 * field.voxel(), 1e3 * field.voxel() / field.layout().refinement,
                          static_cast<double>(object.structures->info.bricks),
                          static_cast<double>(shell.points().size()), TableCell::none(), TableCell::none(),
                          TableCell::none()});
  }
  table.rows.push_back({"all", TableCell::none(), TableCell::none(), TableCell::none(), TableCell::none(),
                        usage->wall, usage->cpu, 1e-6 * usage->memory_bytes});
  return table;
}

Result<BenchPair> makePair(const session::LoadedScene& loaded, double detail,
                           const ProgressCallback& progress) {
  const simulation::Scene& scene = *loaded.scene;
  const ObjectId box = loaded.scenario->objectNamed("control_box");
  const ObjectId bay = loaded.scenario->objectNamed("engine_bay");
  const auto spec =
      std::find_if(scene.pairs.begin(), scene.pairs.end(),
                   [&](const simulation::PairSpec& pair) { return pair.a == box && pair.b == bay; });
  if (!box.valid() || !bay.valid() || spec == scene.pairs.end())
    return fail("the scenario has no control box in an engine bay");
  const auto box_part = generated("control_box", detail);
  const auto bay_part = generated("engine_bay", detail);
  if (!box_part || !bay_part) return fail(box_part ? bay_part.error().what : box_part.error().what);

  BenchPair pair;
  pair.scene = loaded.scene;
  pair.spec = &*spec;
  pair.features = simulation::featuresOf(scene, *spec);
  pair.box_mesh = meshOf(*box_part);
  pair.bay_mesh = meshOf(*bay_part);

  const part_generator::engine_bay::PartLayout& target = part_generator::engine_bay::parts().front();
  InsertionTask task;
  task.X_BT = Pose(target.p_WT);
  task.direction_B = part_generator::engine_bay::approachDirection(target.approach);
  progress("the bay's solids around the control box");
  Eigen::AlignedBox3d region = regionOf(pair.box_mesh, task);
  region.min().array() -= kRegionMargin;
  region.max().array() += kRegionMargin;
  pair.truth = solidsIn(*bay_part, region);
  progress("poses, by exact distances");
  pair.poses =
      insertionPoses(pair.box_mesh, pair.truth, scene.objects[bay.value].structures->field, task, kPoses);
  if (pair.poses.pressed.empty()) return fail("the control box never touches the bay on its path");
  return pair;
}

}  // namespace tenon::bench
