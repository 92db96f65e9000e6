#include "idl/threads/spsc_queue.h"

#include <array>
#include <thread>

#include <gtest/gtest.h>

#include "tests/support/realtime_guard.h"

namespace tenon::threads {
namespace {

TEST(SpscQueue, GivesElementsInOrder) {
  SpscQueue<int> queue(4);
  int out = 0;
  EXPECT_FALSE(queue.pop(out));
  EXPECT_TRUE(queue.push(1));
  EXPECT_TRUE(queue.push(2));
  EXPECT_EQ(queue.size(), 2U);
  EXPECT_TRUE(queue.pop(out));
  EXPECT_EQ(out, 1);
  EXPECT_TRUE(queue.pop(out));
  EXPECT_EQ(out, 2);
  EXPECT_FALSE(queue.pop(out));
}

TEST(SpscQueue, DropsAndCountsTheNewElementWhenFull) {
  SpscQueue<int> queue(2);
  EXPECT_TRUE(queue.push(1));
  EXPECT_TRUE(queue.push(2));
  EXPECT_FALSE(queue.push(3));
  EXPECT_EQ(queue.beginPush(), nullptr);
  EXPECT_EQ(queue.dropped(), 2U);
  ASSERT_NE(queue.front(), nullptr);
  EXPECT_EQ(*queue.front(), 1);
  queue.pop();
  EXPECT_TRUE(queue.push(4));
  EXPECT_EQ(queue.dropped(), 2U);
}

TEST(SpscQueue, UsesItsSlotsInPlace) {
  SpscQueue<std::array<int, 1000>> queue(3);
  auto* slot = queue.beginPush();
  ASSERT_NE(slot, nullptr);
  EXPECT_EQ(queue.front(), nullptr) << "not visible before commitPush";
  (*slot)[999] = 42;
  queue.commitPush();
  EXPECT_EQ(queue.front(), slot);
  EXPECT_EQ((*queue.front())[999], 42);
}

/// The values 1 to `last` from one thread to another.
void sendBetweenTwoThreads(int last) {
  SpscQueue<int> queue(16);
  std::thread producer([&queue, last] {
    for (int value = 1; value <= last;) {
      if (queue.push(value)) {
        ++value;
      } else {
        std::this_thread::yield();
      }
    }
  });
  int out = 0;
  for (int expected = 1; expected <= last;) {
    if (!queue.pop(out)) {
      std::this_thread::yield();
      continue;
    }
    EXPECT_EQ(out, expected);
    expected = out + 1;
  }
  producer.join();
  EXPECT_EQ(queue.size(), 0U);
}

TEST(SpscQueue, LosesNothingBetweenTwoThreads) { sendBetweenTwoThreads(10'000); }
TEST(SpscQueueNightly, LosesNothingBetweenTwoThreads) { sendBetweenTwoThreads(200'000); }

TEST(SpscQueue, AllocatesNothingAndLocksNothing) {
  SpscQueue<std::array<double, 100>> queue(8);
  const test::RealtimeGuard guard;
  for (int i = 0; i < 1000; ++i) {
    if (auto* slot = queue.beginPush(); slot != nullptr) {
      (*slot)[0] = i;
      queue.commitPush();
    }
    if (queue.front() != nullptr && i % 2 == 0) queue.pop();
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::threads
