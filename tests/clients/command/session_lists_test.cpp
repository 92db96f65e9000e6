#include "clients/command/session_lists.h"

#include <atomic>
#include <chrono>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/clients/fake_session.h"

namespace tenon::command {
namespace {

using std::chrono::milliseconds;

class SessionListsTest : public ::testing::Test {
 protected:
  Result<SessionLists> readAll() {
    auto reading =
        std::async(std::launch::async, [this] { return readLists({.domain = test::ownDomain()}, stop_); });
    while (reading.wait_for(milliseconds(0)) != std::future_status::ready) {
      server_.serve(milliseconds(20));
      if (!server_.joined() || !late_hand_) continue;
      server_.serve(milliseconds(800));  // a silence in which the lists could pass for complete
      server_.sendHand(1);
      late_hand_ = false;
    }
    return reading.get();
  }

  test::FakeSession server_{test::ownDomain(), {.objects = 1, .hands = 2}};
  std::atomic<bool> stop_ = false;
  bool late_hand_ = false;
};

TEST_F(SessionListsTest, AreCompleteByCountHoweverLateAHandComes) {
  server_.sendObject(0);
  server_.sendHand(0);
  server_.sendStep();
  late_hand_ = true;
  const auto lists = readAll();
  ASSERT_TRUE(lists) << lists.error().what;
  EXPECT_EQ(lists->hands.size(), 2U);
}

TEST_F(SessionListsTest, NameWhatIsMissing) {
  server_.sendObject(0);
  server_.sendHand(0);
  const auto lists = readAll();
  ASSERT_FALSE(lists);
  EXPECT_THAT(lists.error().what, ::testing::HasSubstr("missing: 1 of 2 hands"));
}

}  // namespace
}  // namespace tenon::command
