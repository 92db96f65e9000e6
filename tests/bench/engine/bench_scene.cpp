#include "tests/bench/engine/bench_scene.h"

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "scenarios/engine_bay/layout.h"
#include "tests/bench/engine/measured_child.h"

namespace tenon::bench {

namespace {

constexpr std::size_t kPoses = 1500;
constexpr double kUnit = 1e-3;  // [m] of the generated meshes

struct Part {
  const char* name;
  const char* voxel;
  const char* points;
};
constexpr Part kBay{"engine_bay", "3mm", "20000"};
constexpr Part kBox{"control_box", "2mm", "10500"};

struct Made {
  std::shared_ptr<const HapticStructures> structures;
  TriangleMesh mesh;
};

Result<Made> make(const SceneWishes& wishes, const Part& part, Table& table) {
  const std::string mesh = (wishes.folder / "parts" / (std::string(part.name) + ".stl")).string();
  const std::string file = (wishes.folder / (std::string(part.name) + ".tenon")).string();
  const auto spent = runMeasured("tenon-bake", {mesh, "-o", file, "--voxel", part.voxel, "--points",
                                                part.points, "--unit", "mm", "--quiet"});
  if (!spent) return fail(spent.error().what);
  const auto structures = openStructures(file);
  if (!structures) return fail(structures.error().what);
  auto triangles = importMesh(mesh, kUnit);
  if (!triangles) return fail(triangles.error().what);
  const auto bricks = static_cast<double>((*structures)->info.bricks);
  table.rows.push_back({part.name, static_cast<double>(triangles->triangles.size()), part.voxel, bricks,
                        static_cast<double>(std::filesystem::file_size(file)) / bricks,
                        static_cast<double>((*structures)->shell.points().size()), spent->wall, spent->cpu,
                        1e-6 * spent->memory_bytes});
  return Made{*structures, std::move(*triangles)};
}

}  // namespace

Result<BenchScene> makeScene(const SceneWishes& wishes, const Say& say) {
  say("making the parts");
  std::error_code error;
  std::filesystem::create_directories(wishes.folder / "parts", error);
  const auto parts = runMeasured("tenon-parts", {"engine_bay", (wishes.folder / "parts").string(), "--detail",
                                                 fmt::format("{}", wishes.detail)});
  if (!parts) return fail(parts.error().what);
  BenchScene scene;
  scene.bake = {
      "bake",
      "Baking (item 1: bay 60 s, 3 GB, 1,600 bytes a brick; a part of 100,000 triangles 2 s)",
      {"part", "triangles", "voxel", "bricks", "bytes a brick", "points", "wall s", "CPU s", "peak MB"},
      {},
      {"file size over bricks, the shell and the index included"}};
  say("baking the engine bay");
  auto bay = make(wishes, kBay, scene.bake);
  if (!bay) return fail(bay.error().what);
  say("baking the control box");
  auto box = make(wishes, kBox, scene.bake);
  if (!box) return fail(box.error().what);
  scene.bay = bay->structures;
  scene.bay_mesh = std::move(bay->mesh);
  scene.box = box->structures;
  scene.box_mesh = std::move(box->mesh);
  say("choosing poses");
  const engine_bay::PartLayout& place = engine_bay::parts().front();
  Insertion insertion;
  insertion.X_BT = Pose(place.p_WT);
  insertion.direction_B = engine_bay::approachDirection(place.approach);
  scene.poses = insertionPoses(scene.box->shell, scene.bay->field, insertion, kPoses);
  if (scene.poses.contact.empty()) return fail("the control box never touches the bay on its way in");
  return scene;
}

}  // namespace tenon::bench
