#include "devices/catalog.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/simulated/simulated_device.h"

namespace tenon::devices {
namespace {

using testing::HasSubstr;

TEST(Catalog, OpensEveryDeviceItLists) {
  for (const std::string_view name : deviceNames()) EXPECT_TRUE(openDevice(name)) << name;
  for (const std::string_view name : bimanualDeviceNames()) EXPECT_TRUE(openBimanualDevice(name)) << name;
}

TEST(Catalog, AnUnknownNameFailsWithAListOfTheKnownNames) {
  const auto device = openDevice("sigma8");
  ASSERT_FALSE(device);
  EXPECT_THAT(device.error().what, HasSubstr("'sigma8'"));
  EXPECT_THAT(device.error().what, HasSubstr("sigma7-sim, omega3-sim, falcon-sim, vibrotac-sim, "));
  EXPECT_THAT(device.error().what, HasSubstr("hug-sim"));
  const auto pair = openBimanualDevice("");
  ASSERT_FALSE(pair);
  EXPECT_THAT(pair.error().what, HasSubstr("hug-sim"));
}

TEST(Catalog, TellsWhatADeviceIsWithoutOpeningIt) {
  EXPECT_EQ(findDevice("hug-sim")->arms, 2U);
  EXPECT_EQ(findDevice("omega3-sim")->arms, 1U);
  EXPECT_EQ(findDevice("vibrotac-sim")->arms, 0U);
  EXPECT_FALSE(findDevice("sigma8"));
}

TEST(Catalog, TellsTheCapabilitiesOfADevice) {
  EXPECT_DOUBLE_EQ(capsOf("hug-sim")->rotation_range, 2.6);
  EXPECT_DOUBLE_EQ(capsOf("sigma7-sim")->rotation_range, 1.2);
  EXPECT_DOUBLE_EQ(capsOf("omega3-sim")->rotation_range, 0.0) << "it does not turn";
  EXPECT_FALSE(capsOf("sigma8"));
}

TEST(Catalog, OpensTheDeviceOfASerialNumber) {
  const auto one = std::move(*openDevice("falcon-sim", {.serial = "1001"}));
  const auto other = std::move(*openDevice("falcon-sim", {.serial = "1002"}));
  EXPECT_EQ(one->caps().serial, "1001");
  EXPECT_EQ(other->caps().serial, "1002");
  EXPECT_EQ((*openDevice("falcon-sim"))->caps().serial, "1001") << "the first one found";
  EXPECT_EQ((*openBimanualDevice("hug-sim", {.serial = "1003"}))->left().caps().serial, "1003");
  EXPECT_EQ((*openDevice("vibrotac-sim", {.serial = "1002"}))->caps().serial, "1002");
  EXPECT_NE(unitSeed(1, "1001"), unitSeed(1, "1002")) << "units differ";
}

TEST(Catalog, ASerialNumberThatIsNotThereIsRefusedWithThoseThatAre) {
  const auto device = openDevice("sigma7-sim", {.serial = "77"});
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().what,
            "device 'sigma7-sim': none with serial number '77' is there; there are: 1001, 1002, 1003, 1004");
  const auto pair = openBimanualDevice("hug-sim", {.serial = "77"});
  ASSERT_FALSE(pair);
  EXPECT_THAT(pair.error().what, HasSubstr("there are: 1001"));
  const auto remote = openDevice("remote", {.serial = "1001"});
  ASSERT_FALSE(remote);
  EXPECT_EQ(remote.error().what, "device 'remote': has no serial number, so none can be asked for");
}

TEST(Catalog, ABimanualDeviceIsNotOpenedForOneHand) {
  const auto device = openDevice("hug-sim");
  ASSERT_FALSE(device);
  EXPECT_THAT(device.error().what, HasSubstr("bimanual"));
}

TEST(Catalog, ASimulatedHapticDeviceIsHeldByAHumanArmAndTheBraceletIsNot) {
  EXPECT_NE(simulatedHumanArm(**openDevice("falcon-sim")), nullptr);
  EXPECT_EQ(simulatedHumanArm(**openDevice("vibrotac-sim")), nullptr);
  EXPECT_NE(simulatedHumanArm((*openBimanualDevice("hug-sim"))->left()), nullptr);
}

}  // namespace
}  // namespace tenon::devices
