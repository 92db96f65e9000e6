#include "idl/threads/latest.h"

#include <array>
#include <atomic>
#include <thread>

#include <gtest/gtest.h>

#include "tests/support/realtime_guard.h"

namespace tenon::threads {
namespace {

TEST(Latest, HasNoUpdateBeforeAWrite) {
  Latest<int> latest(7);
  EXPECT_FALSE(latest.update());
  EXPECT_EQ(latest.read(), 7);
}

TEST(Latest, GivesTheNewestValueOnly) {
  Latest<int> latest;
  for (int value = 1; value <= 5; ++value) latest.write(value);
  EXPECT_TRUE(latest.update());
  EXPECT_EQ(latest.value(), 5);
  EXPECT_FALSE(latest.update());
  EXPECT_EQ(latest.value(), 5);
}

TEST(Latest, KeepsTheReadersValueDuringWrites) {
  Latest<int> latest;
  latest.write(1);
  const int& seen = latest.read();
  for (int value = 2; value <= 9; ++value) latest.write(value);
  EXPECT_EQ(seen, 1);
  EXPECT_EQ(latest.read(), 9);
}

void expectWholeAndEverNewerValues(int updates) {
  using Block = std::array<int, 64>;
  Latest<Block> latest;
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (int value = 1; !done; ++value) {
      latest.back().fill(value);
      latest.publish();
    }
  });
  int newest = 0;
  for (int seen = 0; seen < updates;) {
    if (!latest.update()) {
      std::this_thread::yield();
      continue;
    }
    const Block& block = latest.value();
    for (const int value : block) EXPECT_EQ(value, block[0]);
    EXPECT_GT(block[0], newest);
    newest = block[0];
    ++seen;
  }
  done = true;
  writer.join();
}

TEST(Latest, ValuesAreNeverTornAndNeverOlderThanBefore) { expectWholeAndEverNewerValues(100); }
TEST(LatestNightly, ValuesAreNeverTornAndNeverOlderThanBefore) { expectWholeAndEverNewerValues(10'000); }

TEST(Latest, AllocatesNothingAndLocksNothing) {
  Latest<std::array<double, 100>> latest;
  const test::RealtimeGuard guard;
  for (int i = 0; i < 1000; ++i) {
    latest.back()[0] = i;
    latest.publish();
    latest.update();
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::threads
