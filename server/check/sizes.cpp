#include "server/check/sizes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace tenon::check {
namespace {

using game_control::MeshSource;
using game_control::ScenarioFile;
using game_control::ScenarioObject;

constexpr double kSmallestRatio = 1.0 / 300.0;  // [-] of the whole of what it fits into

struct NamedUnit {
  std::string_view name;
  double length = 0.0;  // [m]
};
constexpr std::array<NamedUnit, 4> kUnits{{{"mm", 1e-3}, {"cm", 1e-2}, {"in", 0.0254}, {"m", 1.0}}};

/// The unit of the part's files in which it would be about half as large as what it fits into.
std::string unitHint(const ScenarioObject& part, double ratio) {
  const auto is_file = [](const MeshSource& mesh) { return !mesh.shape && mesh.part.empty(); };
  const auto file = std::find_if(part.meshes.begin(), part.meshes.end(), is_file);
  if (file == part.meshes.end())
    return part.meshes.front().shape ? "is a length without its unit? bare numbers are metres" : "";
  const auto misfit = [&](const NamedUnit& unit) {
    return std::abs(std::log(2.0 * ratio * unit.length / file->unit));
  };
  const NamedUnit& best = *std::min_element(
      kUnits.begin(), kUnits.end(),
      [&](const NamedUnit& one, const NamedUnit& other) { return misfit(one) < misfit(other); });
  if (best.length == file->unit) return "";
  return fmt::format("its file is perhaps in {}: unit: {} in line {}", best.name, best.name, file->line);
}

}  // namespace

Finding scaleFinding(const ScenarioFile& scenario, ObjectId part, ObjectId other, double ratio) {
  const ScenarioObject& object = scenario.objects[part.value];
  Finding finding{.kind = FindingKind::kScale, .object = part, .other = other, .line = object.line};
  finding.value = ratio;
  const double factor = ratio > 1.0 ? ratio : 1.0 / ratio;
  finding.text =
      fmt::format("{} is {:.0f} times {} than {} {}", object.title.front().text, factor,
                  ratio > 1.0 ? "larger" : "smaller", ratio > 1.0 ? "what it fits into," : "its hole in",
                  scenario.objects[other.value].title.front().text);
  finding.hint = unitHint(object, ratio);
  return finding;
}

std::vector<Finding> checkSizes(const ScenarioFile& scenario,
                                const std::vector<Eigen::AlignedBox3d>& boxes_O) {
  const auto sizeOf = [&](ObjectId object) {
    const Eigen::AlignedBox3d& box_O = boxes_O[object.value];
    return box_O.isEmpty() ? 0.0 : box_O.diagonal().norm();
  };
  std::vector<Finding> findings;
  for (const game_control::ScenarioPair& pair : scenario.pairs) {
    const ObjectId into = game_control::sdfSideByTarget(scenario, pair);
    if (!into.valid()) continue;
    const ObjectId part = into == pair.a ? pair.b : pair.a;
    if (sizeOf(part) <= 0.0 || sizeOf(into) <= 0.0) continue;
    const double ratio = sizeOf(part) / sizeOf(into);
    if (ratio > kLargestRatio || ratio < kSmallestRatio)
      findings.push_back(scaleFinding(scenario, part, into, ratio));
  }
  return findings;
}

}  // namespace tenon::check
