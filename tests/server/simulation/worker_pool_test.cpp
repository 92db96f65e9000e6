#include "server/simulation/worker_pool.h"

#include <array>
#include <atomic>
#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

class WorkerPoolWithWorkers : public testing::TestWithParam<unsigned> {};

TEST_P(WorkerPoolWithWorkers, CallsEveryItemOfEveryRunExactlyOnce) {
  WorkerPool pool(GetParam());
  for (int run = 0; run < 3000; ++run) {
    const auto items = static_cast<std::size_t>(run % 12);
    std::array<int, 12> calls{};
    auto work = [&](unsigned worker, std::size_t item) {
      ASSERT_LT(worker, pool.workers());
      ++calls[item];
    };
    pool.run(items, work);
    for (std::size_t item = 0; item < calls.size(); ++item) ASSERT_EQ(calls[item], item < items ? 1 : 0);
  }
}

TEST_P(WorkerPoolWithWorkers, WritesOfTheItemsAreVisibleAfterRun) {
  WorkerPool pool(GetParam());
  std::array<double, 64> values{};
  for (int run = 1; run <= 200; ++run) {
    auto work = [&](unsigned, std::size_t item) { values[item] += static_cast<double>(item); };
    pool.run(values.size(), work);
    for (std::size_t item = 0; item < values.size(); ++item) {
      ASSERT_EQ(values[item], static_cast<double>(item) * run);
    }
  }
}

TEST_P(WorkerPoolWithWorkers, WakesSleepingWorkers) {
  WorkerPool pool(GetParam());
  for (int run = 0; run < 5; ++run) {
    std::this_thread::sleep_for(std::chrono::milliseconds(3));
    std::atomic<int> calls{0};
    auto work = [&](unsigned, std::size_t) { calls.fetch_add(1); };
    pool.run(8, work);
    EXPECT_EQ(calls.load(), 8);
  }
}

INSTANTIATE_TEST_SUITE_P(Workers, WorkerPoolWithWorkers, testing::Values(1U, 2U, 4U));

TEST(WorkerPool, APoolOfOneWorkerRunsInTheCallingThread) {
  WorkerPool pool(1);
  const std::thread::id here = std::this_thread::get_id();
  bool always_here = true;
  auto work = [&](unsigned, std::size_t) { always_here = always_here && std::this_thread::get_id() == here; };
  pool.run(100, work);
  EXPECT_TRUE(always_here);
}

TEST(WorkerPool, RunAllocatesNothingAndLocksNothing) {
  WorkerPool pool(3);
  std::array<int, 16> values{};
  auto work = [&](unsigned, std::size_t item) { ++values[item]; };
  pool.run(values.size(), work);
  const test::RealtimeGuard guard;
  for (int run = 0; run < 500; ++run) pool.run(values.size(), work);
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::simulation
