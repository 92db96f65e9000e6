#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// A row's normal in the coordinates of an island: it touches two bodies, or one.
struct RowNormal {
  static constexpr std::int32_t kNone = -1;
  std::array<std::int32_t, 2> body{kNone, kNone};
  std::array<Vector6, 2> part{Vector6::Zero(), Vector6::Zero()};

  bool operator==(const RowNormal&) const = default;
  [[nodiscard]] double norm2() const { return part[0].squaredNorm() + part[1].squaredNorm(); }
  /// Their product with each other, and with a long vector of six numbers a body.
  [[nodiscard]] double dot(const RowNormal& other) const;
  [[nodiscard]] double dot(std::span<const double> all) const;
  /// all += share * this
  void addTo(std::span<double> all, double share) const;
};

/// The rows that hold with equality, and the triangle L of L Lᵀ = Nᵀ N, N their normals side by side. Rows
/// that share no body do not meet in Nᵀ N, so a row of L is kept from its first number on, and an island in
/// which each body touches few costs little more than its rows. What Nᵀ N loses in digits against an
/// orthogonal basis a second solve for what the first has left gives back (Björck 1987, corrected
/// seminormal equations).
///
/// Threads: one at a time. Real-time: everything but construction.
class ActiveSet {
 public:
  explicit ActiveSet(std::size_t max_variables);

  /// No row is active.
  void reset(std::size_t variables);
  [[nodiscard]] std::size_t variables() const { return n_; }
  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] std::uint32_t row(std::size_t i) const { return rows_[i]; }
  [[nodiscard]] std::span<const std::uint32_t> rows() const { return rows_; }
  [[nodiscard]] const RowNormal& normal(std::size_t i) const { return normals_[i]; }

  /// Writes a normal as a sum of the active ones and what they leave free: what the next four tell about.
  void project(const RowNormal& normal);
  /// Of the projected row: it depends on the active ones.
  [[nodiscard]] bool dependent() const;
  /// Of the projected row: how much of it (squared) the active rows leave free.
  [[nodiscard]] double freePart2() const { return free2_; }
  /// Of the projected row: the direction in which it grows fastest without moving the active rows.
  [[nodiscard]] std::span<const double> direction() const { return {free_.data(), n_}; }
  /// Of the projected row: its coordinates in the active normals.
  [[nodiscard]] std::span<const double> coordinates() const { return {r_.data(), size()}; }

  /// The projected row becomes the last active one.
  void add(std::uint32_t row);
  /// The same for a row that was not projected, in less time. False: it depends on the active ones.
  bool append(std::uint32_t row, const RowNormal& normal);
  void drop(std::size_t position);

  /// b becomes (Nᵀ N)⁻¹ b.
  void solve(std::span<double> b) const;

 private:
  [[nodiscard]] double* line(std::size_t i) { return &L_[i * (i + 1) / 2]; }
  [[nodiscard]] const double* line(std::size_t i) const { return &L_[i * (i + 1) / 2]; }
  /// b becomes L⁻¹ b, when it is zero up to `first`; or L⁻ᵀ b.
  void solveLower(double* b, std::size_t first) const;
  void solveUpper(double* b) const;
  /// l_ = L⁻¹ Nᵀ normal, of the normal that is projected.
  void meet(const RowNormal& normal);
  void put(std::uint32_t row, double pivot);

  std::size_t n_ = 0;
  std::vector<double> L_;           ///< line by line
  std::vector<std::size_t> first_;  ///< of a line: in front of it are zeros
  std::vector<RowNormal> normals_;  ///< of the active rows
  std::vector<std::uint32_t> rows_;
  RowNormal projected_;
  std::size_t meets_from_ = 0;  ///< first active row that shares a body with the projected one
  double free2_ = 0.0;
  std::vector<double> l_, r_, free_, rest_, cosine_, sine_;
};

}  // namespace tenon
