#include <algorithm>
#include <chrono>
#include <fstream>
#include <memory>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "server/bake/surface_import.h"
#include "server/collision/contact_refinement.h"
#include "server/collision/pair_query.h"
#include "server/collision/query_kernels.h"
#include "server/pose_lines.h"
#include "server/structures/haptic_structures.h"

namespace tenon {
namespace {

struct Arguments {
  std::string field;
  std::string shell;
  std::string poses;
  std::string csv;
  std::string isa;
  std::vector<std::string> meshes;
  double stiffness = 1000.0;
  bool no_prune = false;
  bool interpolated = false;
  bool refine = false;
};

/// One pose and its answer; B is the field's body, A the shell's.
struct Row {
  double microseconds = 0.0;
  std::uint32_t contacts = 0;
  double penetration = 0.0;
  Wrench F_Ao_B;
  double load_percent = 0.0;
};

int complain(const Error& error) {
  fmt::print(stderr, "tenon-contact: {}\n", error.what);
  return 1;
}

std::vector<Row> ask(const HapticStructures& field, const HapticStructures& shell, const SurfaceTree& surface,
                     const std::vector<Pose>& poses, const Arguments& arguments) {
  const auto result = std::make_unique<PairQueryResult>();
  std::vector<Row> rows;
  rows.reserve(poses.size());
  for (const Pose& X_BA : poses) {
    PairQuery query{&shell.shell, &field.field, X_BA, Pose()};
    query.sum = true;
    query.prune = !arguments.no_prune;
    query.straighten = !arguments.interpolated;
    // the mesh may have points inside that its field has outside
    if (surface.size() > 0) query.margin = 0.25 * field.field.voxel();
    const auto begin = std::chrono::steady_clock::now();
    queryPair(query, *result);
    if (surface.size() > 0) refineContacts(query, surface, RefinementBudget(), *result);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
    rows.push_back({took.count(), result->counts.points_colliding, result->deepest,
                    result->push_Ao_W * arguments.stiffness, result->counts.loadPercent()});
  }
  return rows;
}

Result<void> writeCsv(const std::string& file, const std::vector<Row>& rows) {
  std::ofstream out(file, std::ios::trunc);
  out << "index,microseconds,contacts,penetration_m,fx,fy,fz,tx,ty,tz,load_percent\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const Vector3& f = row.F_Ao_B.force;
    const Vector3& t = row.F_Ao_B.torque;
    out << fmt::format("{},{:.3f},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.4g}\n", i,
                       row.microseconds, row.contacts, row.penetration, f.x(), f.y(), f.z(), t.x(), t.y(),
                       t.z(), row.load_percent);
  }
  out.close();
  if (!out) return fail(file + ": cannot be written");
  return {};
}

void printSummary(const std::vector<Row>& rows, const HapticStructures& shell, std::string_view isa) {
  std::vector<double> times;
  std::uint64_t contacts = 0;
  std::size_t touching = 0;
  Row worst;
  for (const Row& row : rows) {
    times.push_back(row.microseconds);
    contacts += row.contacts;
    if (row.contacts > 0) ++touching;
    worst.penetration = std::max(worst.penetration, row.penetration);
    worst.load_percent = std::max(worst.load_percent, row.load_percent);
  }
  std::sort(times.begin(), times.end());
  const auto at = [&times](double share) {
    return times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
  };
  fmt::print("poses         {}, {} in contact\n", rows.size(), touching);
  fmt::print("shell         {} points\n", shell.shell.points().size());
  fmt::print("instructions  {}\n", isa);
  fmt::print("microseconds  median {:.2f}, p99 {:.2f}, most {:.2f}\n", at(0.5), at(0.99), times.back());
  fmt::print("contacts      {:.1f} a pose in contact\n",
             touching == 0 ? 0.0 : static_cast<double>(contacts) / static_cast<double>(touching));
  fmt::print("penetration   at most {:.4g} mm\n", 1e3 * worst.penetration);
  fmt::print("load          at most {:.1f} %\n", worst.load_percent);
}

int run(const Arguments& arguments) {
  if (!arguments.isa.empty() && !chooseKernels(arguments.isa)) {
    std::string known;
    for (const QueryKernels& kernels : supportedKernels()) known += " " + std::string(kernels.isa);
    return complain({"--isa " + arguments.isa + ": this processor has" + known});
  }
  const auto field = openStructures(arguments.field);
  if (!field) return complain(field.error());
  if ((*field)->field.empty()) return complain({arguments.field + ": has no field"});
  const auto shell = openStructures(arguments.shell);
  if (!shell) return complain(shell.error());
  if ((*shell)->shell.empty()) return complain({arguments.shell + ": has no shell"});
  const auto poses = readPoses(arguments.poses);
  if (!poses) return complain(poses.error());
  Result<SurfaceTree> surface;
  if (arguments.refine || !arguments.meshes.empty()) {
    surface = importSurface(**field, {arguments.meshes.begin(), arguments.meshes.end()});
    if (!surface) return complain({"--refine: " + surface.error().what + " (--mesh says where it is)"});
  }
  const std::vector<Row> rows = ask(**field, **shell, *surface, *poses, arguments);
  if (!arguments.csv.empty()) {
    if (const auto ok = writeCsv(arguments.csv, rows); !ok) return complain(ok.error());
  }
  printSummary(rows, **shell, chosenKernels().isa);
  return 0;
}

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{
      "Computes the contact of one body's shell with another body's field, pose after pose. A pose is a "
      "line\n"
      "`x y z qw qx qy qz`: the shell's body in the field's body, in metres. The force is the penalty\n"
      "F = K sum a d n / (1 cm^2) on the shell's body, about its origin, in the frame of the field.",
      "tenon contact"};
  app.add_option("FIELD", arguments.field, "structure file of the body that is asked for distances")
      ->required();
  app.add_option("SHELL", arguments.shell, "structure file of the body whose points touch")->required();
  app.add_option("--poses", arguments.poses, "file of poses, one a line")->required();
  app.add_option("--csv", arguments.csv, "write a line for each pose into this file");
  app.add_option("--isa", arguments.isa,
                 "instructions: scalar, sse4, avx2 or avx512 (default: the best here)");
  app.add_option("--stiffness", arguments.stiffness, "K [N/m]")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_flag(
      "--refine", arguments.refine,
      "measure the deepest contacts against the mesh that FIELD was baked from, where its field bends");
  app.add_option("--mesh", arguments.meshes, "that mesh, when it is not where it was then")
      ->option_text("MESH...");
  app.add_flag(
      "--interpolated", arguments.interpolated,
      "take distances as the field interpolates them, also where it bends: in thin walls, under edges");
  app.add_flag("--no-prune", arguments.no_prune, "test every point, to compare");
  app.footer(
      "contacts counts the points inside; points deeper than the field's band push nothing.\n"
      "Exit codes: 0 done, 1 could not be done (the reason is on stderr), 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return run(arguments);
}

}  // namespace
}  // namespace tenon

int main(int argc, char** argv) { return tenon::main(argc, argv); }
