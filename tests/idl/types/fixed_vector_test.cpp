#include "idl/types/fixed_vector.h"

#include <numeric>

#include <gtest/gtest.h>

#include "tests/support/realtime_guard.h"

namespace tenon {
namespace {

TEST(FixedVector, TakesAsManyValuesAsItsCapacity) {
  FixedVector<int, 3> list;
  EXPECT_TRUE(list.empty());
  for (int value = 1; value <= 3; ++value) EXPECT_TRUE(list.push_back(value));
  EXPECT_TRUE(list.full());
  EXPECT_FALSE(list.push_back(4));
  EXPECT_EQ(list.size(), 3U);
  EXPECT_EQ(list.back(), 3);
  EXPECT_EQ(std::accumulate(list.begin(), list.end(), 0), 6);
}

TEST(FixedVector, IsEmptyAfterClear) {
  FixedVector<int, 3> list;
  list.push_back(1);
  list.clear();
  EXPECT_EQ(list.begin(), list.end());
  EXPECT_TRUE(list.push_back(2));
  EXPECT_EQ(list[0], 2);
}

TEST(FixedVector, NeverAllocates) {
  FixedVector<double, 100> list;
  const test::RealtimeGuard guard;
  for (int i = 0; i < 200; ++i) list.push_back(i);
  EXPECT_EQ(guard.allocations(), 0);
}

}  // namespace
}  // namespace tenon
