#include "tests/support/realtime_guard.h"

#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::test {
namespace {

class RealtimeGuardTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!RealtimeGuard::available()) GTEST_SKIP() << "sanitizers replace the functions that the guard counts";
  }
};

TEST_F(RealtimeGuardTest, CountsNothingInPlainArithmetic) {
  const RealtimeGuard guard;
  volatile double x = 1.0;
  for (int i = 0; i < 100; ++i) x = x * 1.5;
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

TEST_F(RealtimeGuardTest, CountsNewAndDelete) {
  const RealtimeGuard guard;
  {
    const std::vector<int> values(1000, 7);
    EXPECT_EQ(values.back(), 7);
  }
  EXPECT_EQ(guard.allocations(), 2);
}

TEST_F(RealtimeGuardTest, CountsALock) {
  std::mutex mutex;
  const RealtimeGuard guard;
  { const std::lock_guard<std::mutex> lock(mutex); }
  EXPECT_EQ(guard.locks(), 1);
}

TEST_F(RealtimeGuardTest, DoesNotCountOtherThreads) {
  std::mutex mutex;
  std::thread other;
  const RealtimeGuard before;
  other = std::thread([&mutex] {
    for (int i = 0; i < 1000; ++i) {
      const std::lock_guard<std::mutex> lock(mutex);
      std::make_unique<int>(i).reset();
    }
  });
  other.join();
  EXPECT_LT(before.allocations(), 100);
  EXPECT_LT(before.locks(), 100);
}

}  // namespace
}  // namespace tenon::test
