#include "server/check/checked_scene.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <fmt/format.h>

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

std::string freePoseHint(ContactProbe& probe, std::span<const PartObstacle> obstacles, const Pose& X_WO,
                         const NearestPlace& place, double furthest) {
  if (!place.located) return {};
  assert(place.gap < 0.0);
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

}  // namespace tenon::check
