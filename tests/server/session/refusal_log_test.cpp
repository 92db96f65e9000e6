#include "server/session/refusal_log.h"

#include <set>
#include <string>

#include <gtest/gtest.h>

namespace tenon::session {
namespace {

TEST(RefusalLogTest, EachTextIsSaidOnce) {
  RefusalLog log;
  const RefusalLog::Time begin{std::chrono::hours(1)};
  EXPECT_EQ(log.add("a", begin), "a");
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(log.add("a", begin + i * RefusalLog::kPeriod));
  EXPECT_EQ(log.add("b", begin), "b");
  EXPECT_FALSE(log.step(begin + 2000 * RefusalLog::kPeriod)) << "nothing is left unsaid";
}

TEST(RefusalLogTest, NewTextsAreSaidAtABoundedRateHoweverManyThereWereAndTheOthersAreCounted) {
  RefusalLog log;
  const RefusalLog::Time begin{std::chrono::hours(1)};
  std::size_t said = 0;
  for (int i = 0; i < 1000; ++i) said += log.add("client " + std::to_string(i), begin) ? 1 : 0;
  EXPECT_EQ(said, RefusalLog::kAtOnce);
  EXPECT_FALSE(log.step(begin)) << "once a period";
  EXPECT_EQ(log.step(begin + RefusalLog::kPeriod), "980 more refusals, the last one: client 999");
  EXPECT_FALSE(log.step(begin + 2 * RefusalLog::kPeriod)) << "counted anew";
  EXPECT_EQ(log.add("another", begin + 2 * RefusalLog::kPeriod), "another");
}

TEST(RefusalLogTest, ATextThatWasForgottenIsNewAgainAndOneThatIsRepeatedIsNotForgotten) {
  RefusalLog log;
  RefusalLog::Time now{std::chrono::hours(1)};
  ASSERT_TRUE(log.add("rare", now));
  ASSERT_TRUE(log.add("often", now));
  for (std::size_t i = 0; i < 2 * RefusalLog::kKnown; ++i) {
    now += RefusalLog::kPeriod;
    ASSERT_TRUE(log.add(std::to_string(i), now));
    ASSERT_FALSE(log.add("often", now));
  }
  EXPECT_EQ(log.add("rare", now), "rare");
}

}  // namespace
}  // namespace tenon::session
