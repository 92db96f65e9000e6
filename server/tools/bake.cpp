#include "server/bake/bake.h"

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iostream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include "idl/types/output_files.h"
#include "server/bake/import_pipe.h"
#include "server/bake/length.h"
#include "server/structures/voxel_limits.h"

namespace tenon::tools {
namespace {

constexpr int kWrongUsage = 2;

volatile std::sig_atomic_t interrupted = 0;

struct BakeArguments {
  std::vector<std::string> meshes;
  std::string output;
  std::string info;
  std::string shell;
  std::string cache;
  std::string voxel = "3mm";
  std::string unit = "mm";
  std::uint32_t points = 10'000;
  std::string spacing;
  std::vector<std::string> refine;
  std::int32_t refinement = 4;
  bool overwrite = false;
  bool quiet = false;
};

/// A length [m] in a unit that suits its size.
std::string readable(double metres) {
  const double size = std::abs(metres);
  if (size >= 1.0) return fmt::format("{:.4g} m", metres);
  if (size >= 1e-4 || size == 0.0) return fmt::format("{:.4g} mm", metres * 1e3);
  return fmt::format("{:.4g} um", metres * 1e6);
}

std::string readable(const Vector3& v) {
  return fmt::format("({}, {}, {})", readable(v.x()), readable(v.y()), readable(v.z()));
}

Result<bake::RefineBox> parseBox(const std::string& text) {
  std::vector<double> numbers;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const auto length = bake::parseLength(std::string_view(text).substr(begin, end - begin));
    if (!length) return fail("--refine " + text + ": " + length.error().what);
    numbers.push_back(*length);
    begin = end + 1;
  }
  if (numbers.size() != 6) return fail("--refine " + text + ": expected x0,y0,z0,x1,y1,z1");
  const Vector3 a = Vector3::Map(numbers.data());
  const Vector3 b = Vector3::Map(numbers.data() + 3);
  return bake::RefineBox{{a.cwiseMin(b), a.cwiseMax(b)}};
}

Result<bake::BakeOptions> optionsFrom(const BakeArguments& arguments) {
  bake::BakeOptions options;
  const auto voxel = bake::parseLength(arguments.voxel);
  if (!voxel) return fail("--voxel: " + voxel.error().what);
  options.voxel = *voxel;
  if (options.voxel < structures::kSmallestVoxel || options.voxel > structures::kLargestVoxel)
    return fail(fmt::format("--voxel {}: is {}, expected between {} and {}", arguments.voxel,
                            readable(options.voxel), readable(structures::kSmallestVoxel),
                            readable(structures::kLargestVoxel)));
  options.points = arguments.points;
  options.refinement = arguments.refinement;
  if (!arguments.spacing.empty()) {
    const auto spacing = bake::parseLength(arguments.spacing);
    if (!spacing) return fail("--spacing: " + spacing.error().what);
    if (*spacing <= 0.0) return fail("--spacing " + arguments.spacing + ": must be greater than 0");
    options.point_spacing = *spacing;
  }
  for (const std::string& text : arguments.refine) {
    const auto box = parseBox(text);
    if (!box) return tl::unexpected(box.error());
    options.refine.push_back(*box);
  }
  if (const auto valid = bake::checkOptions(options); !valid) return tl::unexpected(valid.error());
  return options;
}

/// Prints a progress bar on a terminal, otherwise one line per stage; SIGINT or SIGTERM cancels.
bake::BakeProgress progressFor(const BakeArguments& arguments) {
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  const bool quiet = arguments.quiet;
  return [terminal, quiet, last_stage = std::string(), last_percent = -1](double fraction,
                                                                          std::string_view stage) mutable {
    const int percent = static_cast<int>(fraction * 100.0);
    const bool new_stage = stage != last_stage;
    if (!quiet && terminal && (new_stage || percent != last_percent)) {
      const int filled = percent * 30 / 100;
      fmt::print(stderr, "\r[{:#<{}}{:.<{}}] {:3d} % {:<32}", "", filled, "", 30 - filled, percent, stage);
      if (percent >= 100) fmt::print(stderr, "\n");
    }
    if (!quiet && !terminal && new_stage) fmt::print(stderr, "{:3d} % {}\n", percent, stage);
    last_stage = stage;
    last_percent = percent;
    return interrupted == 0;
  };
}

void printInfo(const structures::HapticStructures& structures) {
  const structures::StructureInfo& info = structures.info;
  const auto& layout = structures.field.layout();
  const Vector3 size = info.box_M.sizes();
  const auto coarse = static_cast<std::size_t>(layout.bricks[0]) *
                      static_cast<std::size_t>(layout.bricks[1]) * static_cast<std::size_t>(layout.bricks[2]);
  const double megabytes =
      static_cast<double>(layout.samples.size_bytes() + layout.index.size_bytes() + layout.far.size_bytes()) /
      1e6;
  fmt::print("source        {}\n", info.source);
  fmt::print("content hash  {}\n", info.content_hash);
  fmt::print("mesh          {} triangles, {} x {} x {}\n", info.triangles, readable(size.x()),
             readable(size.y()), readable(size.z()));
  fmt::print("              from {} to {}\n", readable(info.box_M.min()), readable(info.box_M.max()));
  fmt::print("              one unit of its files is {}\n", readable(info.unit));
  fmt::print("field         {} voxels, {} of {} bricks with samples, {:.1f} MB, {:.0f} bytes per brick\n",
             readable(layout.voxel), info.bricks, coarse, megabytes,
             1e6 * megabytes / static_cast<double>(std::max<std::size_t>(info.bricks, 1)));
  fmt::print("              exact up to {} from the surface\n", readable(layout.band));
  if (layout.refinement > 1) {
    fmt::print("              refined bricks have {} voxels\n", readable(layout.voxel / layout.refinement));
  }
  if (info.thin_area > 0.0) {
    fmt::print(
        "thin walls    {:.4g} m^2 are thinner than their voxels resolve: solid, up to {} thicker;\n"
        "              {:.4g} m^2 of surface are open\n",
        info.thin_area, readable(layout.dilation), info.open_area);
  }
  if (!info.filled.empty()) {
    const structures::FilledSpace& largest = info.filled.front();
    fmt::print(
        "filled        {} voids or slots, closed or too narrow for the voxels, are solid; the largest\n"
        "              from {} to {}\n",
        info.filled.size(), readable(Vector3f::Map(largest.low.data()).cast<double>()),
        readable(Vector3f::Map(largest.high.data()).cast<double>()));
  }
  fmt::print("shell         {} points on {:.4g} m^2, {} leaves, {} clusters, radius {}\n",
             structures.shell.points().size(), info.surface_area, structures.shell.leaves().size(),
             structures.shell.clusters().size(), readable(structures.shell.boundingRadius()));
  const auto edges = structures.features.edges();
  const auto pieces = std::count_if(
      edges.begin(), edges.end(), [](const structures::FeatureEdge& edge) { return !edge.half_M.isZero(); });
  fmt::print("features      {} points, {} of them on edges in pieces of up to {}\n", edges.size(), pieces,
             readable(2.0 * structures.features.longestHalf()));
  std::size_t used = 0;
  for (std::size_t k = 0; k < structures.shell.levels().size(); ++k) {
    const structures::ShellLevel& level = structures.shell.levels()[k];
    used += level.point_count;
    fmt::print("  level {}     {} points, spacing {}\n", k, used, readable(level.spacing));
  }
  fmt::print("baked in      {:.2f} s\n", info.bake_seconds);
  if (!info.notes.empty()) fmt::print("notes\n{}", info.notes);
}

/// Processor time and peak memory of this process.
void printResourceUse() {
  rusage use{};
  if (::getrusage(RUSAGE_SELF, &use) != 0) return;
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  fmt::print("used          {:.2f} s processor time, {:.0f} MB peak memory\n",
             seconds(use.ru_utime) + seconds(use.ru_stime), static_cast<double>(use.ru_maxrss) * 1024e-6);
}

Result<void> writeShell(const std::string& file, const structures::Pointshell& shell) {
  std::ofstream out(file);
  out << "level,x,y,z,nx,ny,nz,area\n";
  for (std::size_t k = 0; k < shell.levels().size(); ++k) {
    const structures::ShellLevel& level = shell.levels()[k];
    for (const structures::ShellPoint& point : shell.points().subspan(level.first_point, level.point_count)) {
      const Vector3f& p = point.p_MP;
      const Vector3f n = -point.inward_M;
      out << fmt::format("{},{},{},{},{},{},{},{}\n", k, p.x(), p.y(), p.z(), n.x(), n.y(), n.z(),
                         point.area);
    }
  }
  out.close();
  if (!out) return fail(file + ": cannot be written");
  return {};
}

int printError(const Error& error, int exit_code = 1) {
  fmt::print(stderr, "tenon-bake: {}\n", error.what);
  return interrupted != 0 ? 130 : exit_code;
}

/// The files of the command line; a cache's are no outputs.
ProgramFiles filesOf(const BakeArguments& arguments) {
  ProgramFiles files{.overwrite = arguments.overwrite};
  if (!arguments.info.empty()) {
    files.inputs = {arguments.info};
    files.outputs = {arguments.shell};
  } else if (arguments.cache.empty()) {
    files.inputs.assign(arguments.meshes.begin(), arguments.meshes.end());
    files.outputs = {arguments.output};
  }
  return files;
}

int run(const BakeArguments& arguments) {
  if (const auto refusal = refuseOutputs(filesOf(arguments)))
    return printError({refusal->what}, refusal->exit_code);
  if (!arguments.info.empty()) {
    const auto structures = structures::openStructures(arguments.info);
    if (!structures) return printError(structures.error());
    printInfo(**structures);
    if (arguments.shell.empty()) return 0;
    const auto ok = writeShell(arguments.shell, (*structures)->shell);
    return ok ? 0 : printError(ok.error());
  }
  const auto unit = bake::parseUnit(arguments.unit);
  if (!unit) return printError({"--unit: " + unit.error().what}, kWrongUsage);
  const auto options = optionsFrom(arguments);
  if (!options) return printError(options.error(), kWrongUsage);
  const std::vector<std::filesystem::path> meshes(arguments.meshes.begin(), arguments.meshes.end());
  const bake::BakeProgress progress = progressFor(arguments);
  if (!arguments.cache.empty()) {
    const auto file = bake::bakeCached(meshes, *unit, *options, arguments.cache, progress);
    if (!file) return printError(file.error());
    fmt::print("{}\n", file->string());
    return 0;
  }
  const auto structures = bake::bakeFiles(meshes, *unit, *options, progress);
  if (!structures) return printError(structures.error());
  if (const auto ok = structures::writeStructures(arguments.output, *structures); !ok)
    return printError(ok.error());
  if (!arguments.quiet) {
    printInfo(*structures);
    printResourceUse();
  }
  return 0;
}

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], bake::kImportChildFlag) == 0)
    return bake::runImportChild(argc - 2, argv + 2);
  BakeArguments arguments;
  CLI::App app{
      "Computes the haptic structures of CAD meshes: a signed distance field and a pointshell. Meshes need\n"
      "no normals and need not be closed; several meshes become one object. Lengths are written 3mm,\n"
      "0.5 mm or 0.003m; a bare number is in metres.",
      "tenon bake"};
  app.add_option(
      "MESH", arguments.meshes,
      "STL, OBJ, PLY, glTF/GLB, DAE, 3DS, 3MF or OFF files, or OctoMap scans (.bt, .ot; always in metres)");
  app.add_option("-o,--output", arguments.output, "the structure file to write");
  app.add_option(
      "--cache", arguments.cache,
      "instead: write into this folder under a name that is a hash of meshes and options, if not there yet");
  app.add_option("--info", arguments.info, "only print a summary of this structure file");
  app.add_option("--shell", arguments.shell,
                 "with --info: write the shell's points as CSV to this file: level,x,y,z,nx,ny,nz,area; in "
                 "metres, mesh frame, outward normals")
      ->needs("--info");
  app.add_option("--voxel", arguments.voxel, "edge of the field's voxels")->capture_default_str();
  app.add_option("--unit", arguments.unit, "length of one unit of the files: mm, cm, m, in")
      ->capture_default_str();
  auto* points = app.add_option("--points", arguments.points, "approximate number of shell points")
                     ->capture_default_str();
  app.add_option("--spacing", arguments.spacing, "distance between shell points (instead of --points)")
      ->excludes(points);
  app.add_option("--refine", arguments.refine,
                 "x0,y0,z0,x1,y1,z1 of a box in which the surface gets finer voxels (repeatable; bare "
                 "numbers are metres)")
      ->allow_extra_args(false);
  app.add_option("--refinement", arguments.refinement,
                 "voxel size divided by that in --refine boxes: 1, 2, 4 or 8")
      ->capture_default_str();
  app.add_flag("--overwrite", arguments.overwrite, kOverwriteHelp);
  app.add_flag("-q,--quiet", arguments.quiet, "no progress and no summary");
  app.footer("Exit codes: 0 success, 1 error (the reason is on stderr), 2 wrong usage, 130 interrupted.");
  try {
    app.parse(argc, argv);
    if (arguments.info.empty() && arguments.meshes.empty()) throw CLI::RequiredError("MESH");
    if (arguments.info.empty() && arguments.output.empty() && arguments.cache.empty()) {
      throw CLI::RequiredError("-o FILE (or --cache FOLDER)");
    }
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
