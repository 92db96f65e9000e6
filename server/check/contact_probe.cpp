#include "server/check/contact_probe.h"

#include <algorithm>

#include "server/simulation/coll_pair.h"

namespace tenon::check {
namespace {

constexpr double kMarginVoxels = 2.0;       // [voxels] up to which contacts are located
constexpr double kShortestStep = 50e-6;     // [m] while sliding
constexpr double kStepVoxels = 0.25;        // [voxels] likewise
constexpr double kSafeShare = 0.9;          // [-] of a gap: gradients of the field may exceed 1 a little
constexpr double kBisection = 1e-6;         // [m]
constexpr std::size_t kLongestPath = 4000;  // [steps]
constexpr double kFar = 1e6;                // [m]

double finestVoxel(const structures::DistanceField& field) {
  return field.voxel() / field.layout().refinement;
}

/// Takes B's dilation from the gaps of A's points, and returns the smallest gap [m].
double undilate(const structures::DistanceField& field, const Pose& X_WB,
                collision::PairQueryResult& result) {
  if (field.dilation() == 0.0 || result.contacts.empty()) return result.smallest_gap;
  const auto nearer = [](const collision::Contact& one, const collision::Contact& other) {
    return one.gap < other.gap;
  };
  const auto smallest = [&] {
    return std::min_element(result.contacts.begin(), result.contacts.end(), nearer)->gap;
  };
  // a point deeper than the field's band is in no list
  const bool is_deeper = result.smallest_gap < smallest() - kBisection;
  const Pose X_BW = X_WB.inverse();
  for (collision::Contact& contact : result.contacts)
    if (contact.kind == collision::ContactKind::kShellPoint)
      contact.gap += field.dilationAt(X_BW * contact.p_WP);
  return is_deeper ? result.smallest_gap : smallest();
}

}  // namespace

ContactProbe::ContactProbe(const simulation::Scene& scene, ObjectId part)
    : scene_(scene),
      part_(part),
      result_(std::make_unique<collision::PairQueryResult>()),
      feature_scratch_(std::make_unique<collision::FeatureScratch>()) {}

NearestPlace ContactProbe::nearest(const PartObstacle& obstacle, const Pose& X_WO, ProbedSurface surface) {
  const simulation::PairSpec& pair = scene_.pairs[obstacle.pair];
  const bool part_is_shell = pair.a == part_;
  const structures::HapticStructures& a = *scene_.objects[pair.a.value].structures;
  const structures::HapticStructures& b = *scene_.objects[pair.b.value].structures;
  collision::PairFeatures features = simulation::featuresOf(scene_, pair);
  if (surface == ProbedSurface::kMesh) features.most_dilation_A = 0.0;
  collision::PairQuery query{&a.shell, &b.field, part_is_shell ? X_WO : obstacle.X_WO,
                             part_is_shell ? obstacle.X_WO : X_WO};
  query.margin = kMarginVoxels * b.field.voxel();
  query.correct_ridges = true;
  collision::queryPair(query, *result_);
  collision::queryFeatures(query, features, *feature_scratch_, *result_);
  NearestPlace place;
  place.gap =
      surface == ProbedSurface::kMesh ? undilate(b.field, query.X_WB, *result_) : result_->smallest_gap;
  place.free_path = std::min(place.gap, result_->dormant_gap);
  place.voxel = finestVoxel(b.field);
  const auto nearest = std::min_element(
      result_->contacts.begin(), result_->contacts.end(),
      [](const collision::Contact& one, const collision::Contact& other) { return one.gap < other.gap; });
  if (nearest == result_->contacts.end() || nearest->dormant()) return place;
  place.located = true;
  place.exact = nearest->gap <= place.gap + kBisection;
  place.p_WP = nearest->p_WP;
  place.n_W = part_is_shell ? nearest->n_W : Vector3(-nearest->n_W);
  const Vector3 p_BP = query.X_WB.inverse() * nearest->p_WP;
  place.voxel = b.field.voxelAt(p_BP);
  place.dilation = b.field.dilationAt(p_BP);
  return place;
}

ContactProbe::Room ContactProbe::roomAt(std::span<const PartObstacle> obstacles,
                                        std::span<const double> floors, const Pose& X_WO,
                                        ProbedSurface surface, const ProbeTolerance& tolerance) {
  Room least{.room = kFar, .free_path = kFar};
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    const NearestPlace place = nearest(obstacles[i], X_WO, surface);
    const double allowed = tolerance.at(place) - floors[i];
    const double free_path = std::min(least.free_path, place.free_path + allowed);
    if (place.gap + allowed < least.room) least = {place.gap + allowed, free_path, i, place};
    least.free_path = free_path;
  }
  return least;
}

PartTravel ContactProbe::travel(std::span<const PartObstacle> obstacles, std::span<const double> floors,
                                const PartMotion& motion, double limit, ProbedSurface surface,
                                const ProbeTolerance& tolerance) {
  const auto at = [&](double s) { return roomAt(obstacles, floors, motion(s), surface, tolerance); };
  double free = 0.0;
  Room here = at(0.0);
  for (std::size_t step = 0; here.room >= 0.0; ++step) {
    if (free >= limit || step == kLongestPath) return {.length = free, .complete = free >= limit};
    const double shortest = std::max(kShortestStep, kStepVoxels * here.place.voxel);
    const double next = std::min(limit, free + std::max(shortest, kSafeShare * here.free_path));
    here = at(next);
    if (here.room >= 0.0) {
      free = next;
      continue;
    }
    // between a free place and a blocked one
    double blocked = next;
    while (blocked - free > kBisection) {
      const double middle = 0.5 * (free + blocked);
      const Room between = at(middle);
      (between.room >= 0.0 ? free : blocked) = middle;
      if (between.room < 0.0) here = between;
    }
  }
  return {.length = free, .blocked = true, .obstacle = here.obstacle, .place = here.place};
}

}  // namespace tenon::check
