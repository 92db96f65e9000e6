#include "clients/console/channel_store.h"

#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tenon::console {
namespace {

constexpr std::uint64_t kDevice = 1, kAhead = 2, kStep = 3;

class ChannelStoreTest : public testing::Test {
 protected:
  void tell(std::uint64_t kind, std::uint8_t content) {
    store_.keep({1, kind, content, std::make_shared<const std::vector<std::uint8_t>>(1, content)});
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

}  // namespace
}  // namespace tenon::console
