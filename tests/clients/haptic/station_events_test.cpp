#include <algorithm>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/haptic/repeated_events.h"
#include "clients/haptic/station.h"
#include "devices/safety_rules.h"

namespace tenon::haptic {
namespace {

using ::testing::HasSubstr;

TEST(StationEvent, DescribesASafetyIntervention) {
  const StationEvent began{.seq = 12,
                           .kind = StationEventKind::kSafetyBegan,
                           .hand = HandId{0},
                           .detail = devices::bit(devices::SafetyRule::kForceLimited),
                           .value = 61.25,
                           .count = 3};
  EXPECT_EQ(describe(began, "right"),
            "hand right: safety: force limited (61.2 N requested, 3 earlier not reported), step 12");
  StationEvent ended = began;
  ended.kind = StationEventKind::kSafetyEnded;
  ended.value = 0.4;
  EXPECT_EQ(describe(ended, "right"), "hand right: safety: force limited ended, active for 0.40 s, step 12");
}

TEST(StationEvent, EveryKindHasAText) {
  for (int kind = 0; kind <= static_cast<int>(StationEventKind::kContactsAgain); ++kind)
    EXPECT_THAT(describe({.kind = static_cast<StationEventKind>(kind), .detail = 1}, "left"),
                testing::Not(HasSubstr("unknown event")))
        << kind;
}

TEST(StationEvent, SaysHowManyTimesAWarningCameInOneEvent) {
  EXPECT_EQ(
      describe({.seq = 12, .kind = StationEventKind::kBeyondValidity, .value = 40.0, .count = 28}, "left"),
      "hand left: ahead of the contact set (40 ms in total), 28 times, step 12");
  EXPECT_EQ(
      describe({.seq = 12, .kind = StationEventKind::kBeyondValidity, .value = 40.0, .count = 1}, "left"),
      "hand left: ahead of the contact set (40 ms in total), step 12");
}

//  a warning every 20 ms for 10 s: the first at once, then one a second with the number of times
TEST(RepeatedEvents, PassOnceASecondWithTheNumberOfTimes) {
  RepeatedEvents events;
  std::vector<StationEvent> sent;
  std::uint32_t told = 0;
  for (std::uint32_t seq = 1; seq <= 10'000; ++seq) {
    const StationEvent event{.seq = seq, .kind = StationEventKind::kBeyondValidity, .hand = HandId{0}};
    if (seq % 20 == 0 && events.passes(event)) sent.push_back(event);
    while (const auto waiting = events.takeDue(seq)) sent.push_back(*waiting);
  }
  while (const auto waiting = events.takeWaiting()) sent.push_back(*waiting);
  for (const StationEvent& event : sent) told += std::max(1U, event.count);
  EXPECT_EQ(sent.size(), 11U);
  EXPECT_EQ(told, 500U) << "all are counted";
  EXPECT_EQ(sent.front().seq, 20U) << "the first one is not kept waiting";
}

TEST(RepeatedEvents, KeepNeitherAnotherHandNorAnotherKindWaiting) {
  RepeatedEvents events;
  const StationEvent stale{.seq = 5, .kind = StationEventKind::kStale, .hand = HandId{0}};
  EXPECT_TRUE(events.passes(stale));
  EXPECT_FALSE(events.passes(stale));
  StationEvent other = stale;
  other.hand = HandId{1};
  EXPECT_TRUE(events.passes(other));
  other = stale;
  other.kind = StationEventKind::kBeyondValidity;
  EXPECT_TRUE(events.passes(other));
  EXPECT_FALSE(events.takeDue(4)) << "of a step before the event";
  EXPECT_FALSE(events.takeDue(1004));
  EXPECT_EQ(events.takeDue(1005)->kind, StationEventKind::kStale);
  EXPECT_FALSE(events.takeDue(1005));
}

TEST(RepeatedEvents, WhatIsNoWarningAlwaysPasses) {
  RepeatedEvents events;
  for (const auto kind :
       {StationEventKind::kStopChanged, StationEventKind::kArmed, StationEventKind::kDeviceFault,
        StationEventKind::kSafetyBegan, StationEventKind::kGuidanceEnded})
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(events.passes({.seq = 1, .kind = kind}));
}

TEST(FarHands, ALinkIsToldAsTooLongOnceForAllHandsOfAStation) {
  FarHands hands;
  const auto passes = [&](StationEventKind kind, std::uint32_t hand) {
    return hands.passes({.kind = kind, .hand = HandId{hand}});
  };
  EXPECT_FALSE(hands.any());
  EXPECT_TRUE(passes(StationEventKind::kGuidanceAlone, 0));
  EXPECT_FALSE(passes(StationEventKind::kGuidanceAlone, 1));
  EXPECT_TRUE(passes(StationEventKind::kStale, 1));
  EXPECT_FALSE(passes(StationEventKind::kContactsAgain, 0));
  EXPECT_TRUE(hands.any());
  EXPECT_TRUE(passes(StationEventKind::kContactsAgain, 1));
  EXPECT_FALSE(hands.any());
  EXPECT_TRUE(passes(StationEventKind::kGuidanceAlone, 1)) << "again";
}

TEST(StationEvent, SaysThatALinkIsTooLongForContactsAndHowLongItMayBe) {
  EXPECT_EQ(
      describe({.seq = 7, .kind = StationEventKind::kGuidanceAlone, .value = 165.2}, "left"),
      "contacts are not felt over this link: 165 ms one way, 150 ms at most; guidance continues, step 7");
}

}  // namespace
}  // namespace tenon::haptic
