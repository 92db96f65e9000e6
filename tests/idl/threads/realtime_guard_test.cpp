#include "tests/support/realtime_guard.h"

#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::test {
namespace {

TEST(RealtimeGuard, CountsNothingInPlainArithmetic) {
  const RealtimeGuard guard;
  volatile double x = 1.0;
  for (int i = 0; i < 100; ++i) x = x * 1.5;
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

TEST(RealtimeGuard, CountsNewAndDelete) {
  const RealtimeGuard guard;
  {
    const std::vector<int> values(1000, 7);
    EXPECT_EQ(values.back(), 7);
  }
  EXPECT_EQ(guard.allocations(), 2);
}

TEST(RealtimeGuard, CountsALock) {
  std::mutex mutex;
  const RealtimeGuard guard;
  { const std::lock_guard<std::mutex> lock(mutex); }
  EXPECT_EQ(guard.locks(), 1);
}

// The other thread allocates and locks 1000 times; starting it allocates here.
TEST(RealtimeGuard, CountsOtherThreadsOnlyWhenAskedTo) {
  std::mutex mutex;
  const RealtimeGuard own;
  const RealtimeGuard all(CountedThreads::kAll);
  std::thread other([&mutex] {
    std::atomic<int*> value{nullptr};  // so that no allocation is optimised away
    for (int i = 0; i < 1000; ++i) {
      const std::lock_guard<std::mutex> lock(mutex);
      value = new int(i);
      delete value.exchange(nullptr);
    }
  });
  other.join();
  EXPECT_LT(own.allocations(), 100);
  EXPECT_LT(own.locks(), 100);
  EXPECT_GE(all.allocations(), 2000);
  EXPECT_GE(all.locks(), 1000);
}

}  // namespace
}  // namespace tenon::test
