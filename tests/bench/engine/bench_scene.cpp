#include "tests/bench/engine/bench_scene.h"

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "scenarios/part_generator/engine_bay_layout.h"
#include "tests/bench/engine/measured_child.h"

namespace tenon::bench {

namespace {

constexpr std::size_t kPoses = 1500;
constexpr double kMeshUnit = 1e-3;  // [m] of the generated meshes

struct BakedPart {
  const char* name;
  const char* voxel;
  const char* points;
};
constexpr BakedPart kBay{"engine_bay", "3mm", "20000"};
constexpr BakedPart kBox{"control_box", "2mm", "10500"};

struct BakedMesh {
  std::shared_ptr<const structures::HapticStructures> structures;
  bake::TriangleMesh mesh;
};

Result<BakedMesh> bakePart(const BenchSceneOptions& options, const BakedPart& part, Table& table) {
  const std::string mesh = (options.folder / "parts" / (std::string(part.name) + ".stl")).string();
  const std::string file = (options.folder / (std::string(part.name) + ".tenon")).string();
  const auto usage = runMeasured("tenon-bake", {mesh, "-o", file, "--voxel", part.voxel, "--points",
                                                part.points, "--unit", "mm", "--quiet", "--overwrite"});
  if (!usage) return fail(usage.error().what);
  const auto structures = structures::openStructures(file);
  if (!structures) return fail(structures.error().what);
  auto triangles = bake::importMesh(mesh, kMeshUnit);
  if (!triangles) return fail(triangles.error().what);
  const auto bricks = static_cast<double>((*structures)->info.bricks);
  table.rows.push_back({part.name, static_cast<double>(triangles->triangles.size()), part.voxel, bricks,
                        static_cast<double>(std::filesystem::file_size(file)) / bricks,
                        static_cast<double>((*structures)->shell.points().size()), usage->wall, usage->cpu,
                        1e-6 * usage->memory_bytes});
  return BakedMesh{*structures, std::move(*triangles)};
}

}  // namespace

Result<BenchScene> makeScene(const BenchSceneOptions& options, const ProgressCallback& progress) {
  progress("generating the parts");
  std::error_code error;
  std::filesystem::create_directories(options.folder / "parts", error);
  const auto parts =
      runMeasured("tenon-parts", {"engine_bay", (options.folder / "parts").string(), "--detail",
                                  fmt::format("{}", options.detail), "--overwrite"});
  if (!parts) return fail(parts.error().what);
  BenchScene scene;
  scene.bake = {
      "bake",
      "Baking (item 1: bay 60 s, 3 GB, 1,600 bytes per brick; a part of 100,000 triangles 2 s)",
      {"part", "triangles", "voxel", "bricks", "bytes per brick", "points", "wall s", "CPU s", "peak MB"},
      {},
      {"bytes per brick: file size over number of bricks, pointshell and index included"}};
  progress("baking the engine bay");
  auto bay = bakePart(options, kBay, scene.bake);
  if (!bay) return fail(bay.error().what);
  progress("baking the control box");
  auto box = bakePart(options, kBox, scene.bake);
  if (!box) return fail(box.error().what);
  scene.bay = bay->structures;
  scene.bay_mesh = std::move(bay->mesh);
  scene.box = box->structures;
  scene.box_mesh = std::move(box->mesh);
  progress("generating poses");
  const part_generator::engine_bay::PartLayout& target = part_generator::engine_bay::parts().front();
  InsertionTask insertion;
  insertion.X_BT = Pose(target.p_WT);
  insertion.direction_B = part_generator::engine_bay::approachDirection(target.approach);
  scene.poses = insertionPoses(scene.box->shell, scene.bay->field, insertion, kPoses);
  if (scene.poses.contact.empty()) return fail("the control box never touches the bay on its path");
  return scene;
}

}  // namespace tenon::bench
