#include <csignal>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "server/bake/length.h"
#include "server/bake/octree_file.h"
#include "server/bake/sweep.h"
#include "server/pose_lines.h"

namespace tenon {
namespace {

volatile std::sig_atomic_t interrupted = 0;

struct Arguments {
  std::string body;
  std::string poses;
  std::string scene;
  std::string output;
  std::string cell = "5mm";
  std::string grow = "0mm";
};

int complain(const Error& error) {
  fmt::print(stderr, "tenon-voxels: {}\n", error.what);
  return interrupted != 0 ? 130 : 1;
}

void printCells(const VoxelSet& cells, std::size_t poses) {
  Eigen::AlignedBox3d box;
  cells.visit([&](const VoxelSet::Cell& cell) {
    box.extend(cell.cast<double>() * cells.cell());
    box.extend((cell + VoxelSet::Cell::Ones()).cast<double>() * cells.cell());
  });
  const Vector3& low = box.min();
  const Vector3& high = box.max();
  fmt::print("poses         {}\n", poses);
  fmt::print("cells         {} of {:.6g} m\n", cells.count(), cells.cell());
  fmt::print("volume        {:.6g} m^3\n", cells.volume());
  fmt::print("box           from ({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g}) m\n", low.x(), low.y(),
             low.z(), high.x(), high.y(), high.z());
}

void printClearance(const Clearance& found) {
  const Vector3& p = found.p_WP;
  const char* bound = "";
  if (!found.exact) bound = found.distance < 0.0 ? "deeper than " : "more than ";
  fmt::print("clearance     {}{:.6g} m, after pose {} at ({:.6g}, {:.6g}, {:.6g}) m\n", bound,
             found.exact ? found.distance : std::abs(found.distance), found.pose, p.x(), p.y(), p.z());
}

int run(const Arguments& arguments) {
  SweepOptions options;
  const auto cell = parseLength(arguments.cell);
  if (!cell) return complain({"--cell: " + cell.error().what});
  options.cell = *cell;
  const auto grow = parseLength(arguments.grow);
  if (!grow) return complain({"--grow: " + grow.error().what});
  options.grow = *grow;
  if (!arguments.output.empty() && !isOctree(arguments.output)) {
    return complain({arguments.output + ": must end in .bt or .ot"});
  }
  const auto body = openStructures(arguments.body);
  if (!body) return complain(body.error());
  std::vector<Pose> poses{Pose::Identity()};
  if (!arguments.poses.empty()) {
    auto read = readPoses(arguments.poses);
    if (!read) return complain(read.error());
    poses = std::move(*read);
  }
  const BakeProgress go_on = [](double, std::string_view) { return interrupted == 0; };
  const auto cells = sweep(**body, poses, options, go_on);
  if (!cells) return complain({arguments.body + ": " + cells.error().what});
  if (cells->count() == 0) {
    return complain(
        {arguments.body + ": no cell's middle is inside; make cells smaller, or --grow a thin sheet"});
  }
  printCells(*cells, poses.size());
  if (!arguments.scene.empty()) {
    const auto scene = openStructures(arguments.scene);
    if (!scene) return complain(scene.error());
    const auto found = clearance(**body, poses, (*scene)->field, options.cell / 2, go_on);
    if (!found) return complain({arguments.scene + ": " + found.error().what});
    printClearance(*found);
  }
  if (arguments.output.empty()) return 0;
  if (const auto ok = writeOctree(arguments.output, *cells); !ok) return complain(ok.error());
  return 0;
}

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{
      "Fills the cells of a grid that a baked body takes up, where it stands or on a whole way (the swept\n"
      "volume of a part or an arm), tells their volume and the clearance to a scene, and writes them as an\n"
      "OctoMap. Between two poses the body moves straight and turns evenly.",
      "tenon voxels"};
  app.add_option("BODY", arguments.body, "structure file of the body (from tenon bake)")->required();
  app.add_option(
      "--poses", arguments.poses,
      "file of poses of the body in the world, `x y z qw qx qy qz` a line, in metres (default: at rest)");
  app.add_option("--scene", arguments.scene, "structure file of what the way is measured against, at rest");
  app.add_option("-o,--output", arguments.output, "the octree to write: .bt (occupied or not) or .ot (full)");
  app.add_option("--cell", arguments.cell, "edge of a cell")->capture_default_str();
  app.add_option("--grow", arguments.grow, "also cells up to so far outside, within the band of the field")
      ->capture_default_str();
  app.footer(
      "A cell counts when its middle is inside. Lengths are written 5mm, 0.5 cm or 0.005m. `tenon bake` "
      "takes\n"
      "the octree again, as a body.\n"
      "Exit codes: 0 done, 1 could not be done (the reason is on stderr), 2 wrong usage, 130 interrupted.");
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
}  // namespace tenon

int main(int argc, char** argv) { return tenon::main(argc, argv); }
