#include <iostream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "server/collision/ridge_correction.h"
#include "server/structures/haptic_structures.h"
#include "server/tools/number_lines.h"

namespace tenon::tools {
namespace {

int printError(const Error& error) {
  fmt::print(stderr, "tenon-probe: {}\n", error.what);
  return 1;
}

int run(const std::string& file, bool interpolated) {
  const auto structures = structures::openStructures(file);
  if (!structures) return printError(structures.error());
  const structures::DistanceField& field = (*structures)->field;
  if (field.empty()) return printError({file + ": has no distance field"});
  NumberLines lines(std::cin, "points", 3);
  while (true) {
    const auto more = lines.next();
    if (!more) return printError(more.error());
    if (!*more) return 0;
    const Vector3 p_MP = Vector3::Map(lines.numbers().data());
    const structures::FieldSample sample =
        interpolated ? field.undilated(p_MP) : collision::correctedSample(field, p_MP);
    if (!sample.exact) {
      fmt::print("far\n");
      continue;
    }
    const double slope = sample.gradient.norm();
    const Vector3 n_M = slope > 0.0 ? Vector3(sample.gradient / slope) : Vector3(Vector3::Zero());
    fmt::print("{:.9g} {:.9g} {:.9g} {:.9g}\n", sample.distance, n_M.x(), n_M.y(), n_M.z());
  }
}

int main(int argc, char** argv) {
  std::string file;
  bool interpolated = false;
  CLI::App app{
      "Samples the distance field of a structure file: reads points `x y z` from standard input, one per\n"
      "line, in metres and in the frame of the mesh, and prints for each `distance nx ny nz` (negative\n"
      "inside; outward normal, 0 0 0 where the gradient is zero) or `far` outside the band. Inside, in thin "
      "walls\n"
      "and under edges, distances have the ridge correction of `tenon contact` and `tenon check`.",
      "tenon probe"};
  app.add_option("FILE", file, "the structure file, as `tenon bake` writes it")->required();
  app.add_flag("--interpolated", interpolated, "the field as it is, without ridge correction");
  app.footer("Exit codes: 0 success, 1 error (the reason is on stderr), 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return run(file, interpolated);
}

}  // namespace
}  // namespace tenon::tools

int main(int argc, char** argv) { return tenon::tools::main(argc, argv); }
