#include "idl/threads/cyclic_thread.h"

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "idl/threads/virtual_clock.h"

namespace tenon::threads {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

class CyclicThreadTest : public ::testing::Test {
 protected:
  void advance(Nanoseconds by) {
    clock_->advance(by);
    clock_->waitUntilAsleep();
  }
  std::shared_ptr<VirtualClock> clock_ = std::make_shared<VirtualClock>();
};

TEST_F(CyclicThreadTest, TicksOncePerPeriod) {
  std::vector<std::uint64_t> ticks;
  CyclicThread thread(clock_, {}, [&](std::uint64_t tick) { ticks.push_back(tick); });
  thread.start();
  clock_->waitUntilAsleep();
  for (int i = 0; i < 5; ++i) advance(milliseconds(1));
  thread.stop();
  EXPECT_EQ(ticks, (std::vector<std::uint64_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(thread.lateTicks(), 0U);
}

TEST_F(CyclicThreadTest, PreparesOnItsThreadBeforeTheFirstTickAndReportsWhatWasNotGranted) {
  std::thread::id prepared;
  std::thread::id ticked;
  bool ticks_before = false;
  CyclicThread thread(clock_,
                      {.prepare =
                           [&] {
                             prepared = std::this_thread::get_id();
                             ticks_before = ticked != std::thread::id();
                             return std::string("no cake");
                           }},
                      [&](std::uint64_t) { ticked = std::this_thread::get_id(); });
  thread.start();
  EXPECT_EQ(thread.notGranted(), "no cake");
  clock_->waitUntilAsleep();
  advance(milliseconds(1));
  thread.stop();
  EXPECT_EQ(prepared, ticked);
  EXPECT_NE(prepared, std::this_thread::get_id());
  EXPECT_FALSE(ticks_before);
}

TEST_F(CyclicThreadTest, DoesNotTickBeforeTheEndOfThePeriod) {
  CyclicThread thread(clock_, {}, [](std::uint64_t) {});
  thread.start();
  clock_->waitUntilAsleep();
  advance(microseconds(999));
  EXPECT_EQ(thread.ticks(), 0U);
  advance(microseconds(1));
  EXPECT_EQ(thread.ticks(), 1U);
}

//  due    1   2   3   4   5   6 ms
//  runs   |           .7      |        the thread did not run for nearly three periods:
//  late                ^ one late tick, then the grid again
TEST_F(CyclicThreadTest, CountsALateTickAndSkipsMissedPeriods) {
  CyclicThread thread(clock_, {}, [](std::uint64_t) {});
  thread.start();
  clock_->waitUntilAsleep();
  advance(milliseconds(1));
  advance(microseconds(3700));  // the tick due at 2 starts at 4.7
  EXPECT_EQ(thread.ticks(), 2U);
  EXPECT_EQ(thread.lateTicks(), 1U);
  EXPECT_EQ(thread.worstDelay(), microseconds(2700));
  advance(microseconds(300));  // 5.0
  EXPECT_EQ(thread.ticks(), 3U);
  EXPECT_EQ(thread.lateTicks(), 1U);
}

TEST_F(CyclicThreadTest, ATickLongerThanItsPeriodMakesTheNextOneLate) {
  CyclicThread thread(clock_, {}, [this](std::uint64_t tick) {
    if (tick == 0) clock_->advance(microseconds(2500));
  });
  thread.start();
  clock_->waitUntilAsleep();
  advance(milliseconds(1));
  EXPECT_EQ(thread.ticks(), 2U);
  EXPECT_EQ(thread.lateTicks(), 1U);
}

TEST_F(CyclicThreadTest, ReportsWhatWasNotGrantedAndRuns) {
  CyclicOptions options;
  options.name = "haptic";
  options.cpu = 1000;
  CyclicThread thread(clock_, options, [](std::uint64_t) {});
  thread.start();
  clock_->waitUntilAsleep();
  advance(milliseconds(1));
  EXPECT_EQ(thread.ticks(), 1U);
  EXPECT_NE(thread.notGranted().find("thread 'haptic' runs without CPU 1000"), std::string::npos)
      << thread.notGranted();
}

TEST_F(CyclicThreadTest, StopsWhileAsleepAndCanBeStoppedTwice) {
  CyclicThread thread(clock_, {}, [](std::uint64_t) {});
  thread.start();
  clock_->waitUntilAsleep();
  thread.stop();
  thread.stop();
  EXPECT_EQ(thread.ticks(), 0U);
}

TEST(CyclicThreadOnTheSteadyClock, Ticks) {
  CyclicThread thread(std::make_shared<SteadyClock>(), {}, [](std::uint64_t) {});
  thread.start();
  while (thread.ticks() < 5) std::this_thread::yield();
  thread.stop();
}

}  // namespace
}  // namespace tenon::threads
