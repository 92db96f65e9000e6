#pragma once

#include <array>
#include <cstddef>

#include "server/structures/triangle.h"

namespace tenon::bake {

/// Squared distances of up to 64 neighbouring points, lowered triangle by triangle; with SIMD where the
/// processor has AVX2 or AVX-512. The result has the bits of structures::squaredDistance().
///
/// Threads: one.
class PointBlock {
 public:
  static constexpr std::size_t kMost = 64;

  void clear() { count_ = 0; }
  /// Adds a point; its squared distance is at most `squared` [m^2].
  void add(const Vector3& p, double squared);
  /// To be called once after the last add().
  void finish();

  /// Lowers the points' squared distances to those from `t`. It may skip points that are farther from its
  /// plane than their squared distance by a millionth of this and `slack` [m^2].
  void lower(const structures::Triangle& t, double slack);

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] Vector3 point(std::size_t i) const { return {x_[i], y_[i], z_[i]}; }
  /// [m^2] Of point i, in the order of add().
  [[nodiscard]] double squared(std::size_t i) const { return squared_[i]; }
  /// `squared` [m^2]
  void setSquared(std::size_t i, double squared) { squared_[i] = squared; }
  /// [m^2] Of all points.
  [[nodiscard]] double largest() const { return largest_; }

 private:
  std::size_t count_ = 0;
  double largest_ = 0.0;                             // [m^2]
  alignas(64) std::array<double, kMost> x_{};        // [m]
  alignas(64) std::array<double, kMost> y_{};        // [m]
  alignas(64) std::array<double, kMost> z_{};        // [m]
  alignas(64) std::array<double, kMost> squared_{};  // [m^2]
};

}  // namespace tenon::bake
