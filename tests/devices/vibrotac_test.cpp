#include "devices/simulated/vibrotac.h"

#include <gtest/gtest.h>

namespace tenon {
namespace {

void cycle(Vibrotac& band, std::uint8_t first) {
  DeviceState state;
  band.read(state);
  DeviceCommand command;
  command.tactors[0] = first;
  band.write(command);
}

TEST(Vibrotac, AMotorSpinsUpWithinItsTimeConstant) {
  Vibrotac band;
  ASSERT_TRUE(band.arm());
  for (int tick = 0; tick < 20; ++tick) cycle(band, 255);  // until the link has sent it
  cycle(band, 255);
  const double start = band.felt()[0];
  for (int tick = 0; tick < 60; ++tick) cycle(band, 255);
  EXPECT_NEAR((band.felt()[0] - start) / (1.0 - start), 1.0 - 1.0 / 2.718, 0.02);
  for (int tick = 0; tick < 500; ++tick) cycle(band, 255);
  EXPECT_NEAR(band.felt()[0], 1.0, 1e-3);
  EXPECT_EQ(band.felt()[1], 0.0);
  for (int tick = 0; tick < 500; ++tick) cycle(band, 0);
  EXPECT_NEAR(band.felt()[0], 0.0, 1e-3);
}

TEST(Vibrotac, TakesAtMostFiftyCommandsASecond) {
  Vibrotac band;
  ASSERT_TRUE(band.arm());
  cycle(band, 0);
  // on for 10 ms between two sends: the link never carries it
  for (int tick = 1; tick < 20; ++tick) cycle(band, tick < 11 ? 255 : 0);
  for (int tick = 0; tick < 50; ++tick) cycle(band, 0);
  EXPECT_EQ(band.felt()[0], 0.0);
}

TEST(Vibrotac, FallsSilentWhenDisarmedOrLeftAlone) {
  Vibrotac band;
  ASSERT_TRUE(band.arm());
  for (int tick = 0; tick < 500; ++tick) cycle(band, 200);
  EXPECT_NEAR(band.felt()[0], 200.0 / 255.0, 1e-2);
  DeviceState state;
  for (int tick = 0; tick < 800; ++tick) band.read(state);
  EXPECT_EQ(state.fault, DeviceFault::kStale);
  EXPECT_LT(band.felt()[0], 1e-3);
}

}  // namespace
}  // namespace tenon
