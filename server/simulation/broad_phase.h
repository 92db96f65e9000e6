#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/spatial.h"
#include "server/simulation/scene.h"

namespace tenon::simulation {

/// Broad phase by sweep and prune along x: finds the pairs whose bounding spheres are near each other. The
/// interval order is kept from tick to tick and repaired by insertion sort.
///
/// Intervals with equal lower ends are ordered by id, so the order depends on the poses only: it is not part
/// of a checkpoint, and the result is the same in every run.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class BroadPhase {
 public:
  explicit BroadPhase(const Scene& scene);

  /// The object's bounding sphere: its surface is within `radius` [m] of p_WC.
  void setSphere(ObjectId object, const Vector3& p_WC, double radius) noexcept;
  /// The object is in no result until its sphere is set again.
  void remove(ObjectId object) noexcept;

  /// Indices, in ascending order, of the pairs whose spheres are at most `margin` [m] plus the
  /// largest dilation apart. Valid until the next call.
  [[nodiscard]] std::span<const std::uint32_t> findPairs(double margin) noexcept;

 private:
  static constexpr std::int32_t kNone = -1;

  struct Interval {
    Vector3 p_WC = Vector3::Zero();
    double radius = 0.0;           ///< [m]
    double low = 0.0, high = 0.0;  ///< [m] ends along x, padded by half of margin and largest dilation
    bool present = false;
  };

  void sort() noexcept;
  /// Adds the pairs of two objects whose spheres are within `margin` [m].
  void addPairsOf(std::uint32_t one, std::uint32_t other, double margin) noexcept;
  [[nodiscard]] std::int32_t& firstPair(std::uint32_t one, std::uint32_t other);

  std::vector<Interval> intervals_;       // by object
  std::vector<std::uint32_t> order_;      // objects, by lower end
  std::vector<std::int32_t> first_pair_;  // by two objects: row of the smaller id
  std::vector<std::int32_t> next_pair_;   // by pair: next pair of the same two objects
  std::vector<double> dilations_;         // [m] by pair
  std::vector<std::uint32_t> found_;
  double largest_dilation_ = 0.0;  // [m]
};

}  // namespace tenon::simulation
