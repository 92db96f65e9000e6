#include "server/session/loss_log.h"

#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tenon::session {
namespace {

using std::chrono::milliseconds;

TEST(LossLogTest, TheFirstLossIsSaidAtOnceAndThoseThatFollowOnceASecond) {
  LossLog log("in the journal");
  const LossLog::Time begin{std::chrono::hours(1)};
  EXPECT_FALSE(log.update(0, begin));
  std::vector<std::string> said;
  // a tick is lost each millisecond
  for (std::uint64_t lost = 1; lost <= 2500; ++lost)
    if (const auto line = log.update(lost, begin + milliseconds(lost))) said.push_back(*line);
  EXPECT_THAT(said, testing::ElementsAre("1 tick is missing in the journal",
                                         "1000 more ticks are missing in the journal, 1001 in all",
                                         "1000 more ticks are missing in the journal, 2001 in all"));
  EXPECT_EQ(log.update(2500, begin + milliseconds(2501), true),
            "499 more ticks are missing in the journal, 2500 in all");
  EXPECT_FALSE(log.update(2500, begin + std::chrono::minutes(1), true)) << "nothing is left unsaid";
}

TEST(LossLogTest, OneMoreTickIsSaidInTheSingular) {
  LossLog log("in recordings");
  const LossLog::Time begin{std::chrono::hours(1)};
  EXPECT_EQ(log.update(2, begin), "2 ticks are missing in recordings");
  EXPECT_FALSE(log.update(3, begin + milliseconds(999)));
  EXPECT_EQ(log.update(3, begin + LossLog::kPeriod), "1 more tick is missing in recordings, 3 in all");
}

}  // namespace
}  // namespace tenon::session
