#include "server/collision/crossing_search.h"

#include <algorithm>

#include "server/collision/edge_crossing.h"
#include "server/collision/feature_lists.h"

namespace tenon::collision {
namespace {

/// [voxels] By which interpolation rounds a convex edge off.
constexpr double kRounding = 0.45;

}  // namespace

double nearerBy(double half, const PairFeatures& features) noexcept {
  return std::max(half, kRounding * features.field_A->voxel());
}

CrossingSearch::CrossingSearch(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                               PairQueryResult& result) noexcept
    : query_(query),
      features_(features),
      near_(scratch.near),
      pieces_tested_(scratch.pieces_tested),
      crossings_(scratch.crossings),
      result_(result),
      X_WA_(query.X_WA),
      X_AB_(query.X_WA.inverse() * query.X_WB),
      margin_(query.margin) {
  near_.count = 0;
  crossings_.clear();
}

void CrossingSearch::run(const ContactList& near_A) noexcept {
  for (const Contact& contact : near_A) {
    if (contact.gap <= margin_ + nearerBy(halfOf(contact.point), features_)) addPiece(contact.point);
  }
  crossPieces();
}

void CrossingSearch::run() noexcept {
  const structures::Pointshell& shell = features_.features_B->points();
  const double longest = nearerBy(features_.features_B->longestHalf(), features_);
  NearFeatures found;
  for (const structures::ShellSphere& cluster : shell.clusters()) {
    if (!isNear(cluster, longest)) continue;
    for (const structures::ShellSphere& leaf : shell.leaves().subspan(cluster.first, cluster.count)) {
      if (!isNear(leaf, longest)) continue;
      for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) findNear(i, found);
    }
  }
  for (const NearFeature& one : found) {
    if (one.bound <= margin_) addPiece(one.point);
  }
  crossPieces();
}

float CrossingSearch::halfOf(std::uint32_t point) const {
  return features_.features_B->edges()[point].half_M.norm();
}

bool CrossingSearch::isNear(const structures::ShellSphere& sphere_B, double nearer) const {
  return features_.field_A->lowerBound(X_AB_ * sphere_B.p_MC, sphere_B.radius) <= margin_ + nearer;
}

void CrossingSearch::findNear(std::uint32_t point, NearFeatures& found) {
  const Vector3 p_A = X_AB_ * features_.features_B->points().points()[point].p_MP;
  const float half = halfOf(point);
  if (features_.field_A->lowerBound(p_A) > margin_ + nearerBy(half, features_)) return;
  const double nearer = std::max<double>(half, kRounding * features_.field_A->voxelAt(p_A));
  const double bound = features_.field_A->sample(p_A).distance - nearer;
  if (bound > margin_) return;
  if (found.size() == found.capacity()) {
    const std::size_t kept = found.capacity() / 2;
    const auto last = found.begin() + static_cast<std::ptrdiff_t>(kept);
    std::nth_element(found.begin(), last, found.end());
    margin_ = std::min(margin_, std::max(last->bound, 0.0));
    found.resize(kept);
  }
  found.push_back({bound, point});
}

void CrossingSearch::addPiece(std::uint32_t point) {
  EdgePiece& piece = near_.pieces[near_.count];
  piece = pieceOf(*features_.features_B, point, X_AB_);
  const float half = halfOf(point);
  const Vector3f p_A = piece.p.cast<float>();
  near_.all[near_.count] = {p_A, half, near_.count};
  near_.point[near_.count++] = point;
  const Vector3f reach = Vector3f::Constant(half + reachOfA());
  box_A_.extend(p_A - reach);
  box_A_.extend(p_A + reach);
}

float CrossingSearch::reachOfA() const {
  return static_cast<float>(features_.features_A->longestHalf() + margin_);
}

void CrossingSearch::crossPieces() {
  if (near_.count == 0) return;
  const structures::Pointshell& shell = features_.features_A->points();
  for (const structures::ShellSphere& cluster : shell.clusters()) {
    const auto by_cluster = narrowed(cluster, {near_.all.data(), near_.count}, near_.by_cluster);
    if (by_cluster.empty()) continue;
    for (const structures::ShellSphere& leaf : shell.leaves().subspan(cluster.first, cluster.count)) {
      const auto by_leaf = narrowed(leaf, by_cluster, near_.by_leaf);
      if (by_leaf.empty()) continue;
      for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) crossFeature(i, by_leaf);
    }
  }
}

std::span<const NearPieces::Ball> CrossingSearch::narrowed(const structures::ShellSphere& sphere,
                                                           std::span<const Ball> from,
                                                           NearPieces::Balls& to) const {
  if (box_A_.squaredExteriorDistance(sphere.p_MC) > sphere.radius * sphere.radius) return {};
  const float reach_A = reachOfA() + sphere.radius;
  std::size_t count = 0;
  for (const Ball& ball : from) {
    const float reach = ball.half + reach_A;
    to[count] = ball;
    count += (ball.p_A - sphere.p_MC).squaredNorm() <= reach * reach ? 1U : 0U;
  }
  return {to.data(), count};
}

void CrossingSearch::crossFeature(std::uint32_t point_A, std::span<const Ball> near) {
  const Vector3f p_A = features_.features_A->points().points()[point_A].p_MP;
  const float half_A = features_.features_A->edges()[point_A].half_M.norm();
  EdgePiece piece;
  bool known = false;
  std::uint64_t tested = 0;
  for (const Ball& ball : near) {
    const float reach = ball.half + half_A + static_cast<float>(margin_);
    if ((ball.p_A - p_A).squaredNorm() > reach * reach) continue;
    if (!known) piece = pieceOf(*features_.features_A, point_A);
    known = true;
    const EdgePiece& other = near_.pieces[ball.piece];
    Contact contact;
    if (piece.isPoint() && other.isPoint()) continue;
    ++tested;
    if (!meet(piece, other, margin_, kListedTolerance, contact) || contact.gap > margin_) continue;
    contact.kind = ContactKind::kCrossing;
    contact.point = point_A;
    contact.other = near_.point[ball.piece];
    evaluateCrossing(piece, other, X_WA_, contact);
    list(contact);
  }
  pieces_tested_ += tested;
}

void CrossingSearch::list(const Contact& crossing) {
  include(crossing, result_);
  if (crossings_.push_back(crossing)) return;
  keepNearest(kMaxCrossings, margin_, crossings_, result_);
  margin_ = std::min(margin_, std::max(result_.complete_to, 0.0));
  crossings_.push_back(crossing);
}

}  // namespace tenon::collision
