#include <csignal>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "idl/types/output_files.h"
#include "server/bake/length.h"
#include "server/bake/octree_file.h"
#include "server/bake/sweep.h"
#include "server/tools/pose_lines.h"

namespace tenon::tools {
namespace {

constexpr int kWrongUsage = 2;

volatile std::sig_atomic_t interrupted = 0;

struct VoxelsArguments {
  std::string body;
  std::string poses;
  std::string scene;
  std::string output;
  std::string cell = "5mm";
  std::string dilation = "0mm";
  bool overwrite = false;
};

int printError(const Error& error, int exit_code = 1) {
  fmt::print(stderr, "tenon-voxels: {}\n", error.what);
  return interrupted != 0 ? 130 : exit_code;
}

void printCells(const bake::VoxelSet& cells, std::size_t poses) {
  Eigen::AlignedBox3d box;
  cells.visit([&](const bake::VoxelSet::Cell& cell) {
    box.extend(cell.cast<double>() * cells.cell());
    box.extend((cell + bake::VoxelSet::Cell::Ones()).cast<double>() * cells.cell());
  });
  const Vector3& low = box.min();
  const Vector3& high = box.max();
  fmt::print("poses         {}\n", poses);
  fmt::print("cells         {} of {:.6g} m\n", cells.count(), cells.cell());
  fmt::print("volume        {:.6g} m^3\n", cells.volume());
  fmt::print("box           from ({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g}) m\n", low.x(), low.y(),
             low.z(), high.x(), high.y(), high.z());
}

void printClearance(const bake::Clearance& found) {
  const Vector3& p = found.p_WP;
  const char* bound = "";
  if (!found.exact) bound = found.distance < 0.0 ? "deeper than " : "more than ";
  fmt::print("clearance     {}{:.6g} m, after pose {} at ({:.6g}, {:.6g}, {:.6g}) m\n", bound,
             found.exact ? found.distance : std::abs(found.distance), found.pose, p.x(), p.y(), p.z());
}

Result<bake::SweepOptions> optionsFrom(const VoxelsArguments& arguments) {
  bake::SweepOptions options;
  const auto cell = bake::parseLength(arguments.cell);
  if (!cell) return fail("--cell: " + cell.error().what);
  if (*cell <= 0.0) return fail("--cell " + arguments.cell + ": must be greater than 0");
  options.cell = *cell;
  const auto dilation = bake::parseLength(arguments.dilation);
  if (!dilation) return fail("--grow: " + dilation.error().what);
  if (*dilation < 0.0) return fail("--grow " + arguments.dilation + ": must be 0 or more");
  options.dilation = *dilation;
  if (!arguments.output.empty() && !bake::isOctree(arguments.output))
    return fail(arguments.output + ": must end in .bt or .ot");
  return options;
}

int run(const VoxelsArguments& arguments) {
  const auto options = optionsFrom(arguments);
  if (!options) return printError(options.error(), kWrongUsage);
  const ProgramFiles files{
      {arguments.output}, {arguments.body, arguments.poses, arguments.scene}, arguments.overwrite};
  if (const auto refusal = refuseOutputs(files)) return printError({refusal->what}, refusal->exit_code);
  const auto body = structures::openStructures(arguments.body);
  if (!body) return printError(body.error());
  std::vector<Pose> poses{Pose::Identity()};
  if (!arguments.poses.empty()) {
    auto read = readPoses(arguments.poses);
    if (!read) return printError(read.error());
    poses = std::move(*read);
  }
  const bake::BakeProgress progress = [](double, std::string_view) { return interrupted == 0; };
  const auto cells = bake::sweep(**body, poses, *options, progress);
  if (!cells) return printError({arguments.body + ": " + cells.error().what});
  if (cells->count() == 0) {
    return printError(
        {arguments.body + ": no cell's middle is inside; use smaller cells, or --grow for a thin sheet"});
  }
  printCells(*cells, poses.size());
  if (!arguments.scene.empty()) {
    const auto scene = structures::openStructures(arguments.scene);
    if (!scene) return printError(scene.error());
    const auto found = bake::clearance(**body, poses, (*scene)->field, options->cell / 2, progress);
    if (!found) return printError({arguments.scene + ": " + found.error().what});
    printClearance(*found);
  }
  if (arguments.output.empty()) return 0;
  if (const auto ok = bake::writeOctree(arguments.output, *cells); !ok) return printError(ok.error());
  return 0;
}

int main(int argc, char** argv) {
  VoxelsArguments arguments;
  CLI::App app{
      "Voxelises a baked body at rest or along a path (the swept volume of a part or an arm), prints the\n"
      "volume and the clearance to a scene, and writes the filled cells as an OctoMap. Between two poses\n"
      "the body's centre translates linearly and it rotates at constant angular velocity.",
      "tenon voxels"};
  app.add_option("BODY", arguments.body, "structure file of the body (from tenon bake)")->required();
  app.add_option("--poses", arguments.poses,
                 "file of poses of the body in the world, one `x y z qw qx qy qz` per line, in metres "
                 "(default: at rest)");
  app.add_option("--scene", arguments.scene,
                 "structure file of the scene for the clearance, at rest in the world");
  app.add_option("-o,--output", arguments.output,
                 "the octree to write: .bt (free or occupied) or .ot (occupancy probabilities)");
  app.add_option("--cell", arguments.cell, "edge of a cell")->capture_default_str();
  app.add_option("--grow", arguments.dilation, "dilation of the body, at most the band of its field")
      ->capture_default_str();
  app.add_flag("--overwrite", arguments.overwrite, kOverwriteHelp);
  app.footer(
      "A cell is filled when its middle is inside. Lengths are written 5mm, 0.5 cm or 0.005m. `tenon bake`\n"
      "accepts the octree as a mesh.\n"
      "Exit codes: 0 success, 1 error (the reason is on stderr), 2 wrong usage, 130 interrupted.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::signal(SIGTERM, [](int) { interrupted = 1; });
  return run(arguments);
}

}  // namespace
}  // namespace tenon::tools

int main(int argc, char** argv) { return tenon::tools::main(argc, argv); }
