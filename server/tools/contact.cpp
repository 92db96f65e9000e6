#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "idl/types/output_files.h"
#include "server/bake/surface_import.h"
#include "server/collision/contact_refinement.h"
#include "server/collision/pair_query.h"
#include "server/collision/query_kernels.h"
#include "server/structures/haptic_structures.h"
#include "server/tools/pose_lines.h"

namespace tenon::tools {
namespace {

struct ContactArguments {
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
  bool overwrite = false;
};

/// The contact at one pose; A is the body with the pointshell, B the body with the field.
struct PoseContact {
  double microseconds = 0.0;  // of the query
  std::uint32_t contacts = 0;
  double penetration = 0.0;  // [m]
  Wrench F_Ao_B;
  double load_percent = 0.0;
};

int printError(const Error& error, int exit_code = 1) {
  fmt::print(stderr, "tenon-contact: {}\n", error.what);
  return exit_code;
}

/// `--isa` names what this processor lacks (exit code 1), or nothing at all (2).
int refuseIsa(const std::string& isa) {
  constexpr std::array<std::string_view, 4> kIsas{"scalar", "sse4", "avx2", "avx512"};
  std::string known;
  for (const collision::QueryKernels& kernels : collision::supportedKernels())
    known += " " + std::string(kernels.isa);
  const bool exists = std::find(kIsas.begin(), kIsas.end(), isa) != kIsas.end();
  return printError({"--isa " + isa + ": this processor has" + known}, exists ? 1 : 2);
}

std::vector<PoseContact> queryPoses(const structures::HapticStructures& field,
                                    const structures::HapticStructures& shell,
                                    const structures::SurfaceTree& surface, const std::vector<Pose>& poses,
                                    const ContactArguments& arguments) {
  const auto result = std::make_unique<collision::PairQueryResult>();
  std::vector<PoseContact> rows;
  rows.reserve(poses.size());
  for (const Pose& X_BA : poses) {
    collision::PairQuery query{&shell.shell, &field.field, X_BA, Pose()};
    query.sum_penalty = true;
    query.prune = !arguments.no_prune;
    query.correct_ridges = !arguments.interpolated;
    // a point may be inside the mesh although the field has it outside
    if (surface.size() > 0) query.margin = 0.25 * field.field.voxel();
    const auto begin = std::chrono::steady_clock::now();
    collision::queryPair(query, *result);
    if (surface.size() > 0) collision::refineContacts(query, surface, collision::RefinementBudget(), *result);
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
    rows.push_back({took.count(), result->counts.points_colliding, result->deepest,
                    result->penalty_Ao_W * arguments.stiffness, result->counts.loadPercent()});
  }
  return rows;
}

Result<void> writeCsv(const std::string& file, const std::vector<PoseContact>& rows) {
  std::ofstream out(file, std::ios::trunc);
  out << "index,microseconds,contacts,penetration_m,fx,fy,fz,tx,ty,tz,load_percent\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const PoseContact& row = rows[i];
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

void printSummary(const std::vector<PoseContact>& rows, const structures::HapticStructures& shell,
                  std::string_view isa) {
  std::vector<double> times;
  std::uint64_t contacts = 0;
  std::size_t touching = 0;
  PoseContact worst;
  for (const PoseContact& row : rows) {
    times.push_back(row.microseconds);
    contacts += row.contacts;
    if (row.contacts > 0) ++touching;
    worst.penetration = std::max(worst.penetration, row.penetration);
    worst.load_percent = std::max(worst.load_percent, row.load_percent);
  }
  std::sort(times.begin(), times.end());
  const auto at = [&times](double quantile) {
    return times[static_cast<std::size_t>(quantile * static_cast<double>(times.size() - 1))];
  };
  fmt::print("poses         {}, {} in contact\n", rows.size(), touching);
  fmt::print("shell         {} points\n", shell.shell.points().size());
  fmt::print("instructions  {}\n", isa);
  fmt::print("microseconds  median {:.2f}, p99 {:.2f}, max {:.2f}\n", at(0.5), at(0.99), times.back());
  fmt::print("contacts      {:.1f} per pose in contact\n",
             touching == 0 ? 0.0 : static_cast<double>(contacts) / static_cast<double>(touching));
  fmt::print("penetration   at most {:.4g} mm\n", 1e3 * worst.penetration);
  fmt::print("load          at most {:.1f} %\n", worst.load_percent);
}

int run(const ContactArguments& arguments) {
  if (!arguments.isa.empty() && !collision::chooseKernels(arguments.isa)) return refuseIsa(arguments.isa);
  ProgramFiles files{
      {arguments.csv}, {arguments.field, arguments.shell, arguments.poses}, arguments.overwrite};
  files.inputs.insert(files.inputs.end(), arguments.meshes.begin(), arguments.meshes.end());
  if (const auto refusal = refuseOutputs(files)) return printError({refusal->what}, refusal->exit_code);
  const auto field = structures::openStructures(arguments.field);
  if (!field) return printError(field.error());
  if ((*field)->field.empty()) return printError({arguments.field + ": has no distance field"});
  const auto shell = structures::openStructures(arguments.shell);
  if (!shell) return printError(shell.error());
  if ((*shell)->shell.empty()) return printError({arguments.shell + ": has no pointshell"});
  const auto poses = readPoses(arguments.poses);
  if (!poses) return printError(poses.error());
  Result<structures::SurfaceTree> surface;
  if (arguments.refine || !arguments.meshes.empty()) {
    surface = bake::importSurface(**field, {arguments.meshes.begin(), arguments.meshes.end()});
    if (!surface) return printError({"--refine: " + surface.error().what + " (name the file with --mesh)"});
  }
  const std::vector<PoseContact> rows = queryPoses(**field, **shell, *surface, *poses, arguments);
  if (!arguments.csv.empty()) {
    if (const auto ok = writeCsv(arguments.csv, rows); !ok) return printError(ok.error());
  }
  printSummary(rows, **shell, collision::chosenKernels().isa);
  return 0;
}

int main(int argc, char** argv) {
  ContactArguments arguments;
  CLI::App app{
      "Computes the contacts of one body's pointshell with another body's distance field at given poses. A\n"
      "pose is a line `x y z qw qx qy qz`: the shell's body in the field's body, in metres. The force is "
      "the\n"
      "penalty force F = K sum(area * depth * normal) / (1 cm^2) on the shell's body, its torque about that\n"
      "body's origin, both in the frame of the field's body.",
      "tenon contact"};
  app.add_option("FIELD", arguments.field, "structure file of the body with the distance field")->required();
  app.add_option("SHELL", arguments.shell, "structure file of the body with the pointshell")->required();
  app.add_option("--poses", arguments.poses, "file of poses, one per line")->required();
  app.add_option("--csv", arguments.csv, "write one line per pose to this CSV file");
  app.add_option("--isa", arguments.isa,
                 "instruction set: scalar, sse4, avx2 or avx512 (default: the best of this processor)");
  app.add_option("--stiffness", arguments.stiffness, "K [N/m], for each cm^2 of contact area")
      ->capture_default_str()
      ->check([](const std::string& text) {
        const double number = std::strtod(text.c_str(), nullptr);
        return std::isfinite(number) && number > 0.0 ? "" : "must be a number greater than 0";
      });
  app.add_flag(
      "--refine", arguments.refine,
      "near ridges of the field, measure the deepest contacts against the mesh that FIELD was baked from");
  app.add_option("--mesh", arguments.meshes, "path of that mesh, if it was moved since")
      ->option_text("MESH...");
  app.add_flag("--interpolated", arguments.interpolated,
               "interpolated distances only, without ridge correction in thin walls and at edges");
  app.add_flag("--overwrite", arguments.overwrite, kOverwriteHelp);
  app.add_flag("--no-prune", arguments.no_prune, "test every point, for comparison");
  app.footer(
      "`contacts` is the number of points inside; points deeper than the field's band exert no force.\n"
      "Exit codes: 0 success, 1 error (the reason is on stderr), 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return run(arguments);
}

}  // namespace
}  // namespace tenon::tools

int main(int argc, char** argv) { return tenon::tools::main(argc, argv); }
