#include "server/simulation/island_work.h"

#include <algorithm>
#include <cassert>

namespace tenon::simulation {

IslandWork::IslandWork(std::size_t max_bodies, std::size_t max_pairs, unsigned workers)
    : islands_(max_bodies),
      bodies_(max_bodies),
      objects_(max_bodies),
      pairs_(max_pairs),
      pair_of_slot_(max_pairs),
      results_(max_pairs) {
  for (collision::IslandPairResult& result : results_) result.multipliers.resize(collision::kMaxPairContacts);
  solvers_.reserve(workers);
  for (unsigned worker = 0; worker < workers; ++worker) {
    solvers_.emplace_back(std::max<std::size_t>(max_bodies, 1), std::max<std::size_t>(max_pairs, 1));
  }
}

void IslandWork::clear() noexcept {
  island_count_ = 0;
  body_count_ = 0;
  pair_count_ = 0;
}

void IslandWork::beginIsland(const collision::SolveLimits& limits) noexcept {
  assert(island_count_ < islands_.size());
  islands_[island_count_++] = {body_count_, 0, pair_count_, 0, limits, {}};
}

void IslandWork::addPointBudget(std::uint64_t points) noexcept {
  std::uint64_t& limit = islands_[island_count_ - 1].limits.points;
  limit = limit == collision::SolveLimits{}.points ? points : limit + points;
}

void IslandWork::addBody(ObjectId object, const collision::MovableBody& body) noexcept {
  assert(body_count_ < bodies_.size());
  objects_[body_count_] = object;
  bodies_[body_count_++] = body;
  ++islands_[island_count_ - 1].bodies;
}

void IslandWork::addPair(std::size_t pair, const collision::IslandPair& island_pair) noexcept {
  assert(pair_count_ < pairs_.size());
  pair_of_slot_[pair_count_] = pair;
  pairs_[pair_count_++] = island_pair;
  ++islands_[island_count_ - 1].pairs;
}

void IslandWork::solve(WorkerPool& pool) noexcept {
  auto solveOne = [this](unsigned worker, std::size_t item) {
    Island& island = islands_[item];
    island.report = solvers_[worker].solve(
        std::span(bodies_).subspan(island.first_body, island.bodies),
        std::span<const collision::IslandPair>(pairs_).subspan(island.first_pair, island.pairs),
        island.limits, std::span(results_).subspan(island.first_pair, island.pairs));
  };
  pool.run(island_count_, solveOne);
}

}  // namespace tenon::simulation
