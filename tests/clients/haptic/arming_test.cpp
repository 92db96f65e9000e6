#include "clients/haptic/arming.h"

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

TEST(Arming, NothingButThePersonArms) {
  Arming arming;
  EXPECT_FALSE(arming.permitsForces()) << "at the start";
  arming.receive({.raised = 0, .engaged = false});
  EXPECT_FALSE(arming.permitsForces()) << "nobody has pressed";
  arming.receive({.raised = 1, .engaged = true});
  arming.receive({.raised = 1, .engaged = false});
  EXPECT_FALSE(arming.release());
  EXPECT_FALSE(arming.permitsForces());
  arming.press();
  EXPECT_TRUE(arming.release());
  EXPECT_TRUE(arming.permitsForces());
  EXPECT_FALSE(arming.awaitsPress());
}

// a: the raise is cleared, b: the person presses
TEST(Arming, AStopEndsWhenItIsClearedAndThePersonHasPressedInEitherOrder) {
  for (const bool cleared_first : {false, true}) {
    Arming arming;
    arming.press();
    arming.receive({.raised = 1, .engaged = true});
    EXPECT_FALSE(arming.permitsForces());
    for (const bool clears : {cleared_first, !cleared_first}) {
      EXPECT_FALSE(arming.release());
      if (clears) {
        arming.receive({.raised = 1, .engaged = false});
      } else {
        arming.press();
      }
    }
    EXPECT_TRUE(arming.release());
    EXPECT_TRUE(arming.permitsForces());
  }
}

TEST(Arming, ARaiseThatCameAndWentBetweenTwoStepsStops) {
  Arming arming;
  arming.press();
  arming.receive({.raised = 1, .engaged = false});
  EXPECT_FALSE(arming.release());
  EXPECT_TRUE(arming.stopped());
}

TEST(Arming, APressBeforeTheNextRaiseDoesNotCountForIt) {
  Arming arming;
  arming.press();
  arming.receive({.raised = 1, .engaged = true});
  arming.press();
  arming.receive({.raised = 2, .engaged = true});
  arming.receive({.raised = 2, .engaged = false});
  EXPECT_FALSE(arming.release()) << "pressed before the second raise";
  arming.press();
  EXPECT_TRUE(arming.release());
}

TEST(Arming, StaysArmedWhenANewServerHasNoRaise) {
  Arming arming;
  arming.press();
  arming.receive({});
  EXPECT_TRUE(arming.permitsForces());
}

}  // namespace
}  // namespace tenon::haptic
