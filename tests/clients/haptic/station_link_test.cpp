#include "clients/haptic/station_link.h"

#include <atomic>
#include <chrono>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/clients/fake_session.h"

namespace tenon::haptic {
namespace {

using std::chrono::milliseconds;

class StationLinkTest : public ::testing::Test {
 protected:
  std::future<Result<std::unique_ptr<StationLink>>> open(std::chrono::seconds timeout) {
    return std::async(std::launch::async, [this, timeout] {
      return StationLink::open(
          {.domain = test::ownDomain(), .person = "Ada", .role = Role::kTrainee, .timeout = timeout}, stop_);
    });
  }

  test::FakeSession server_{test::ownDomain(), {.objects = 3}};
  std::atomic<bool> stop_ = false;
};

TEST_F(StationLinkTest, HasTheWholeSceneHoweverLateAnObjectComesAndHearsWhileItWaits) {
  auto opening = open(std::chrono::seconds(60));
  for (const std::uint32_t object : {2U, 0U}) server_.sendObject(object);
  while (!server_.joined()) server_.serve(milliseconds(20));
  server_.serve(milliseconds(800));  // a silence in which a scene could pass for complete
  server_.sendObject(1);
  while (opening.wait_for(milliseconds(0)) != std::future_status::ready) server_.serve(milliseconds(20));
  auto link = opening.get();
  ASSERT_TRUE(link) << link.error().what;
  ASSERT_EQ((*link)->objects().size(), 3U);
  for (std::uint32_t i = 0; i < 3; ++i) EXPECT_EQ((*link)->objects()[i].object, ObjectId{i});

  // its inputs find no reader: it waits, and what it hears meanwhile is handled
  int heard = 0;
  EXPECT_FALSE((*link)->awaitMatch(stop_, [&] { stop_ = ++heard == 3; }));
  EXPECT_EQ(heard, 3);
}

TEST_F(StationLinkTest, NamesTheObjectsThatNeverCame) {
  auto opening = open(std::chrono::seconds(2));
  server_.sendObject(1);
  while (opening.wait_for(milliseconds(0)) != std::future_status::ready) server_.serve(milliseconds(20));
  const auto link = opening.get();
  ASSERT_FALSE(link);
  EXPECT_THAT(link.error().what, ::testing::HasSubstr("of the 3 objects"));
  EXPECT_THAT(link.error().what, ::testing::HasSubstr("missing: 0, 2:"));
}

}  // namespace
}  // namespace tenon::haptic
