#include "server/check/check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "server/check/scene_checks.h"

namespace tenon::check {

std::vector<PartObstacle> CheckedScene::obstaclesOf(ObjectId part, std::size_t state, bool with_hands) const {
  const game_control::SceneMoment& moment = moments[state];
  std::vector<PartObstacle> obstacles;
  for (std::size_t i = 0; i < scenario.pairs.size(); ++i) {
    const game_control::ScenarioPair& pair = scenario.pairs[i];
    if (pair.sensing || (pair.a != part && pair.b != part)) continue;
    const ObjectId other = pair.a == part ? pair.b : pair.a;
    if (!moment.collides(scenario, i) || (!with_hands && moment.inAHand(other))) continue;
    obstacles.push_back({other, i, moment.X_WO[other.value]});
  }
  return obstacles;
}

std::string wayOut(ContactProbe& probe, std::span<const PartObstacle> obstacles, const Pose& X_WO,
                   const NearestPlace& place, double furthest) {
  if (!place.located) return {};
  constexpr double kMore = 1.02;  // [-] than the depth: the field is not exact
  for (double length = -kMore * place.gap; length <= furthest; length *= 1.5) {
    const Pose X_WM(X_WO.translation() + length * place.n_W, X_WO.rotation());
    const bool is_free = std::all_of(obstacles.begin(), obstacles.end(), [&](const PartObstacle& obstacle) {
      const NearestPlace after = probe.nearest(obstacle, X_WM, ProbedSurface::kMesh);
      return after.gap >= -kFieldError.at(after);
    });
    if (!is_free) continue;
    // to a hundredth of a millimetre; -0.0 is 0
    const auto rounded = [](double metres) { return std::round(1e5 * metres) / 1e5 + 0.0; };
    const Vector3& p_WM = X_WM.translation();
    return fmt::format("it is free at [{:g}, {:g}, {:g}]", rounded(p_WM.x()), rounded(p_WM.y()),
                       rounded(p_WM.z()));
  }
  return {};
}

std::vector<Finding> checkScene(const game_control::ScenarioFile& scenario, const simulation::Scene& scene,
                                const CheckOptions& options) {
  CheckedScene checked{scenario, scene, options, game_control::momentsOf(scenario), {}};
  const auto progress = [&](std::string_view activity, double fraction) {
    if (options.progress) options.progress(activity, fraction);
  };
  progress("checking the start", 0.0);
  checkOverlaps(checked);
  for (std::size_t i = 0; i < scenario.states.size(); ++i) {
    const game_control::ScenarioState& state = scenario.states[i];
    progress(fmt::format("checking {}", state.title.front().text),
             static_cast<double>(i) / static_cast<double>(scenario.states.size()));
    if (state.X_WG && scene.objects[state.object.value].structures) checkTarget(checked, i);
  }
  checkTurns(checked);
  progress("checked", 1.0);
  return std::move(checked.findings);
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
  if (findings.empty()) findings.push_back({.text = refusal.what});
  return findings;
}

std::vector<Finding> findingsOf(const Error& refusal, const game_control::ScenarioFile& scenario,
                                const std::vector<Eigen::AlignedBox3d>& boxes_O) {
  std::vector<Finding> findings = checkSizes(scenario, boxes_O);
  findings.push_back({.text = refusal.what});
  return findings;
}

}  // namespace tenon::check
