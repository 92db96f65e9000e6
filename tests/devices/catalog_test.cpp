#include "devices/catalog.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/simulated/simulated_device.h"

namespace tenon {
namespace {

using testing::HasSubstr;

TEST(Catalog, OpensEveryDeviceItNames) {
  for (const std::string_view name : deviceNames()) EXPECT_TRUE(openDevice(name)) << name;
  for (const std::string_view name : pairNames()) EXPECT_TRUE(openPair(name)) << name;
}

TEST(Catalog, AnswersAnUnknownNameWithTheNamesThereAre) {
  const auto device = openDevice("sigma8");
  ASSERT_FALSE(device);
  EXPECT_THAT(device.error().what, HasSubstr("'sigma8'"));
  EXPECT_THAT(device.error().what, HasSubstr("sigma7-sim, omega3-sim, falcon-sim, vibrotac-sim"));
  EXPECT_THAT(device.error().what, HasSubstr("hug-sim"));
  const auto pair = openPair("");
  ASSERT_FALSE(pair);
  EXPECT_THAT(pair.error().what, HasSubstr("hug-sim"));
}

TEST(Catalog, SaysThatAMachineWithTwoArmsWantsTwoHands) {
  const auto device = openDevice("hug-sim");
  ASSERT_FALSE(device);
  EXPECT_THAT(device.error().what, HasSubstr("two arms"));
}

TEST(Catalog, ASimulatedDeviceIsHeldByAnArmAndTheArmBandByNone) {
  EXPECT_NE(handOf(**openDevice("falcon-sim")), nullptr);
  EXPECT_EQ(handOf(**openDevice("vibrotac-sim")), nullptr);
  EXPECT_NE(handOf((*openPair("hug-sim"))->left()), nullptr);
}

}  // namespace
}  // namespace tenon
