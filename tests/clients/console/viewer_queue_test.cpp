#include "clients/console/viewer_queue.h"

#include <memory>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::console {
namespace {

constexpr SubscriptionId kPoses = 7;
constexpr SubscriptionId kLog = 8;

Publication message(std::uint64_t instance, std::uint8_t content) {
  return {1, instance, content, std::make_shared<const std::vector<std::uint8_t>>(1, content)};
}

/// The contents of all messages that wait, in the order in which they are sent.
std::vector<int> contents(ViewerQueue& queue) {
  std::vector<int> list;
  while (const auto item = queue.take())
    list.push_back(item->payload == nullptr ? -1 : item->payload->front());
  return list;
}

TEST(ViewerQueue, OfEachInstanceTheNewestMessageWaits) {
  ViewerQueue queue;
  for (std::uint8_t i = 0; i < 100; ++i) queue.add(kPoses, Delivery::kNewest, message(i % 3, i));
  EXPECT_EQ(queue.size(), 3U);
  EXPECT_EQ(queue.skipped(), 97U);
  EXPECT_EQ(contents(queue), (std::vector<int>{99, 97, 98}));  // instances 0, 1, 2: their turns stay
}

TEST(ViewerQueue, AnInstanceThatChangesAllTheTimeDoesNotKeepOthersFromTheirTurn) {
  ViewerQueue queue;
  queue.add(kPoses, Delivery::kNewest, message(1, 10));
  queue.add(kPoses, Delivery::kNewest, message(2, 20));
  ASSERT_EQ(queue.take()->payload->front(), 10);
  queue.add(kPoses, Delivery::kNewest, message(1, 11));
  EXPECT_EQ(contents(queue), (std::vector<int>{20, 11}));
}

TEST(ViewerQueue, EventsWaitOneByOneAndTheOldestAreDropped) {
  ViewerQueue queue;
  queue.add(kPoses, Delivery::kNewest, message(1, 200));
  const std::size_t count = ViewerQueue::kMaxEvents + 5;
  for (std::size_t i = 0; i < count; ++i)
    queue.add(kLog, Delivery::kEach, message(0, static_cast<std::uint8_t>(i % 100)));
  EXPECT_EQ(queue.size(), ViewerQueue::kMaxEvents + 1);
  EXPECT_EQ(queue.skipped(), 5U);
  const auto left = contents(queue);
  ASSERT_EQ(left.size(), ViewerQueue::kMaxEvents + 1);
  EXPECT_EQ(left[0], 200) << "events do not drop the newest pose";
  EXPECT_EQ(left[1], 5);
  EXPECT_EQ(left.back(), static_cast<int>((count - 1) % 100));
}

TEST(ViewerQueue, WhateverArrivesItIsBounded) {
  ViewerQueue queue;
  for (std::uint64_t i = 0; i < 5 * ViewerQueue::kMaxMessages; ++i)
    queue.add(kPoses, Delivery::kNewest, message(i, 0));
  EXPECT_EQ(queue.size(), ViewerQueue::kMaxMessages);
}

TEST(ViewerQueue, MessagesShareTheirPayload) {
  ViewerQueue first, second;
  const Publication publication = message(1, 5);
  first.add(kPoses, Delivery::kNewest, publication);
  second.add(kPoses, Delivery::kNewest, publication);
  EXPECT_EQ(publication.payload.use_count(), 3);
  EXPECT_EQ(first.take()->payload.get(), second.take()->payload.get());
}

TEST(ViewerQueue, TextsComeFirstAndTooManyOverflow) {
  ViewerQueue queue;
  queue.add(kPoses, Delivery::kNewest, message(1, 10));
  queue.addText("status");
  EXPECT_EQ(queue.take()->text, "status");
  EXPECT_EQ(contents(queue), (std::vector<int>{10}));
  for (std::size_t i = 0; i < ViewerQueue::kMaxTexts; ++i) queue.addText("again");
  EXPECT_FALSE(queue.hasOverflowed());
  queue.addText("one too many");
  EXPECT_TRUE(queue.hasOverflowed());
  EXPECT_EQ(queue.size(), ViewerQueue::kMaxTexts);
}

TEST(ViewerQueue, NothingWaitsOfASubscriptionThatWasRemoved) {
  ViewerQueue queue;
  queue.add(kPoses, Delivery::kNewest, message(1, 10));
  queue.add(kLog, Delivery::kEach, message(0, 20));
  queue.add(kPoses, Delivery::kNewest, message(2, 11));
  queue.remove(kPoses);
  EXPECT_EQ(contents(queue), (std::vector<int>{20}));
  queue.remove(kLog);
}

TEST(ViewerQueue, AMessageNamesItsSubscriptionAndItsTime) {
  ViewerQueue queue;
  Publication publication = message(1, 5);
  publication.time_ns = 0x0102030405060708;
  queue.add(0x0A0B0C0D, Delivery::kNewest, publication);
  const MessageHeader expected{1, 0x0D, 0x0C, 0x0B, 0x0A, 8, 7, 6, 5, 4, 3, 2, 1};
  EXPECT_EQ(queue.take()->header, expected);
}

}  // namespace
}  // namespace tenon::console
