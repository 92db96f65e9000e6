#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon::collision {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// The normal of a row of the QP in the coordinates of an island, six a body: non-zero for two bodies, or
/// one. MotionSolver scales coordinates by the inverse Cholesky factor of the Hessian, so that normals are in
/// [sqrt m/N].
struct RowNormal {
  static constexpr std::int32_t kNone = -1;
  std::array<std::int32_t, 2> body{kNone, kNone};
  /// the normal's six coordinates of each body
  std::array<Vector6, 2> part{Vector6::Zero(), Vector6::Zero()};

  bool operator==(const RowNormal&) const = default;
  [[nodiscard]] double norm2() const { return part[0].squaredNorm() + part[1].squaredNorm(); }
  [[nodiscard]] double dot(const RowNormal& other) const;
  /// `all` [sqrt Nm, or sqrt m/N]: coordinates of all bodies, or a normal in them.
  [[nodiscard]] double dot(std::span<const double> all) const;
  /// `all` [sqrt Nm, or sqrt m/N] += `factor` [N, or -] * this
  void addTo(std::span<double> all, double factor) const;
};

/// The active rows of the QP (those that hold with equality) and the Cholesky factor L Lᵀ = Nᵀ N, where the
/// columns of N are their normals.
///
/// Rows without a common body are orthogonal, so each line of L is stored from its first non-zero entry
/// (skyline): an island in which each body touches few others costs little more than its number of rows. Nᵀ N
/// has the squared condition number of N; a second solve with the residual makes up for it (corrected
/// seminormal equations, Björck 1987).
///
/// Threads: one at a time. Real-time: everything but construction.
class ActiveSet {
 public:
  explicit ActiveSet(std::size_t max_variables);

  /// Empties the set, for a problem of so many variables; at most max_variables.
  void reset(std::size_t variables);
  [[nodiscard]] std::size_t variables() const { return n_; }
  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] std::uint32_t row(std::size_t i) const { return rows_[i]; }
  [[nodiscard]] std::span<const std::uint32_t> rows() const { return rows_; }
  [[nodiscard]] const RowNormal& normal(std::size_t i) const { return normals_[i]; }

  /// Splits a normal into a combination of the active normals and a free part orthogonal to them: the next
  /// four functions give the result.
  void project(const RowNormal& normal);
  /// The projected row is linearly dependent on the active rows.
  [[nodiscard]] bool dependent() const;
  /// [m/N] Squared norm of the projected row's free part: by how much its gap grows per newton of its
  /// multiplier, while the active rows hold with equality.
  [[nodiscard]] double freeNorm2() const { return free_norm2_; }
  /// [sqrt m/N] Free part of the projected row: the direction of its steepest increase that leaves the active
  /// rows unchanged.
  [[nodiscard]] std::span<const double> direction() const { return {free_.data(), n_}; }
  /// [-] Coefficients of the projected row in the active normals.
  [[nodiscard]] std::span<const double> coordinates() const { return {r_.data(), size()}; }

  /// Appends the projected row to the active ones.
  void add(std::uint32_t row);
  /// Appends a row without projecting it first, in less time. False: it depends on the active rows, and is
  /// not added.
  bool append(std::uint32_t row, const RowNormal& normal);
  void drop(std::size_t position);

  /// `b` [m] becomes (Nᵀ N)⁻¹ b [N]: of violations of the active rows, changes of their multipliers.
  void solve(std::span<double> b) const;

 private:
  [[nodiscard]] double* line(std::size_t i) { return &L_[i * (i + 1) / 2]; }
  [[nodiscard]] const double* line(std::size_t i) const { return &L_[i * (i + 1) / 2]; }
  /// `b` [any unit] becomes L⁻¹ b; its entries before `first` are zero.
  void solveForward(double* b, std::size_t first) const;
  /// `b` [any unit] becomes L⁻ᵀ b.
  void solveBackward(double* b) const;
  /// Sets projected_ and l_ = L⁻¹ Nᵀ normal.
  void projectForward(const RowNormal& normal);
  /// Appends projected_ with l_ and `pivot` [sqrt m/N] as its line of L.
  void push(std::uint32_t row, double pivot);

  std::size_t n_ = 0;
  std::vector<double> L_;           ///< [sqrt m/N] lower triangle, line by line
  std::vector<std::size_t> first_;  ///< first non-zero column of a line
  std::vector<RowNormal> normals_;  ///< of the active rows
  std::vector<std::uint32_t> rows_;
  RowNormal projected_;
  std::size_t first_coupled_ = 0;      ///< first active row that shares a body with the projected one
  double free_norm2_ = 0.0;            ///< [m/N]
  std::vector<double> l_;              ///< [sqrt m/N]
  std::vector<double> r_;              ///< [-]
  std::vector<double> free_;           ///< [sqrt m/N]
  std::vector<double> residual_;       ///< [m/N], [-] once solved
  std::vector<double> cosine_, sine_;  ///< [-] of the Givens rotations
};

}  // namespace tenon::collision
