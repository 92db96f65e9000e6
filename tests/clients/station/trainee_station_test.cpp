#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "clients/station/device_station.h"
#include "tests/clients/station/funnel_server.h"
#include "tests/support/realtime_guard.h"

namespace tenon::station {
namespace {

using test::FunnelServer;

std::unique_ptr<DeviceStation> station(std::uint64_t seed, int misplaced_mount = -1) {
  simulated_person::PersonOptions person;
  person.seed = seed;
  person.misplaced_mount = misplaced_mount;
  return std::move(*DeviceStation::open(defaultStation(Role::kTrainee, person)));
}

TEST(TraineeStation, ReachesTouchesAndInsertsAPartGuidedByContact) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    test::FunnelServer server;
    const auto trainee = station(seed);
    server.welcome(*trainee);
    server.run(*trainee, 60.0);
    EXPECT_TRUE(server.grabbed) << trainee->activity();
    EXPECT_TRUE(server.over) << trainee->activity() << " off by " << server.error().translation.transpose()
                             << " angle error " << server.error().rotation.transpose();
    EXPECT_LT(server.highest_force, 25.0);
    EXPECT_LT(server.highest_speed, 0.36);
    EXPECT_FALSE(server.indexed_in_contact);
  }
}

// 55 mm between the walls of the guide, where indexing (eq. 1) pauses
class TraineeWithEach : public testing::TestWithParam<const char*> {};

TEST_P(TraineeWithEach, InsertsAPartDeeperThanTheWorkspaceOfItsDeviceByDeclutching) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    test::FunnelServer server;
    StationOptions options = defaultStation(Role::kTrainee, {.seed = seed});
    options.devices = {{.name = GetParam(), .configuration = {}, .opened = {}}};
    options.tracker.clear();
    options.tactors.clear();
    const auto trainee = std::move(*DeviceStation::open(options));
    server.welcome(*trainee);
    bool declutched = false;
    for (int i = 0; i < 120'000 && !server.over; ++i) {
      server.step(*trainee);
      declutched = declutched || std::string_view(trainee->activity()) == "de-clutches";
    }
    EXPECT_TRUE(server.over) << "seed " << seed << ": " << trainee->activity() << " off by "
                             << server.error().translation.transpose();
    EXPECT_TRUE(declutched);
    EXPECT_LT(server.highest_force, 25.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, TraineeWithEach, testing::Values("sigma7-sim", "omega3-sim", "falcon-sim"),
                         [](const auto& device) {
                           const std::string name = device.param;
                           return name.substr(0, name.find('-'));
                         });

TEST(TraineeStation, MissesTheTargetWithoutCollisions) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    test::FunnelServer server;
    server.collisions = false;
    const auto trainee = station(seed);
    server.welcome(*trainee);
    server.run(*trainee, 45.0);
    EXPECT_TRUE(server.grabbed);
    EXPECT_FALSE(server.over);
    EXPECT_GT(server.error().translation.norm(), 0.002);
    EXPECT_LT(server.error().translation.norm(), 0.012);  // it did try
  }
}

TEST(TraineeStation, MisplacedMountPushesOnTheRimAndIsNotCorrected) {
  test::FunnelServer server;
  const auto trainee = station(4, 0);
  server.welcome(*trainee);
  server.run(*trainee, 45.0);
  EXPECT_TRUE(server.grabbed);
  EXPECT_FALSE(server.over);
  EXPECT_STREQ(trainee->activity(), "pushes at wrong pose");
  EXPECT_TRUE(server.in_contact);
  EXPECT_GT(server.error().translation.head<2>().norm(), 0.018);
}

TEST(TraineeStation, EqualSeedsGiveBitEqualMotion) {
  test::FunnelServer one, two, three;
  const auto first = station(7), second = station(7), other = station(8);
  one.welcome(*first);
  two.welcome(*second);
  three.welcome(*other);
  bool differs = false;
  for (int i = 0; i < 12000; ++i) {
    one.step(*first);
    two.step(*second);
    three.step(*other);
    const Pose& X_WH = first->inputs()[0].sample.X_WH;
    ASSERT_EQ(X_WH, second->inputs()[0].sample.X_WH) << i;
    differs = differs || !(X_WH == other->inputs()[0].sample.X_WH);
  }
  EXPECT_TRUE(differs) << "another seed moves otherwise";
}

TEST(TraineeStation, SkipsHandsThatTheScenarioDoesNotHave) {
  test::FunnelServer server;
  const auto trainee = station(1);
  EXPECT_EQ(trainee->handNames(), (std::vector<std::string>{"right", "left", "forearm", "head"}));
  server.welcome(*trainee);
  server.step(*trainee);
  ASSERT_EQ(trainee->hands().size(), 1U);
  EXPECT_EQ(trainee->inputs().size(), 1U);
}

TEST(TraineeStation, StepAllocatesNothingAndLocksNothing) {
  test::FunnelServer server;
  const auto trainee = station(1);
  server.welcome(*trainee);
  server.run(*trainee, 0.5);
  const test::RealtimeGuard guard;
  for (std::uint32_t i = 0; i < 500; ++i) trainee->step(501 + i);
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::station
