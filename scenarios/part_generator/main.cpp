#include <cstdio>
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "idl/types/number_range.h"
#include "idl/types/output_files.h"
#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/scenario_parts.h"

namespace tenon::part_generator {
namespace {

void printPartSet(const PartSet& set) {
  fmt::print("{}\n", set.name);
  for (const ScenarioPart& part : set.parts) fmt::print("  {:<18}{}\n", part.name, part.description);
}

const PartSet* findSet(const std::string& name) {
  for (const PartSet& set : partSets()) {
    if (set.name == name) return &set;
  }
  return nullptr;
}

std::string knownSets() {
  std::string names;
  for (const PartSet& set : partSets()) names += fmt::format("{}{}", names.empty() ? "" : ", ", set.name);
  return names;
}

std::string formatted(const Vector3& v) {
  return fmt::format("[{:.4f}, {:.4f}, {:.4f}]", v.x(), v.y(), v.z());
}

std::string formatted(const Pose& X) {
  const Quaternion& q = X.rotation();
  return fmt::format("at {}  q [{:.6f}, {:.6f}, {:.6f}, {:.6f}]", formatted(X.translation()), q.w(), q.x(),
                     q.y(), q.z());
}

void printLayout() {
  fmt::print("engine_bay: world frame x right, y away, z up; metres; q is [w, x, y, z]\n");
  fmt::print("clearance of every part with the bay: {:.4f} (both sides), seat {:.4f} below the target\n\n",
             engine_bay::kClearance, engine_bay::kSeatGap);
  for (const engine_bay::PartLayout& part : engine_bay::parts()) {
    const Eigen::AlignedBox3d fine = engine_bay::refineBox(part);
    fmt::print("{}\n  color     #{:06x}\n  start     {}\n  target    {}\n", part.name, part.color,
               formatted(engine_bay::startPose(part)), formatted(engine_bay::targetPose(part)));
    fmt::print("  approach  {} over {:.2f}\n  tool      {}\n  refine    {} {}\n",
               formatted(engine_bay::approachDirection(part.approach)), engine_bay::kApproachDistance,
               formatted(engine_bay::toolPose(part)), formatted(Vector3(fine.min())),
               formatted(Vector3(fine.max())));
  }
  for (const engine_bay::OtherObject& other : engine_bay::others()) {
    fmt::print("{}\n  color     #{:06x}\n  start     {}\n", other.name, other.color, formatted(other.X_WO));
  }
}

/// The file of a part in `folder`.
std::filesystem::path fileOf(const ScenarioPart& part, const std::filesystem::path& folder) {
  return folder / fmt::format("{}.stl", part.name);
}

int writeParts(const PartSet& set, const std::filesystem::path& folder, double detail) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    fmt::print(stderr, "tenon-parts: {}: cannot be created: {}\n", folder.string(), error.message());
    return 1;
  }
  std::size_t total = 0;
  for (const ScenarioPart& part : set.parts) {
    const PartMesh mesh = part.make(detail);
    const std::filesystem::path file = fileOf(part, folder);
    if (const auto written = writeStl(file, mesh); !written) {
      fmt::print(stderr, "tenon-parts: {}\n", written.error().what);
      return 1;
    }
    const Vector3 size = mesh.box().sizes() * 1e3;
    fmt::print("{:<40} {:>9} triangles  {:8.1f} x {:8.1f} x {:8.1f} mm\n", file.string(),
               mesh.triangles.size(), size.x(), size.y(), size.z());
    total += mesh.triangles.size();
  }
  fmt::print("{} files, {} triangles, detail {:.3f}\n", set.parts.size(), total, detail);
  return 0;
}

int main(int argc, char** argv) {
  CLI::App app{
      "Generates the meshes of a scenario's parts: binary STL in millimetres, reproducible byte by byte."};
  app.name("tenon-parts");
  std::string scenario;
  std::string folder;
  double detail = -1.0;
  std::size_t triangles = 0;
  bool list = false;
  bool layout = false;
  ProgramFiles files;
  app.add_option("SCENARIO", scenario, "scenario: " + knownSets());
  app.add_option("OUTDIR", folder, "folder for the files, created if it does not exist");
  auto* detail_option =
      app.add_option("--detail", detail,
                     "tessellation of curved surfaces, from 0 (coarse) to 1 (fine); default: the scenario's")
          ->check(numberFrom(0.0, 1.0));
  app.add_option("--triangles", triangles, "approximate number of triangles of all files together")
      ->check(CLI::Range(0, 1'000'000'000))
      ->excludes(detail_option);
  app.add_flag("--list", list, "print the scenarios and their parts, and write nothing");
  app.add_flag("--layout", layout, "print the poses and boxes of the engine bay, and write nothing");
  app.add_flag("--overwrite", files.overwrite, kOverwriteHelp);
  app.footer("Examples:\n  tenon-parts peg_and_box out/\n  tenon-parts engine_bay out/ --triangles 300000");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  if (list && scenario.empty()) {
    for (const PartSet& set : partSets()) printPartSet(set);
    return 0;
  }
  const PartSet* set = findSet(scenario);
  if (set == nullptr) {
    fmt::print(stderr, "tenon-parts: {}; known scenarios: {}\n",
               scenario.empty() ? "no scenario given" : fmt::format("no scenario '{}'", scenario),
               knownSets());
    return 2;
  }
  if (list) {
    printPartSet(*set);
    return 0;
  }
  if (layout) {
    if (set->name != "engine_bay") {
      fmt::print(stderr, "tenon-parts: {} has no layout; only engine_bay has one\n", set->name);
      return 2;
    }
    printLayout();
    return 0;
  }
  if (folder.empty()) {
    fmt::print(stderr, "tenon-parts: nothing to do: expected a folder for the files\n");
    return 2;
  }
  for (const ScenarioPart& part : set->parts) files.outputs.push_back(fileOf(part, folder));
  if (const auto refusal = refuseOutputs(files)) {
    fmt::print(stderr, "tenon-parts: {}\n", refusal->what);
    return refusal->exit_code;
  }
  if (triangles > 0) detail = detailFor(*set, triangles);
  if (detail < 0.0) detail = set->default_detail;
  return writeParts(*set, folder, detail);
}

}  // namespace
}  // namespace tenon::part_generator

int main(int argc, char** argv) { return tenon::part_generator::main(argc, argv); }
