#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/ids.h"
#include "server/collision/island_solver.h"
#include "server/simulation/worker_pool.h"

namespace tenon::simulation {

/// The contact islands of one tick, each with its bodies, pairs and results in memory of its own, so that
/// workers can solve them in parallel.
///
/// A slot is the position of a pair in this tick's work. Threads: one fills and reads, solve() distributes
/// the islands over the pool. Real-time: everything but the constructor.
class IslandWork {
 public:
  struct Island {
    std::size_t first_body = 0, bodies = 0;
    std::size_t first_pair = 0, pairs = 0;
    collision::SolveLimits limits;
    collision::SolveReport report;
  };

  IslandWork(std::size_t max_bodies, std::size_t max_pairs, unsigned workers);

  void clear() noexcept;
  void beginIsland(const collision::SolveLimits& limits) noexcept;
  /// Adds `margin` [m] to the contact margin of the island begun last.
  void widenMargin(double margin) noexcept { islands_[island_count_ - 1].limits.contact_margin += margin; }
  [[nodiscard]] collision::SolveLimits& limits(std::size_t island) { return islands_[island].limits; }
  /// Adds `points` to the point budget of the island begun last.
  void addPointBudget(std::uint64_t points) noexcept;
  /// Both add to the island begun last.
  void addBody(ObjectId object, const collision::MovableBody& body) noexcept;
  void addPair(std::size_t pair, const collision::IslandPair& island_pair) noexcept;

  void solve(WorkerPool& pool) noexcept;

  [[nodiscard]] std::span<const Island> islands() const { return {islands_.data(), island_count_}; }
  [[nodiscard]] std::size_t bodies() const { return body_count_; }
  [[nodiscard]] ObjectId objectOf(std::size_t body) const { return objects_[body]; }
  [[nodiscard]] collision::MovableBody& body(std::size_t body) { return bodies_[body]; }
  [[nodiscard]] const collision::MovableBody& body(std::size_t body) const { return bodies_[body]; }
  [[nodiscard]] const Pose& poseOf(std::size_t body) const { return bodies_[body].X_WB; }
  [[nodiscard]] std::size_t pairs() const { return pair_count_; }
  [[nodiscard]] std::size_t pairOf(std::size_t slot) const { return pair_of_slot_[slot]; }
  [[nodiscard]] const collision::IslandPairResult& resultOf(std::size_t slot) const { return results_[slot]; }

 private:
  std::vector<Island> islands_;
  std::vector<collision::MovableBody> bodies_;
  std::vector<ObjectId> objects_;
  std::vector<collision::IslandPair> pairs_;
  std::vector<std::size_t> pair_of_slot_;
  std::vector<collision::IslandPairResult> results_;
  std::vector<collision::IslandSolver> solvers_;  // one per worker
  std::size_t island_count_ = 0;
  std::size_t body_count_ = 0;
  std::size_t pair_count_ = 0;
};

}  // namespace tenon::simulation
