#include <iostream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "server/number_lines.h"
#include "server/structures/haptic_structures.h"

namespace tenon {
namespace {

int complain(const Error& error) {
  fmt::print(stderr, "tenon-probe: {}\n", error.what);
  return 1;
}

int run(const std::string& file) {
  const auto structures = openStructures(file);
  if (!structures) return complain(structures.error());
  const DistanceField& field = (*structures)->field;
  if (field.empty()) return complain({file + ": has no field to probe"});
  NumberLines lines(std::cin, "points", 3);
  while (true) {
    const auto more = lines.next();
    if (!more) return complain(more.error());
    if (!*more) return 0;
    const FieldSample sample = field.sample(Vector3::Map(lines.numbers().data()));
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
  CLI::App app{
      "Asks a structure file for distances: reads points `x y z` from the standard input, one a line, in\n"
      "metres and in the frame of the mesh, and prints for each `distance nx ny nz` (negative inside, the\n"
      "normal points outwards; 0 0 0 where the field has none) or `far` outside the band.",
      "tenon probe"};
  app.add_option("FILE", file, "the structure file, as `tenon bake` writes it")->required();
  app.footer("Exit codes: 0 done, 1 could not be done (the reason is on stderr), 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return run(file);
}

}  // namespace
}  // namespace tenon

int main(int argc, char** argv) { return tenon::main(argc, argv); }
