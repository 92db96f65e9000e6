#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "server/collision/edge_piece.h"
#include "server/collision/pair_query.h"
#include "server/structures/feature_shell.h"

namespace tenon::collision {

inline constexpr std::size_t kFeatureRoom = 128;
inline constexpr std::size_t kMaxCrossings = 64;

/// The second direction of a pair: the features of both bodies, and the field of A.
///
/// The points of A's pointshell miss what is thinner than their spacing on B: a stud, an edge, a corner. So
/// B's features are also asked in A's field, with contacts as of A against B (normals from B into A). Two
/// edges that cross touch between the points of both: the gap there is that of the closest points of their
/// segments, the fields only find candidates. Features are where the exact surface is: thin walls of B are
/// thickened for A's points alone.
struct PairFeatures {
  const structures::FeatureShell* features_A = nullptr;
  const structures::FeatureShell* features_B = nullptr;
  const structures::DistanceField* field_A = nullptr;
  /// [m] Of the dilation of A's field so much counts for features of B
  double most_dilation_A = std::numeric_limits<double>::infinity();

  [[nodiscard]] bool any() const {
    return features_B != nullptr && !features_B->empty() && !field_A->empty();
  }
};

/// Whether there is a feature of this index, and a piece of an edge about it.
[[nodiscard]] inline bool isEdge(const structures::FeatureShell& features, std::size_t point) {
  return point < features.edges().size() && features.edges()[point].half_M.squaredNorm() > 0.0F;
}

/// B's features near A, in A's frame.
struct NearPieces {
  struct Ball {
    Vector3f p_A;
    float half = 0.0F;  ///< [m] half the length of the piece
    std::uint32_t piece = 0;
  };
  using Balls = std::array<Ball, kMaxPairContacts>;

  std::uint32_t count = 0;
  std::array<EdgePiece, kMaxPairContacts> pieces;
  std::array<std::uint32_t, kMaxPairContacts> point;  ///< index in B's features
  Balls all, by_cluster, by_leaf;
};

/// Memory of the functions below; one for each thread.
struct FeatureScratch {
  PairQueryResult of_B;   ///< B's features in A's field
  ContactList crossings;  ///< found, before the nearest are kept
  NearPieces near;
  std::uint64_t pieces_tested = 0;  ///< of A's features, against one near piece each: work, counted up
};

}  // namespace tenon::collision
