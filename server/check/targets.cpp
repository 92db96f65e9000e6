#include "server/check/targets.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "server/check/sizes.h"

namespace tenon::check {
namespace {

using game_control::ScenarioPair;
using game_control::ScenarioState;

constexpr double kUsualFit = 0.005;     // [m] play up to which a part is taken to fit into something
constexpr double kFitsPerStated = 4.0;  // [-] times the stated clearance, likewise
constexpr double kLargestTilt = 0.35;   // [rad]
constexpr double kSmallestRatioInHole = 1.0 / 20.0;  // [-] of its hole, and smaller: its unit is wrong
constexpr ProbeTolerance kPlayTolerance{2e-6, 0.02};
// Near an edge where walls meet the interpolated distance is too small, by up to this; so walls are looked
// for at this depth.
constexpr ProbeTolerance kPlayDepth{2e-6, 0.4};
// [voxels] Error of the play nevertheless, of a part that is less than a voxel from a wall at its target.
constexpr double kPlayError = 0.6;
constexpr ProbeTolerance kApproachTolerance{50e-6, 0.35};

/// Play of a part in what it fits into.
struct Play {
  double play = std::numeric_limits<double>::infinity();  ///< [m] least of all lines; both sides together
  double tilt = std::numeric_limits<double>::infinity();  ///< [rad] least of two axes, likewise
  Vector3 line_W = Vector3::Zero();                       ///< unit, of the least play
  NearestPlace place;
  double error = 0.0;  ///< [m] of `play`, at most
  [[nodiscard]] bool isFit() const { return std::isfinite(play); }
};

/// The checks of one state's target.
class TargetCheck {
 public:
  TargetCheck(CheckedScene& checked, std::size_t state)
      : checked_(checked),
        state_(checked.scenario.states[state]),
        part_(state_.object),
        X_WG_(*state_.X_WG),
        sphere_(simulation::boundingSphereOf(checked.scene.objects[part_.value].structures.get())),
        probe_(checked.scene, part_),
        obstacles_(checked.obstaclesOf(part_, state, false)) {}

  void run() {
    if (sphere_.radius <= 0.0) return;
    bool is_placed = true;
    for (const PartObstacle& obstacle : obstacles_) is_placed = checkObstacle(obstacle) && is_placed;
    if (is_placed && state_.approach_W.norm() > 0.0) checkApproach();
  }

 private:
  [[nodiscard]] const ScenarioPair& pairOf(const PartObstacle& obstacle) const {
    return checked_.scenario.pairs[obstacle.pair];
  }
  [[nodiscard]] const Eigen::AlignedBox3d& boxOf(ObjectId object) const {
    return checked_.scene.objects[object.value].structures->info.box_M;
  }
  [[nodiscard]] const std::string& title(ObjectId object) const { return checked_.titleOf(object); }

  /// False when the part cannot be there at all.
  bool checkObstacle(const PartObstacle& obstacle) {
    const double ratio =
        boxOf(part_).diagonal().norm() / std::max(boxOf(obstacle.object).diagonal().norm(), 1e-9);
    if (pairOf(obstacle).clearance > 0.0 && ratio > kLargestRatio) {
      addScale(obstacle.object, ratio);
      return false;
    }
    const NearestPlace place = probe_.nearest(obstacle, X_WG_, ProbedSurface::kMesh);
    if (ratio < kSmallestRatioInHole * kSmallestRatioInHole ||
        (pairOf(obstacle).clearance > 0.0 && ratio < kSmallestRatioInHole)) {
      if (const auto in_hole = sizeInHole(obstacle, place); in_hole && *in_hole < kSmallestRatioInHole) {
        addScale(obstacle.object, *in_hole);
        return false;
      }
    }
    if (place.gap < -kFieldError.at(place)) {
      const bool is_reachable = -place.gap <= state_.tolerance && isFreeNearby();
      addOverlap(obstacle, place, is_reachable);
      return is_reachable;
    }
    return checkFit(obstacle, place);
  }

  void addScale(ObjectId other, double ratio) {
    Finding finding = scaleFinding(checked_.scenario, part_, other, ratio);
    finding.state = state_.name;
    finding.p_WP = X_WG_ * sphere_.p_OQ_O;
    checked_.findings.push_back(std::move(finding));
  }

  [[nodiscard]] Finding findingAt(FindingKind kind, const PartObstacle& obstacle,
                                  const NearestPlace& place) const {
    Finding finding{.kind = kind, .object = part_, .other = obstacle.object, .state = state_.name};
    finding.line = state_.line;
    if (place.located) finding.p_WP = place.p_WP;
    finding.unit = "m";
    return finding;
  }

  /// Whether the part can be free of all obstacles at a pose that is taken for its target: it is pushed out
  /// of what it is deepest in, again and again, by the least motion. Between walls that are too near to each
  /// other it only goes to and fro.
  [[nodiscard]] bool isFreeNearby() {
    constexpr int kMostPushes = 200;
    constexpr double kMore = 1.02;  // [-] than the depth: the field is not exact
    Pose X_WO = X_WG_;
    for (int push = 0; push < kMostPushes; ++push) {
      NearestPlace deepest{.gap = 0.0};
      for (const PartObstacle& obstacle : obstacles_) {
        const NearestPlace place = probe_.nearest(obstacle, X_WO, ProbedSurface::kMesh);
        if (place.gap < -kFieldError.at(place) && place.gap < deepest.gap) deepest = place;
      }
      if (deepest.gap == 0.0) {
        const Displacement moved = displacement(X_WG_, X_WO, sphere_.p_OQ_O);
        return moved.translation.norm() <= state_.tolerance &&
               moved.rotation.norm() <= state_.angle_tolerance;
      }
      if (!deepest.located) return false;
      // a turn costs as much as the way of the bounding sphere's surface
      const Vector3 arm_W = (deepest.p_WP - X_WO * sphere_.p_OQ_O).cross(deepest.n_W) / sphere_.radius;
      const double least = -kMore * deepest.gap / (1.0 + arm_W.squaredNorm());
      X_WO = displaced(X_WO, {least * deepest.n_W, least / sphere_.radius * arm_W}, sphere_.p_OQ_O);
    }
    return false;
  }

  void addOverlap(const PartObstacle& obstacle, const NearestPlace& place, bool is_reachable) {
    Finding finding = findingAt(FindingKind::kOverlap, obstacle, place);
    finding.value = -place.gap;
    finding.severity = is_reachable ? Severity::kWarning : Severity::kError;
    finding.text = fmt::format("at its target {} is {}{} inside {}{}", title(part_),
                               place.exact ? "" : "more than ", inMillimetres(-place.gap),
                               title(obstacle.object), place.located ? ", at " + pointText(place.p_WP) : "");
    if (is_reachable) {
      finding.text +=
          fmt::format("; it is taken for there because {} are tolerated", inMillimetres(state_.tolerance));
    } else if (-place.gap <= state_.tolerance) {
      finding.text += fmt::format("; it can never be there: it is free nowhere within {} and {} of it",
                                  inMillimetres(state_.tolerance), inDegrees(state_.angle_tolerance));
    }
    finding.hint = freePoseHint(probe_, obstacles_, X_WG_, place, 2.0 * sphere_.radius);
    checked_.findings.push_back(std::move(finding));
  }

  // ---- play

  /// Lines along which play is measured: across the approach, or the axes of the part.
  [[nodiscard]] std::vector<Vector3> lines() const {
    const Matrix3 R_WG = X_WG_.matrix();
    const Vector3& a = state_.approach_W;
    if (a.norm() == 0.0) return {R_WG.col(0), R_WG.col(1), R_WG.col(2)};
    Eigen::Index across = 0;
    (R_WG.transpose() * a).cwiseAbs().minCoeff(&across);
    const Vector3 u = (R_WG.col(across) - a * a.dot(R_WG.col(across))).normalized();
    const Vector3 v = a.cross(u);
    return {u, v, (u + v).normalized(), (u - v).normalized()};
  }

  [[nodiscard]] PartTravel shift(const PartObstacle& obstacle, double floor, const Vector3& direction_W,
                                 double limit) {
    const auto motion = [&](double s) {
      return Pose(X_WG_.translation() + s * direction_W, X_WG_.rotation());
    };
    // it is found where it is deeper by the tolerance
    const auto upTo = [&](const ProbeTolerance& depth) {
      constexpr double kLeastSlope = 0.1;  // [-]
      PartTravel travel =
          probe_.travel({&obstacle, 1}, {&floor, 1}, motion, limit, ProbedSurface::kMesh, depth);
      if (!travel.blocked || !travel.place.located) return travel;
      const double slope = std::max(kLeastSlope, -travel.place.n_W.dot(direction_W));
      travel.length = std::max(0.0, travel.length - depth.at(travel.place) / slope);
      return travel;
    };
    const PartTravel shallow = upTo(kPlayTolerance);
    if (!shallow.blocked) return shallow;
    // a thin wall is nowhere that deep
    constexpr double kMostVoxels = 1.5;
    const PartTravel deep = upTo(kPlayDepth);
    const double more = deep.length - shallow.length;
    return deep.blocked && more > 0.0 && more < kMostVoxels * shallow.place.voxel ? deep : shallow;
  }

  [[nodiscard]] PartTravel turn(const PartObstacle& obstacle, double floor, const Vector3& axis_W) {
    const auto motion = [&](double s) {
      return displaced(X_WG_, {Vector3::Zero(), (s / sphere_.radius) * axis_W}, sphere_.p_OQ_O);
    };
    return probe_.travel({&obstacle, 1}, {&floor, 1}, motion, kLargestTilt * sphere_.radius,
                         ProbedSurface::kMesh, kPlayTolerance);
  }

  [[nodiscard]] Play playIn(const PartObstacle& obstacle, const NearestPlace& place, double limit) {
    const double floor = std::min(place.gap, 0.0);
    Play play;
    for (const Vector3& line : lines()) {
      const PartTravel forth = shift(obstacle, floor, line, limit);
      if (!forth.blocked) continue;
      const PartTravel back = shift(obstacle, floor, -line, limit);
      if (!back.blocked || forth.length + back.length >= play.play) continue;
      play.play = forth.length + back.length;
      play.line_W = line;
      play.place = forth.place;
    }
    if (!play.isFit()) return play;
    const double voxel = play.place.voxel;
    play.error = place.gap < voxel ? kPlayError * voxel : kPlayTolerance.at(play.place);
    if (state_.approach_W.norm() == 0.0) return play;
    const std::vector<Vector3> axes = lines();
    for (std::size_t i = 0; i < 2; ++i) {
      const PartTravel forth = turn(obstacle, floor, axes[i]);
      const PartTravel back = turn(obstacle, floor, -axes[i]);
      if (forth.blocked && back.blocked)
        play.tilt = std::min(play.tilt, (forth.length + back.length) / sphere_.radius);
    }
    return play;
  }

  /// [-] The part's extent by that of the hole around it; none: something near it is in its way, or it is in
  /// no hole.
  [[nodiscard]] std::optional<double> sizeInHole(const PartObstacle& obstacle, const NearestPlace& place) {
    const double floor = std::min(place.gap, 0.0);
    const double near = boxOf(part_).diagonal().norm() / kSmallestRatioInHole;
    for (const Vector3& line : lines())
      if (shift(obstacle, floor, line, near).blocked || shift(obstacle, floor, -line, near).blocked)
        return std::nullopt;
    const Play play = playIn(obstacle, place, boxOf(obstacle.object).diagonal().norm());
    if (!play.isFit()) return std::nullopt;
    const double extent =
        boxOf(part_).sizes().dot(Vector3((X_WG_.matrix().transpose() * play.line_W).cwiseAbs()));
    return extent / (extent + play.play);
  }

  /// False when the part cannot come to its place.
  bool checkFit(const PartObstacle& obstacle, const NearestPlace& place) {
    const double stated = pairOf(obstacle).clearance;
    const double limit = std::max(kUsualFit, kFitsPerStated * stated);
    const NearestPlace contact = probe_.nearest(obstacle, X_WG_, ProbedSurface::kContact);
    const double held_off = -contact.gap - kFieldError.at(contact);
    const Play play = place.gap < limit ? playIn(obstacle, place, limit) : Play();
    if (play.isFit() && stated > 0.0) {
      compareClearance(obstacle, play, stated);
    } else if (play.isFit() && play.play < resolvedPlay(play)) {
      const bool is_unreachable = held_off > state_.tolerance || play.play < 2.0 * play.place.dilation;
      addMissingClearance(obstacle, play, is_unreachable);
      return !is_unreachable;
    }
    if (held_off <= state_.tolerance) return true;
    addHeldOff(obstacle, contact, held_off);
    return false;
  }

  /// [m] Play below which a part does not get in, or jams, where no clearance is stated.
  [[nodiscard]] static double resolvedPlay(const Play& play) {
    return 2.0 * (play.place.dilation + kFieldError.at(play.place));
  }

  void compareClearance(const PartObstacle& obstacle, const Play& play, double stated) {
    Finding finding = findingAt(FindingKind::kClearance, obstacle, play.place);
    finding.value = play.play;
    finding.error = play.error;
    const bool is_less = play.play < stated - std::max(0.1 * stated, play.error);
    const bool is_more = play.play > stated + std::max(0.5 * stated, play.error);
    finding.severity = is_less || is_more ? Severity::kWarning : Severity::kInfo;
    finding.text = fmt::format("{} has {} of play in {}", title(part_), inMillimetres(play.play),
                               title(obstacle.object));
    if (play.error > 0.05 * play.play)
      finding.text += fmt::format(", give or take {}", inMillimetres(play.error));
    if (std::isfinite(play.tilt)) finding.text += fmt::format(", and tilts by {}", inDegrees(play.tilt));
    finding.text += fmt::format("; {} are stated", inMillimetres(stated));
    if (play.play < play.place.voxel)
      finding.text += fmt::format("; voxels of {} do not resolve it", inMillimetres(play.place.voxel));
    if (is_less || is_more)
      finding.hint = fmt::format("clearance: {} in line {}", inMillimetres(play.play), pairOf(obstacle).line);
    checked_.findings.push_back(std::move(finding));
  }

  void addMissingClearance(const PartObstacle& obstacle, const Play& play, bool is_unreachable) {
    const auto& objects = checked_.scenario.objects;
    Finding finding = findingAt(FindingKind::kClearance, obstacle, play.place);
    finding.value = play.play;
    finding.error = play.error;
    finding.severity = is_unreachable ? Severity::kError : Severity::kWarning;
    const bool is_resolved = play.play > 2.0 * play.place.voxel;
    const double thicker = play.place.dilation;
    finding.text =
        fmt::format("{} has {} of play in {}, no clearance is stated, and voxels of {} {}", title(part_),
                    (is_resolved ? "" : "about ") + inMillimetres(play.play), title(obstacle.object),
                    inMillimetres(play.place.voxel),
                    thicker > 0.0 ? "thicken its surface by " + inMillimetres(thicker) : "do not resolve it");
    finding.hint = fmt::format(
        "below pairs: {{between: [{}, {}], clearance: {}}}", objects[part_.value].name,
        objects[obstacle.object.value].name,
        is_resolved || play.play > 0.1 * play.place.voxel ? inMillimetres(play.play) : "hole minus part");
    checked_.findings.push_back(std::move(finding));
  }

  /// The dilation keeps the part farther from its target, by `held_off` [m], than is tolerated.
  void addHeldOff(const PartObstacle& obstacle, const NearestPlace& contact, double held_off) {
    Finding finding = findingAt(FindingKind::kClearance, obstacle, contact);
    finding.value = held_off;
    finding.text =
        fmt::format("{} comes no nearer to its target than {}, and {} are tolerated: voxels of {} thicken {}",
                    title(part_), inMillimetres(held_off), inMillimetres(state_.tolerance),
                    inMillimetres(contact.voxel), title(obstacle.object));
    finding.hint = "finer voxels, a clearance if it fits into something, or a larger 'within'";
    checked_.findings.push_back(std::move(finding));
  }

  // ---- approach

  void checkApproach() {
    // without a distance: from where no point of the part is over its target
    const double distance = state_.approach_distance > 0.0 ? state_.approach_distance : 2.0 * sphere_.radius;
    std::vector<double> floors;
    for (const PartObstacle& obstacle : obstacles_)
      floors.push_back(std::min(probe_.nearest(obstacle, X_WG_, ProbedSurface::kContact).gap, 0.0));
    const auto motion = [&](double s) {
      return Pose(X_WG_.translation() - (distance - s) * state_.approach_W, X_WG_.rotation());
    };
    const PartTravel travel =
        probe_.travel(obstacles_, floors, motion, distance, ProbedSurface::kContact, kApproachTolerance);
    if (!travel.complete) {
      Finding finding{.kind = FindingKind::kApproach, .severity = Severity::kInfo, .object = part_};
      finding.state = state_.name;
      finding.line = state_.line;
      finding.value = distance - travel.length;
      finding.unit = "m";
      finding.text = fmt::format("the approach of {} is examined up to {} before its target only: too long",
                                 title(part_), inMillimetres(finding.value));
      checked_.findings.push_back(std::move(finding));
    }
    if (!travel.blocked) return;
    const PartObstacle& obstacle = obstacles_[travel.obstacle];
    const double before = distance - travel.length;
    Finding finding = findingAt(FindingKind::kApproach, obstacle, travel.place);
    finding.value = before;
    finding.text = fmt::format("the approach of {} is blocked {} before its target by {}{}", title(part_),
                               inMillimetres(before), title(obstacle.object),
                               travel.place.located ? ", at " + pointText(travel.place.p_WP) : "");
    finding.hint = "another direction, or a distance that begins behind it";
    checked_.findings.push_back(std::move(finding));
  }

  CheckedScene& checked_;
  const ScenarioState& state_;
  ObjectId part_;
  Pose X_WG_;
  simulation::BoundingSphere sphere_;
  ContactProbe probe_;
  std::vector<PartObstacle> obstacles_;
};

}  // namespace

void checkTarget(CheckedScene& checked, std::size_t state) { TargetCheck(checked, state).run(); }

}  // namespace tenon::check
