#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/spatial.h"
#include "server/simulation/scene.h"

namespace tenon {

/// Finds the pairs whose two balls come near each other, of however many there are: a sweep along x over
/// the balls' shadows, kept sorted from tick to tick (bodies hardly overtake each other in a millisecond).
///
/// Equal ends are sorted by id, so the order is a function of the poses alone: it needs no place in a
/// snapshot, and the answer is the same in every run.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class BroadPhase {
 public:
  explicit BroadPhase(const Scene& scene);

  /// Where the object's surface is: within `radius` of p_WC.
  void place(ObjectId object, const Vector3& p_WC, double radius) noexcept;
  /// The object meets nobody until it is placed again.
  void hide(ObjectId object) noexcept;

  /// The pairs whose surfaces, dilated, may be within `reach` [m] of each other, in order of their index.
  [[nodiscard]] std::span<const std::uint32_t> find(double reach) noexcept;

 private:
  static constexpr std::int32_t kNone = -1;

  struct Shadow {
    Vector3 p_WC = Vector3::Zero();
    double radius = 0.0;
    double low = 0.0, high = 0.0;  ///< along x, widened by half of what is near
    bool there = false;
  };

  void sort() noexcept;
  void meet(std::uint32_t one, std::uint32_t other, double reach) noexcept;
  [[nodiscard]] std::int32_t& firstPair(std::uint32_t one, std::uint32_t other);

  std::vector<Shadow> shadows_;           // by object
  std::vector<std::uint32_t> order_;      // objects by low end
  std::vector<std::int32_t> first_pair_;  // by two objects
  std::vector<std::int32_t> next_pair_;   // by pair: another one of the same two objects
  std::vector<double> dilations_;         // by pair
  std::vector<std::uint32_t> found_;
  double largest_dilation_ = 0.0;
};

}  // namespace tenon
