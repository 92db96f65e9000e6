#include "server/check/check.h"

#include <utility>

#include <fmt/format.h>

#include "server/check/checked_scene.h"
#include "server/check/filled_spaces.h"
#include "server/check/open_surface.h"
#include "server/check/overlaps.h"
#include "server/check/sizes.h"
#include "server/check/targets.h"
#include "server/check/turns.h"

namespace tenon::check {

std::vector<Finding> checkScene(const game_control::ScenarioFile& scenario, const simulation::Scene& scene,
                                const CheckOptions& options) {
  CheckedScene checked{scenario, scene, game_control::momentsOf(scenario), {}};
  const auto progress = [&](std::string_view activity, double fraction) {
    if (options.progress) options.progress(activity, fraction);
  };
  progress("checking the start", 0.0);
  checkOpenSurfaces(checked);
  checkFilledSpaces(checked);
  checkOverlaps(checked);
  for (std::size_t i = 0; i < scenario.states.size(); ++i) {
    const game_control::ScenarioState& state = scenario.states[i];
    progress(fmt::format("checking {}", state.title.front().text),
             static_cast<double>(i) / static_cast<double>(scenario.states.size()));
    if (state.X_WG && scene.objects[state.object.value].structures) checkTarget(checked, i);
  }
  checkTurns(checked, options.trainee_device, options.instructor_device);
  progress("checked", 1.0);
  return std::move(checked.findings);
}

std::vector<std::string> problems(const game_control::ScenarioFile& scenario, const simulation::Scene& scene,
                                  const CheckOptions& options) {
  std::vector<std::string> lines;
  for (const Finding& finding : checkScene(scenario, scene, options))
    if (finding.severity != Severity::kInfo) lines.push_back(lineOf(scenario, finding));
  return lines;
}

std::vector<Finding> findingsOf(
    const Error& refusal, const game_control::ScenarioFile& scenario,
    const std::vector<std::shared_ptr<const structures::HapticStructures>>& structures) {
  std::vector<Finding> findings;
  for (const game_control::Misplacement& misplaced : game_control::misplacedObjects(scenario, structures)) {
    Finding finding{.kind = FindingKind::kReach, .object = misplaced.object, .line = misplaced.line};
    finding.p_WP = misplaced.p_WQ;
    finding.value = misplaced.distance;
    finding.unit = "m";
    finding.text = misplaced.what;
    findings.push_back(std::move(finding));
  }
  // the refusal may be the first of them, or of another kind
  if (findings.empty() || !refusal.what.ends_with(findings.front().text))
    findings.push_back({.text = refusal.what});
  return findings;
}

std::vector<Finding> findingsOf(const Error& refusal, const game_control::ScenarioFile& scenario,
                                const std::vector<Eigen::AlignedBox3d>& boxes_O) {
  std::vector<Finding> findings = checkSizes(scenario, boxes_O);
  findings.push_back({.text = refusal.what});
  return findings;
}

}  // namespace tenon::check
