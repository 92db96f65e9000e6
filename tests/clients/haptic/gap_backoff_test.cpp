#include "clients/haptic/gap_backoff.h"

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr double kTick = 1e-3;  // [s]

/// [s] of fresh contacts until they are rendered, after a gap; then they stay fresh for `seconds` in all.
double waitAfterGap(GapBackoff& backoff, double seconds) {
  (void)backoff.step(false, kTick);
  double waited = -1.0;
  for (int i = 1; i <= static_cast<int>(seconds / kTick + 0.5); ++i)
    if (backoff.step(true, kTick) && waited < 0.0) waited = (i - 1) * kTick;
  return waited;
}

TEST(GapBackoff, AFirstGapEndsWithTheFirstFreshContacts) {
  GapBackoff backoff;
  for (int gap = 0; gap < 3; ++gap) EXPECT_EQ(waitAfterGap(backoff, 1.1), 0.0);
}

TEST(GapBackoff, GapsInQuickSuccessionWaitForTwiceAsLongEach) {
  GapBackoff backoff;
  EXPECT_EQ(waitAfterGap(backoff, 0.9), 0.0);
  for (const double expected : {0.1, 0.2, 0.4, 0.8, 0.8})
    EXPECT_NEAR(waitAfterGap(backoff, 0.9), expected, 1.5 * kTick);
  EXPECT_NEAR(waitAfterGap(backoff, 1.1), 0.8, 1.5 * kTick);
  EXPECT_EQ(waitAfterGap(backoff, 0.9), 0.0) << "after a second without one";
}

TEST(GapBackoff, AGapWithinTheWaitBeginsItAnew) {
  GapBackoff backoff;
  EXPECT_EQ(waitAfterGap(backoff, 0.05), 0.0);
  EXPECT_EQ(waitAfterGap(backoff, 0.05), -1.0);
  EXPECT_EQ(waitAfterGap(backoff, 0.05), -1.0);
  EXPECT_EQ(waitAfterGap(backoff, 0.39), -1.0);
}

}  // namespace
}  // namespace tenon::haptic
