#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  for (int kind = 0; kind <= static_cast<int>(StationEventKind::kArmed); ++kind)
    EXPECT_THAT(describe({.kind = static_cast<StationEventKind>(kind), .detail = 1}, "left"),
                testing::Not(HasSubstr("unknown event")))
        << kind;
}

}  // namespace
}  // namespace tenon::haptic
