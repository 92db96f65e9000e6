#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/ids.h"
#include "server/collision/island_solver.h"
#include "server/simulation/worker_pool.h"

namespace tenon {

/// The contact islands of one tick as problems side by side, each with its bodies, its pairs and room for
/// their results, so that workers can solve them at the same time without touching each other's memory.
///
/// Threads: one fills and reads, solve() shares the islands among the pool. Real-time: everything but the
/// constructor.
class IslandWork {
 public:
  struct Island {
    std::size_t first_body = 0, bodies = 0;
    std::size_t first_pair = 0, pairs = 0;
    SolveLimits limits;
    SolveReport report;
  };

  IslandWork(std::size_t max_bodies, std::size_t max_pairs, unsigned workers);

  void clear() noexcept;
  void beginIsland(const SolveLimits& limits) noexcept;
  /// Contacts of the island begun last are listed this much [m] farther ahead.
  void widenMargin(double margin) noexcept { islands_[island_count_ - 1].limits.contact_margin += margin; }
  [[nodiscard]] SolveLimits& limits(std::size_t island) { return islands_[island].limits; }
  /// The island begun last may test so many more points.
  void addPoints(std::uint64_t points) noexcept;
  /// To the island begun last.
  void addBody(ObjectId object, const MovableBody& body) noexcept;
  void addPair(std::size_t pair, const IslandPair& island_pair) noexcept;

  void solve(WorkerPool& pool) noexcept;

  [[nodiscard]] std::span<const Island> islands() const { return {islands_.data(), island_count_}; }
  [[nodiscard]] std::size_t bodies() const { return body_count_; }
  [[nodiscard]] ObjectId objectOf(std::size_t body) const { return objects_[body]; }
  [[nodiscard]] MovableBody& body(std::size_t body) { return bodies_[body]; }
  [[nodiscard]] const MovableBody& body(std::size_t body) const { return bodies_[body]; }
  [[nodiscard]] const Pose& poseOf(std::size_t body) const { return bodies_[body].X_WB; }
  [[nodiscard]] std::size_t pairs() const { return pair_count_; }
  [[nodiscard]] std::size_t pairOf(std::size_t slot) const { return pair_of_slot_[slot]; }
  [[nodiscard]] const IslandPairResult& resultOf(std::size_t slot) const { return results_[slot]; }

 private:
  std::vector<Island> islands_;
  std::vector<MovableBody> bodies_;
  std::vector<ObjectId> objects_;
  std::vector<IslandPair> pairs_;
  std::vector<std::size_t> pair_of_slot_;
  std::vector<IslandPairResult> results_;
  std::vector<IslandSolver> solvers_;  // one a worker
  std::size_t island_count_ = 0;
  std::size_t body_count_ = 0;
  std::size_t pair_count_ = 0;
};

}  // namespace tenon
