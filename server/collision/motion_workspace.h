#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/collision/active_set.h"
#include "server/collision/motion_solver.h"

namespace tenon {

/// The part of a long vector that belongs to a body.
inline Eigen::Map<Vector6> segment(std::vector<double>& all, std::size_t body) {
  return Eigen::Map<Vector6>(&all[6 * body]);
}

/// Works in coordinates y = Lᵀ x of every body (H = L Lᵀ), where the energy is ½|y - y0|². All rows are
/// looked at together as columns of numbers, in x, since there a row needs no preparation.
///
/// Threads: one at a time. Real-time: everything but construction.
struct MotionSolver::Workspace {
  /// Neighbours in the list are neighbours in space: of this many, only the most violated row is tried.
  static constexpr std::size_t kBlock = 16;

  enum class RowState : std::uint8_t { kIdle, kActive, kLeftOut };

  /// Rows [first, first + count) between the same two bodies.
  struct Run {
    std::size_t first = 0, count = 0;
    std::array<std::int32_t, 2> body{};
  };

  Workspace(std::size_t max_bodies, std::size_t max_rows)
      : active(6 * max_bodies),
        L(max_bodies),
        state(max_rows),
        wanted(max_rows),
        body_of(max_rows),
        y0(6 * max_bodies),
        y(6 * max_bodies),
        x(6 * max_bodies),
        u(6 * max_bodies + 1),
        lack(6 * max_bodies) {
    for (std::vector<double>& column : columns) column.resize(max_rows + kBlock);
    runs.reserve(max_rows);
    tried.reserve(max_rows);
  }

  void setBody(std::size_t i, const MovableBody& body);
  /// Takes over the rows from `unchanged` on.
  void setRows(std::span<const GapRow> rows, std::span<const MovableBody> island, std::size_t unchanged);
  /// False: the rows contradict each other, or the iterations have run out. `known`: most
  /// rows are those of the last run.
  bool run(std::span<const std::uint32_t> first, std::span<const double> forces,
           std::span<const std::uint32_t> left_out, bool known);
  void updateMotions();
  [[nodiscard]] double slackOf(std::size_t row) const;
  /// Of all rows; the worst of every block that does not hold goes into `tried`.
  void findViolated();
  /// Of rows [first, end), a block of a run with motions `m`; row_count when all hold.
  [[nodiscard]] std::uint32_t worstOfBlock(std::size_t first, std::size_t end, const Run& run,
                                           const std::array<double, 9>& m) const;
  [[nodiscard]] std::size_t mostViolatedOfTried() const;
  [[nodiscard]] RowNormal normalOf(std::size_t row) const;
  /// Of the active rows those stay that are among `first` and whose normals are the same to the last bit.
  void keepActive(std::span<const std::uint32_t> first, std::span<const std::uint32_t> left_out);
  /// A row becomes active if it can: holding with equality is not yet seen to.
  bool take(std::uint32_t row, double force);
  /// From any multipliers that push to those with which the active rows hold; on the way those that would
  /// have to pull vanish. The dual energy grows with every step. False: the iterations have run out.
  bool ascend();
  bool enforceTried();
  bool enforce(std::size_t p);
  void dropActive(std::size_t position);

  ActiveSet active;
  std::vector<Matrix6> L;
  std::array<std::vector<double>, 10> columns;  ///< gap, normal, its moment about A's origin, about B's
  std::vector<RowState> state;
  std::vector<std::uint8_t> wanted;  ///< a row is one of those that held; all zero between uses
  std::vector<std::array<std::int32_t, 2>> body_of;
  std::vector<Run> runs;
  std::vector<std::uint32_t> tried;
  std::vector<double> y0, y, x;
  std::vector<double> u, lack;  ///< multipliers in the order of `active`, and what they lack
  std::size_t bodies = 0;
  std::size_t row_count = 0;
  bool clipped = false;  ///< negative gaps were raised to zero
  std::uint32_t iterations = 0;
  std::uint32_t iteration_limit = 0;
};

}  // namespace tenon
