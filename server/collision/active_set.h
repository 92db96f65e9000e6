#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tenon {

/// The rows that hold with equality, as an orthogonal basis J and a triangle R with Jᵀ N = [R; 0], N their
/// normals side by side. Adding or dropping a row costs a few Givens rotations (Goldfarb and Idnani 1983,
/// section 4).
///
/// Threads: one at a time. Real-time: everything but construction.
class ActiveSet {
 public:
  explicit ActiveSet(std::size_t max_variables);

  void reset(std::size_t variables);
  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] std::uint32_t row(std::size_t i) const { return rows_[i]; }

  /// d = Jᵀ normal: what the other functions need to know about a row.
  void project(std::span<const double> normal);
  /// Of the projected row: how much of it (squared) the active rows leave free.
  [[nodiscard]] double freePart2() const;
  /// Of the projected row: the direction in which it grows fastest without moving the active rows.
  void direction(std::span<double> step) const;
  /// Of the projected row: r = R⁻¹ d, its coordinates in the active normals.
  void coordinates(std::span<double> r) const;

  /// The projected row becomes the last active one.
  void add(std::uint32_t row);
  void drop(std::size_t position);

 private:
  double& j(std::size_t row, std::size_t column) { return J_[column * stride_ + row]; }
  double& r(std::size_t row, std::size_t column) { return R_[column * stride_ + row]; }
  [[nodiscard]] double j(std::size_t row, std::size_t column) const { return J_[column * stride_ + row]; }
  [[nodiscard]] double r(std::size_t row, std::size_t column) const { return R_[column * stride_ + row]; }
  /// Turns columns k and k + 1 of J.
  void turn(std::size_t k, double cosine, double sine);

  std::size_t stride_;
  std::size_t n_ = 0;
  std::vector<double> J_, R_, d_;
  std::vector<std::uint32_t> rows_;
};

}  // namespace tenon
