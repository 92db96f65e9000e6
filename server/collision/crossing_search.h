#pragma once

#include <cstdint>
#include <span>

#include "server/collision/pair_features.h"

namespace tenon::collision {

/// [m] By this a crossing may be nearer than the gap of a feature of B in A's field: half the feature's
/// length, `half` [m], or where voxels are large, what interpolation rounds off A's edges.
[[nodiscard]] double nearerBy(double half, const PairFeatures& features) noexcept;

/// Lists the crossings of B's features near A with those of A, by A's bounding spheres. In A's frame: A's
/// features are many, those of B few.
///
/// Where there are more than the lists take, as in a tight fit, the margin shrinks to that of the nearest
/// ones found so far: what is farther is not searched.
///
/// Threads: belongs to one query. Real-time: all.
class CrossingSearch {
 public:
  /// Crossings go into `scratch.crossings`, their gaps into `result`.
  CrossingSearch(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                 PairQueryResult& result) noexcept;

  /// `near_A`: all of B's features that may meet one of A.
  void run(const ContactList& near_A) noexcept;

  /// The same; seeks B's features near A itself.
  void run() noexcept;

  /// [m] Lower bound of the gap of crossings that were not listed.
  [[nodiscard]] double margin() const { return margin_; }

 private:
  using Ball = NearPieces::Ball;

  /// A feature of B near A.
  struct NearFeature {
    double bound = 0.0;  ///< [m] crossings with it have at least this gap
    std::uint32_t point = 0;
    auto operator<=>(const NearFeature&) const = default;
  };
  using NearFeatures = FixedVector<NearFeature, kMaxPairContacts>;

  /// [m] Half the length of a feature of B.
  [[nodiscard]] float halfOf(std::uint32_t point) const;
  /// Whether crossings of features in a sphere, that may be nearer by `nearer` [m], may be within the margin.
  [[nodiscard]] bool isNear(const structures::ShellSphere& sphere_B, double nearer) const;
  /// Adds a feature of B when it is near A; of too many the half with the smallest bounds is kept.
  void findNear(std::uint32_t point, NearFeatures& found);
  void addPiece(std::uint32_t point);
  /// [m] From a piece of B its half and this far, there may be features of A that meet it.
  [[nodiscard]] float reachOfA() const;
  void crossPieces();
  /// Those of B's features that may meet a feature of A within a sphere.
  [[nodiscard]] std::span<const Ball> narrowed(const structures::ShellSphere& sphere,
                                               std::span<const Ball> from, NearPieces::Balls& to) const;
  void crossFeature(std::uint32_t point_A, std::span<const Ball> near);
  void list(const Contact& crossing);

  const PairQuery& query_;
  const PairFeatures& features_;
  NearPieces& near_;
  std::uint64_t& pieces_tested_;
  ContactList& crossings_;
  PairQueryResult& result_;
  const Transform X_WA_;
  const Transform X_AB_;
  double margin_;              ///< [m] crossings are sought up to this gap
  Eigen::AlignedBox3f box_A_;  ///< of the balls of all near pieces
};

}  // namespace tenon::collision
