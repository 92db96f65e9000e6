#include "idl/types/step_clock.h"

#include <gtest/gtest.h>

namespace tenon {
namespace {

TEST(StepClock, StandsInPausesAndStopsAndNotWhileForcesAreFrozen) {
  StepClock clock;
  EXPECT_EQ(clock.between(3, 10), 7U) << "nothing is known";
  clock.add({.phase = RunPhase::kWaitingForPeople, .tick = 0});
  clock.add({.phase = RunPhase::kRunning, .tick = 1});
  clock.add({.phase = RunPhase::kPaused, .tick = 101});
  clock.add({.phase = RunPhase::kRunning, .tick = 201});
  clock.add({.phase = RunPhase::kRunning, .tick = 301, .emergency_stop = true});
  clock.add({.phase = RunPhase::kPaused, .tick = 401});
  clock.add({.phase = RunPhase::kRunning, .tick = 501, .forces_frozen = true});
  EXPECT_EQ(clock.between(0, 100), 100U);
  EXPECT_EQ(clock.between(0, 600), 300U);
  EXPECT_EQ(clock.between(150, 210), 10U);
  EXPECT_EQ(clock.between(110, 190), 0U);
  EXPECT_EQ(clock.between(600, 600), 0U);
  EXPECT_EQ(clock.between(600, 500), 0U);
  // a resumed server begins again at tick 350, where it was stopped
  clock.add({.phase = RunPhase::kRunning, .tick = 351, .emergency_stop = true});
  EXPECT_EQ(clock.between(0, 600), 200U);
}

}  // namespace
}  // namespace tenon
