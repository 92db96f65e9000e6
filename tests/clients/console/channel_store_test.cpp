#include "clients/console/channel_store.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tenon::console {
namespace {

constexpr std::uint64_t kDevice = 1, kAhead = 2, kStep = 3;

class ChannelStoreTest : public testing::Test {
 protected:
  void tell(std::uint64_t kind, std::uint8_t content, std::uint64_t writer = 0) {
    store_.keep({1, kind, content, payload(content), writer});
  }
  static Payload payload(std::uint8_t content) {
    return std::make_shared<const std::vector<std::uint8_t>>(1, content);
  }
  std::vector<int> kept() const {
    std::vector<int> contents;
    store_.forEachKept(1, [&](const Publication& event) { contents.push_back(event.payload->front()); });
    return contents;
  }

  ChannelStore store_{{{.id = 1, .topic = "ClientEvent", .delivery = Delivery::kEach}}};
};

TEST_F(ChannelStoreTest, AWarningThatRepeatsForgetsNoEventThatWasToldOnce) {
  tell(kDevice, 10);
  tell(kAhead, 20);
  tell(kDevice, 11);
  for (std::size_t i = 0; i < 2 * ChannelStore::kMaxEvents; ++i) {
    if (i == ChannelStore::kMaxEvents) tell(kStep, 30);
    tell(kAhead, 21);
  }
  const auto events = kept();
  ASSERT_EQ(events.size(), ChannelStore::kMaxEvents);
  EXPECT_EQ(events[0], 10);
  EXPECT_EQ(events[1], 11) << "of those that repeat the oldest go first";
  EXPECT_THAT(events, testing::Contains(30));
  EXPECT_EQ(events.back(), 21);
}

TEST_F(ChannelStoreTest, OfOneKindTheLastOnesAreKeptInTheirOrder) {
  for (std::size_t i = 0; i < ChannelStore::kMaxEvents + 3; ++i) tell(kAhead, i < 5 ? i : 9);
  EXPECT_EQ((std::vector<int>{kept()[0], kept()[1], kept()[2]}), (std::vector<int>{3, 4, 9}));
  store_.clear();
  EXPECT_TRUE(kept().empty());
}

TEST_F(ChannelStoreTest, AWriterThatMakesUpKindsForgetsItsOwnEvents) {
  constexpr std::uint64_t kStation = 7, kFlood = 8;
  tell(kDevice, 10, kStation);
  for (std::uint64_t i = 0; i < 3 * ChannelStore::kMaxEvents; ++i) tell(100 + i, 20, kFlood);
  tell(kDevice, 11, kStation);
  const auto events = kept();
  ASSERT_EQ(events.size(), ChannelStore::kMaxEvents);
  EXPECT_EQ(events.front(), 10);
  EXPECT_EQ(events.back(), 11);
}

//  a program names 5,000 people; one who was there before and one who comes later are still known
TEST(ChannelStore, AWriterThatFloodsItWithInstancesForgetsItsOwnOldestOnes) {
  ChannelStore store({{.id = 1, .topic = "Presence", .delivery = Delivery::kNewest}});
  constexpr std::uint64_t kEarly = 1, kLate = 2, kFlood = 8, kMany = 5000;
  const auto put = [&](std::uint64_t instance, std::uint64_t writer) {
    store.keep({1, instance, 0, std::make_shared<const std::vector<std::uint8_t>>(1), writer});
  };
  put(kEarly, 1);
  for (std::uint64_t i = 0; i < kMany; ++i) put(100 + i, kFlood);
  put(kLate, 2);
  std::vector<std::uint64_t> kept;
  store.forEachKept(1, [&](const Publication& newest) { kept.push_back(newest.instance); });
  EXPECT_EQ(kept.size(), ChannelStore::kMaxInstances);
  EXPECT_THAT(store.toTell(),
              testing::ElementsAre(testing::HasSubstr("of Presence 4000 instances are kept")));
  EXPECT_THAT(kept, testing::IsSupersetOf({kEarly, kLate, 99 + kMany}));
  EXPECT_THAT(kept, testing::Not(testing::Contains(100))) << "the oldest of the flood";
}

TEST_F(ChannelStoreTest, WhatIsForgottenIsToldAtFirstAndWheneverItIsTwiceAsMuch) {
  for (std::size_t i = 0; i < ChannelStore::kMaxEvents; ++i) tell(kAhead, 1);
  EXPECT_THAT(store_.toTell(), testing::IsEmpty());
  std::vector<std::string> told;
  for (int i = 0; i < 100; ++i) {
    tell(kAhead, 1);
    for (std::string& sentence : store_.toTell()) told.push_back(std::move(sentence));
  }
  ASSERT_EQ(told.size(), 7U) << "1, 2, 4 ... 64";
  EXPECT_EQ(told[1],
            "of ClientEvent 1000 events are kept for pages that are opened later; forgotten so far: 2");
}

TEST(ChannelStore, AnInstanceThatEndsIsForgottenAndMayComeBackFromAnother) {
  ChannelStore store({{.id = 1, .topic = "Presence", .delivery = Delivery::kNewest}});
  const auto payload = std::make_shared<const std::vector<std::uint8_t>>(1);
  for (const std::uint64_t writer : {1U, 2U}) {
    store.keep({1, 5, 0, payload, writer});
    int kept = 0;
    store.forEachKept(1, [&](const Publication&) { ++kept; });
    EXPECT_EQ(kept, 1);
    if (writer == 1) store.keep({1, 5, 0, nullptr, writer});
  }
}

}  // namespace
}  // namespace tenon::console
