#include "server/simulation/worker_pool.h"

#include <array>
#include <atomic>
#include <chrono>
#include <thread>

#include <gtest/gtest.h>
#include <sched.h>

#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

/// Work of which every item waits until `workers` items have begun: ends only when as many threads work at
/// once. Threads: all.
class Meeting {
 public:
  explicit Meeting(unsigned workers) : workers_(workers) {}
  void operator()(unsigned, std::size_t) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    begun_.fetch_add(1);
    while (begun_.load() < workers_ && std::chrono::steady_clock::now() < limit) std::this_thread::yield();
    if (begun_.load() >= workers_) met_.fetch_add(1);
  }
  [[nodiscard]] bool met() const { return met_.load() == workers_; }

 private:
  const unsigned workers_;
  std::atomic<unsigned> begun_{0};
  std::atomic<unsigned> met_{0};
};

class WorkerPoolWithWorkers : public testing::TestWithParam<unsigned> {};

TEST_P(WorkerPoolWithWorkers, RunsAsManyItemsAtOnceAsItHasWorkers) {
  WorkerPool pool(GetParam());
  EXPECT_EQ(pool.workers(), GetParam());
  for (int run = 0; run < 20; ++run) {
    Meeting meeting(GetParam());
    pool.run(GetParam(), meeting);
    ASSERT_TRUE(meeting.met()) << "an item waited in vain for the others";
  }
}

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
    std::this_thread::sleep_for(std::chrono::milliseconds(3));  // longer than they spin
    Meeting meeting(GetParam());
    pool.run(GetParam(), meeting);
    ASSERT_TRUE(meeting.met());
  }
}

INSTANTIATE_TEST_SUITE_P(Workers, WorkerPoolWithWorkers, testing::Values(1U, 2U, 4U));

/// Scheduling of a thread as the operating system sees it.
struct SeenScheduling {
  int policy = -1;
  int priority = -1;
  cpu_set_t cpus{};

  static SeenScheduling ofThisThread() {
    SeenScheduling seen;
    sched_param parameter{};
    seen.policy = sched_getscheduler(0);
    sched_getparam(0, &parameter);
    seen.priority = parameter.sched_priority;
    sched_getaffinity(0, sizeof(seen.cpus), &seen.cpus);
    return seen;
  }
  friend bool operator==(const SeenScheduling& a, const SeenScheduling& b) {
    return a.policy == b.policy && a.priority == b.priority && CPU_EQUAL(&a.cpus, &b.cpus);
  }
};

/// The scheduling of all three workers of a pool; the first is the caller.
std::array<SeenScheduling, 3> schedulingOfWorkers(WorkerPool& pool) {
  std::array<SeenScheduling, 3> seen;
  Meeting meeting(3);
  auto work = [&](unsigned worker, std::size_t item) {
    seen[worker] = SeenScheduling::ofThisThread();
    meeting(worker, item);  // so that each worker has one item
  };
  pool.run(3, work);
  EXPECT_TRUE(meeting.met());
  return seen;
}

/// In a thread of its own: `policy` with `priority`, and the first permitted CPU alone. Calls `then` when
/// that was granted; returns whether.
template <typename Then>
bool runScheduledAs(int policy, int priority, Then&& then) {
  bool granted = false;
  std::thread([&] {
    const sched_param parameter{priority};
    cpu_set_t cpus = SeenScheduling::ofThisThread().cpus;
    bool first = true;
    for (std::size_t cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
      if (!CPU_ISSET(cpu, &cpus)) continue;
      if (!first) CPU_CLR(cpu, &cpus);
      first = false;
    }
    granted =
        sched_setscheduler(0, policy, &parameter) == 0 && sched_setaffinity(0, sizeof(cpus), &cpus) == 0;
    if (granted) then();
  }).join();
  return granted;
}

void expectWorkersScheduledAsCaller(WorkerPool& pool, int policy, int priority) {
  EXPECT_NE(schedulingOfWorkers(pool)[1].policy, policy) << "else this test shows nothing";
  EXPECT_EQ(pool.shareScheduling(), "");
  for (const SeenScheduling& worker : schedulingOfWorkers(pool)) {
    EXPECT_EQ(worker.policy, policy);
    EXPECT_EQ(worker.priority, priority);
    EXPECT_TRUE(worker == SeenScheduling::ofThisThread());
  }
}

// SCHED_BATCH is a class that everybody may choose
TEST(WorkerPool, ItsThreadsTakeTheSchedulingOfTheCaller) {
  WorkerPool pool(3);
  EXPECT_TRUE(runScheduledAs(SCHED_BATCH, 0, [&] { expectWorkersScheduledAsCaller(pool, SCHED_BATCH, 0); }));
}

TEST(WorkerPool, ItsThreadsTakeARealTimePriority) {
  WorkerPool pool(3);
  if (!runScheduledAs(SCHED_RR, 2, [&] { expectWorkersScheduledAsCaller(pool, SCHED_RR, 2); }))
    GTEST_SKIP() << "this user may not have a real-time priority";
}

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
  Meeting warm_up(3);
  pool.run(3, warm_up);
  const test::RealtimeGuard guard(test::CountedThreads::kAll);
  bool met = true;
  for (int run = 0; run < 500 && met; ++run) {
    Meeting meeting(3);
    pool.run(3, meeting);
    met = met && meeting.met();
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
  EXPECT_TRUE(met) << "all workers took part";
}

}  // namespace
}  // namespace tenon::simulation
