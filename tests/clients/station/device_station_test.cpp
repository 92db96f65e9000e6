#include "clients/station/device_station.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/haptic/paced_clock.h"

namespace tenon::station {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const Vector3 kStart(0.3, -0.35, 1.0);  // of a trainee's first hand in an empty scene

StationOptions withDevices(std::vector<std::string> names, PersonKind kind, Role role = Role::kTrainee) {
  StationOptions options = defaultStation(role);
  options.kind = kind;
  options.devices.clear();
  for (std::string& name : names) options.devices.push_back({std::move(name), {}});
  return options;
}

HandTrajectory trajectory(const std::string& rows) {
  return HandTrajectory::parse("t,x,y,z,qw,qx,qy,qz\n" + rows, "hand.csv").value();
}

/// A station in an empty scene, whose server has all hands of it.
class EmptyScene {
 public:
  explicit EmptyScene(const StationOptions& options) : station(std::move(*DeviceStation::open(options))) {
    std::vector<HandId> all;
    for (std::uint32_t i = 0; i < station->handNames().size(); ++i) all.push_back(HandId{i});
    rejoin(std::move(all));
  }
  void rejoin(std::vector<HandId> hands) {
    Welcome welcome;
    welcome.accepted = true;
    welcome.client = ClientId{1};
    welcome.server_epoch = 1;
    welcome.hands = std::move(hands);
    station->welcome(welcome, {});
  }
  void run(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 1000.0); ++i) {
      EXPECT_TRUE(station->armDevices());
      station->step(++seq_);
    }
  }
  [[nodiscard]] const DeviceInput& hand(std::size_t i = 0) const { return station->inputs()[i]; }
  [[nodiscard]] Vector3 place(std::size_t i = 0) const { return hand(i).sample.X_WH.translation(); }

  std::unique_ptr<DeviceStation> station;

 private:
  std::uint32_t seq_ = 0;
};

TEST(DeviceStation, HasTheHandsOfItsDevicesArmsAndOfItsTracker) {
  const auto names = [](const StationOptions& options) {
    return (*DeviceStation::open(options))->handNames();
  };
  EXPECT_THAT(names(defaultStation(Role::kTrainee)), ElementsAre("right", "left", "forearm", "head"));
  EXPECT_THAT(names(defaultStation(Role::kInstructor)), ElementsAre("instructor"));
  EXPECT_THAT(names(withDevices({"falcon-sim"}, PersonKind::kNone)), ElementsAre("right", "forearm", "head"));
  EXPECT_THAT(names(withDevices({"sigma7-sim", "omega3-sim"}, PersonKind::kNone, Role::kInstructor)),
              ElementsAre("instructor", "instructor_left"));
  StationOptions named = withDevices({"hug-sim"}, PersonKind::kNone, Role::kInstructor);
  named.hands = {"tool", "lamp"};
  EXPECT_THAT(names(named), ElementsAre("tool", "lamp"));
}

TEST(DeviceStation, RefusesHandsThatDoNotFitItsArms) {
  StationOptions options = withDevices({"falcon-sim"}, PersonKind::kNone);
  options.hands = {"right", "left"};
  EXPECT_THAT(DeviceStation::open(options).error().what, HasSubstr("1 arms for 2 hands"));
  EXPECT_THAT(DeviceStation::open(withDevices({"hug-sim", "falcon-sim"}, PersonKind::kNone)).error().what,
              HasSubstr("3 arms for 2 hands"));
  EXPECT_THAT(DeviceStation::open(withDevices({"vibrotac-sim"}, PersonKind::kNone)).error().what,
              HasSubstr("moves no hand"));
}

TEST(DeviceStation, WithoutAPersonNothingMovesItAndNothingArmsIt) {
  EmptyScene scene(withDevices({"sigma7-sim"}, PersonKind::kNone));
  scene.run(1.0);
  EXPECT_LT((scene.place() - kStart).norm(), 1e-4);
  EXPECT_FALSE(scene.hand().active);
  EXPECT_TRUE(scene.station->arming().awaitsPress());
  scene.station->press();
  scene.run(0.01);
  EXPECT_TRUE(scene.hand().active);
}

TEST(DeviceStation, AScriptMovesTheArmOfItsHand) {
  StationOptions options = withDevices({"sigma7-sim", "falcon-sim"}, PersonKind::kScript);
  options.scripts.push_back({"left", trajectory("0,0.3,-0.35,1,1,0,0,0\n1,0.32,-0.35,1.01,1,0,0,0\n")});
  EmptyScene scene(options);
  const Vector3 right = scene.station->hands().empty() ? Vector3::Zero() : kStart;
  scene.run(2.0);
  EXPECT_LT((scene.place(0) - right).norm(), 1e-3) << "no file moves it";
  EXPECT_LT((scene.place(1) - Vector3(0.32, -0.35, 1.01)).norm(), 2e-3);
  EXPECT_TRUE(scene.hand(1).active) << "its person has armed it";
}

TEST(DeviceStation, WithoutAHandForItsFirstArmTheWearerIsTheSecond) {
  EmptyScene scene(withDevices({"sigma7-sim"}, PersonKind::kSimulated));
  scene.rejoin({HandId{}, HandId{1}, HandId{2}});
  scene.run(0.01);
  ASSERT_THAT(scene.station->inputs(), testing::SizeIs(2)) << "forearm and head are sent in each step";
}

TEST(DeviceStation, AMountedDeviceGoesWhereItsPersonWants) {
  StationOptions options = withDevices({"sigma7-sim"}, PersonKind::kScript);
  options.devices.front().configuration.q_DM = expRotation(Vector3(0.3, -0.2, 1.5));
  options.scripts.push_back({"", trajectory("0,0.32,-0.36,1.01,0.995,0.1,0,0\n")});
  EmptyScene scene(options);
  scene.run(2.0);
  EXPECT_LT((scene.place() - Vector3(0.32, -0.36, 1.01)).norm(), 2e-3);
  const Quaternion wanted = Quaternion(0.995, 0.1, 0.0, 0.0).normalized();
  EXPECT_LT(scene.hand().sample.X_WH.rotation().angularDistance(wanted), 0.02);
}

TEST(DeviceStation, ADeadMansSwitchIsHeldByTheSimulatedPersonAndByNobodyElse) {
  StationOptions options = withDevices({"sigma7-sim"}, PersonKind::kScript);
  options.devices.front().configuration.dead_man = true;
  EmptyScene held(options);
  held.run(0.1);
  EXPECT_TRUE(held.hand().active);
  options.kind = PersonKind::kNone;
  EmptyScene released(options);
  released.station->press();
  released.run(0.1);
  EXPECT_FALSE(released.hand().active) << "armed, but nobody holds it";
}

// the arm pulls the handle against the end of its workspace until the clutch lets go, and comes back
TEST(DeviceStation, ASimulatedPersonResetsAnOpenClutchAfterTwoSeconds) {
  StationOptions options = withDevices({"hug-sim"}, PersonKind::kScript);
  options.scripts.push_back(
      {"right", trajectory("0,0.3,-0.35,1,1,0,0,0\n1.5,1.5,-0.35,1,1,0,0,0\n2,0.5,-0.35,1,1,0,0,0\n")});
  EmptyScene scene(options);
  scene.run(0.1);
  EXPECT_TRUE(scene.hand(0).active);
  scene.run(1.9);
  EXPECT_FALSE(scene.hand(0).active) << "open";
  EXPECT_FALSE(scene.hand(1).active) << "both arms stop";
  scene.run(3.0);
  EXPECT_TRUE(scene.hand(0).active);
  EXPECT_TRUE(scene.hand(1).active);
  const Vector3 before = scene.place();
  scene.run(0.5);
  EXPECT_LT((scene.place() - before).norm(), 0.5);
}

/// A device of which await() brings the next reading.
class PacingDevice final : public devices::HapticDevice {
 public:
  PacingDevice() { caps_.paces = true; }
  [[nodiscard]] const devices::DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override { return {}; }
  void disarm() noexcept override {}
  [[nodiscard]] Result<void> resetFault() override { return {}; }
  void read(devices::DeviceState& state) noexcept override { state.seq = readings; }
  void write(const devices::DeviceCommand& /*command*/) noexcept override {}
  void await() noexcept override { ++readings; }

  std::uint64_t readings = 0;

 private:
  devices::DeviceCaps caps_;
};

TEST(PacedClock, APeriodPassesWithEachReading) {
  PacingDevice device;
  haptic::PacedClock clock(device, std::chrono::milliseconds(1));
  std::atomic<bool> stop{false};
  clock.sleepUntil(std::chrono::milliseconds(3), stop);
  EXPECT_EQ(device.readings, 3U);
  EXPECT_EQ(clock.now(), std::chrono::milliseconds(3));
  clock.sleepUntil(std::chrono::milliseconds(3), stop);
  EXPECT_EQ(device.readings, 3U) << "it is that time already";
  stop = true;
  clock.sleepUntil(std::chrono::milliseconds(9), stop);
  EXPECT_EQ(device.readings, 3U);
}

}  // namespace
}  // namespace tenon::station
