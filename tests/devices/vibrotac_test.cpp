#include "devices/simulated/vibrotac.h"

#include <gtest/gtest.h>

namespace tenon::devices {
namespace {

void cycle(Vibrotac& bracelet, std::uint8_t intensity) {
  DeviceState state;
  bracelet.read(state);
  DeviceCommand command;
  command.tactors[0] = intensity;
  bracelet.write(command);
}

TEST(Vibrotac, AMotorSpinsUpWithinItsTimeConstant) {
  Vibrotac bracelet;
  ASSERT_TRUE(bracelet.arm());
  for (int tick = 0; tick < 20; ++tick) cycle(bracelet, 255);  // until the command is transmitted
  cycle(bracelet, 255);
  const double start = bracelet.amplitudes()[0];
  for (int tick = 0; tick < 60; ++tick) cycle(bracelet, 255);
  EXPECT_NEAR((bracelet.amplitudes()[0] - start) / (1.0 - start), 1.0 - 1.0 / 2.718, 0.02);
  for (int tick = 0; tick < 500; ++tick) cycle(bracelet, 255);
  EXPECT_NEAR(bracelet.amplitudes()[0], 1.0, 1e-3);
  EXPECT_EQ(bracelet.amplitudes()[1], 0.0);
  for (int tick = 0; tick < 500; ++tick) cycle(bracelet, 0);
  EXPECT_NEAR(bracelet.amplitudes()[0], 0.0, 1e-3);
}

TEST(Vibrotac, SendsAtMostFiftyCommandsPerSecond) {
  Vibrotac bracelet;
  ASSERT_TRUE(bracelet.arm());
  cycle(bracelet, 0);
  // on for 10 ms between two transmissions: never sent
  for (int tick = 1; tick < 20; ++tick) cycle(bracelet, tick < 11 ? 255 : 0);
  for (int tick = 0; tick < 50; ++tick) cycle(bracelet, 0);
  EXPECT_EQ(bracelet.amplitudes()[0], 0.0);
}

TEST(Vibrotac, StopsWhenWritesStop) {
  Vibrotac bracelet;
  ASSERT_TRUE(bracelet.arm());
  for (int tick = 0; tick < 500; ++tick) cycle(bracelet, 200);
  EXPECT_NEAR(bracelet.amplitudes()[0], 200.0 / 255.0, 1e-2);
  DeviceState state;
  for (int tick = 0; tick < 800; ++tick) bracelet.read(state);
  EXPECT_EQ(state.fault, DeviceFault::kStale);
  EXPECT_LT(bracelet.amplitudes()[0], 1e-3);
}

}  // namespace
}  // namespace tenon::devices
