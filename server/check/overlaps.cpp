#include "server/check/overlaps.h"

#include <algorithm>
#include <set>
#include <utility>

#include <fmt/format.h>

namespace tenon::check {
namespace {

/// Objects that appear, or are put somewhere, at the begin of a state; all at the start.
std::vector<ObjectId> placedIn(const CheckedScene& checked, std::size_t state) {
  std::vector<ObjectId> placed;
  const game_control::SceneMoment& moment = checked.moments[state];
  if (state == 0) {
    for (std::uint32_t i = 0; i < checked.scenario.objects.size(); ++i)
      if (moment.shown[i]) placed.push_back(ObjectId{i});
    return placed;
  }
  for (const game_control::Placement& placement : checked.scenario.states[state].placements)
    if (moment.shown[placement.object.value] && !moment.inAHand(placement.object))
      placed.push_back(placement.object);
  return placed;
}

Finding overlapFinding(const CheckedScene& checked, std::size_t state, ObjectId object,
                       const PartObstacle& obstacle, const NearestPlace& place) {
  const game_control::ScenarioFile& scenario = checked.scenario;
  Finding finding{.kind = FindingKind::kOverlap, .object = object, .other = obstacle.object};
  finding.value = -place.gap;
  finding.unit = "m";
  if (state > 0) finding.state = scenario.states[state].name;
  finding.line = state > 0 ? scenario.states[state].line : scenario.objects[object.value].line;
  if (place.located) finding.p_WP = place.p_WP;
  finding.text = fmt::format("{} is {}{} inside {} {}{}", checked.titleOf(object),
                             place.exact ? "" : "more than ", inMillimetres(-place.gap),
                             checked.titleOf(obstacle.object), state > 0 ? "when it appears" : "at the start",
                             place.located ? ", at " + pointText(place.p_WP) : "");
  return finding;
}

}  // namespace

void checkOverlaps(CheckedScene& checked) {
  std::set<std::size_t> reported;  // pairs
  for (std::size_t state = 0; state < checked.moments.size(); ++state) {
    for (const ObjectId object : placedIn(checked, state)) {
      if (!checked.scene.objects[object.value].structures) continue;
      ContactProbe probe(checked.scene, object);
      const Pose& X_WO = checked.moments[state].X_WO[object.value];
      const std::vector<PartObstacle> obstacles = checked.obstaclesOf(object, state, state == 0);
      for (const PartObstacle& obstacle : obstacles) {
        // where both are placed: once, of the one that is more likely to be moved
        const bool is_fixed = checked.scenario.objects[object.value].status == ObjectStatus::kFixed;
        if (is_fixed || reported.contains(obstacle.pair)) continue;
        const NearestPlace place = probe.nearest(obstacle, X_WO, ProbedSurface::kMesh);
        if (place.gap >= -kFieldError.at(place)) continue;
        reported.insert(obstacle.pair);
        Finding finding = overlapFinding(checked, state, object, obstacle, place);
        const double size = checked.scene.objects[object.value].structures->info.box_M.diagonal().norm();
        finding.hint = freePoseHint(probe, obstacles, X_WO, place, size);
        checked.findings.push_back(std::move(finding));
      }
    }
  }
}

}  // namespace tenon::check
