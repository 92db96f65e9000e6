#include "clients/station/device_station.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/haptic/scene_copy.h"
#include "clients/haptic/servo_thread.h"
#include "devices/safety_rules.h"
#include "devices/simulated/sigma7.h"
#include "tests/server/simulation/small_scene.h"

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
  /// Until the hand is active or not; [s] how long, 10 at most.
  double runUntil(std::size_t hand_index, bool active) {
    int steps = 0;
    for (; steps < 10'000 && hand(hand_index).active != active; ++steps) run(0.001);
    return steps * kTickSeconds;
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

TEST(DeviceStation, EachHandBeginsAtTheObjectThatItMovesWhateverItsName) {
  StationOptions options = withDevices({"hug-sim"}, PersonKind::kNone);
  options.hands = {"lamp", "screwdriver"};
  const auto station = std::move(*DeviceStation::open(options));
  std::vector<SceneObject> objects(3);
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    objects[i].object = ObjectId{i};
    objects[i].kind = i == 0 ? "pointer" : "tool";
    objects[i].X_WO = Pose(Vector3(0.1 * i, -0.3, 1.1));
  }
  Welcome welcome;
  welcome.accepted = true;
  welcome.client = ClientId{1};
  welcome.server_epoch = 1;
  for (std::uint32_t i = 0; i < station->handNames().size(); ++i) welcome.hands.push_back(HandId{i});
  welcome.objects = {ObjectId{2}, ObjectId{1}};
  station->welcome(welcome, objects);
  station->step(1);
  EXPECT_LT((station->inputs()[0].sample.X_WH.translation() - Vector3(0.2, -0.3, 1.1)).norm(), 1e-6);
  EXPECT_LT((station->inputs()[1].sample.X_WH.translation() - Vector3(0.1, -0.3, 1.1)).norm(), 1e-6);
}

TEST(DeviceStation, TellsWhatMovesEachHandAndHowFarItReaches) {
  std::vector<std::string> told;
  for (const haptic::HandDevice& device :
       (*DeviceStation::open(defaultStation(Role::kTrainee)))->handDevices())
    told.push_back(describe(device));
  EXPECT_THAT(told,
              ElementsAre("hand right: HUG arm (simulated), serial number 1001, workspace radius 0.400 m",
                          "hand left: HUG arm (simulated), serial number 1001, workspace radius 0.400 m"));
}

TEST(DeviceStation, TwoDevicesOfAKindAreTwo) {
  const auto serials = [](const StationOptions& options) {
    std::vector<std::string> all;
    const auto station = DeviceStation::open(options);
    if (!station) return std::vector<std::string>{station.error().what};
    for (const haptic::HandDevice& device : (*station)->handDevices()) all.push_back(device.serial);
    return all;
  };
  StationOptions options = withDevices({"sigma7-sim", "sigma7-sim"}, PersonKind::kNone);
  EXPECT_THAT(serials(options), ElementsAre("1001", "1002"));
  options.devices[1].configuration.serial = "1001";
  EXPECT_THAT(serials(options), ElementsAre("1002", "1001"));
  options.devices[0].configuration.serial = "1001";
  EXPECT_THAT(serials(options), ElementsAre("device 'sigma7-sim' with serial number 1001 is given twice"));
  options.devices[0].configuration.serial = "7";
  EXPECT_THAT(serials(options), ElementsAre(HasSubstr("none with serial number '7' is there")));
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

TEST(DeviceStation, AHandThatBeginsUnderAStopSaysStopAndOneThatIsNotArmedSaysThat) {
  constexpr std::uint32_t kStopped = devices::bit(devices::SafetyRule::kEmergencyStop);
  constexpr std::uint32_t kNotArmed = devices::bit(devices::SafetyRule::kNotArmed);
  EmptyScene scene(withDevices({"sigma7-sim"}, PersonKind::kNone));
  scene.run(0.01);
  EXPECT_EQ(scene.station->states()[0].safety_flags & (kStopped | kNotArmed), kNotArmed);
  scene.station->receive(haptic::StopSignal{.raised = 1, .engaged = true});
  scene.rejoin({HandId{0}, HandId{1}, HandId{2}});
  scene.run(0.01);
  EXPECT_EQ(scene.station->states()[0].safety_flags & (kStopped | kNotArmed), kStopped);
}

TEST(DeviceStation, ManifoldsOfOtherStationsAreNotItsOwn) {
  EmptyScene scene(withDevices({"sigma7-sim"}, PersonKind::kNone));
  HandManifold manifold;
  manifold.hand = HandId{0};
  EXPECT_TRUE(scene.station->receive(manifold));
  manifold.hand = HandId{7};
  EXPECT_FALSE(scene.station->receive(manifold)) << "their age is that of another station's inputs";
}

/// A device that does not answer when it is to be armed, for ten seconds at most.
class DeviceThatHangs final : public devices::SimulatedDevice {
 public:
  DeviceThatHangs() : SimulatedDevice(devices::sigma7Model(), 1) { EXPECT_TRUE(open()); }
  [[nodiscard]] Result<void> arm() override {
    ++armed;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!answers && std::chrono::steady_clock::now() < until) std::this_thread::yield();
    return SimulatedDevice::arm();
  }
  std::atomic<int> armed = 0;
  std::atomic<bool> answers = false;
};

// from the beginning, where its person has armed the station before the session is joined
TEST(DeviceStation, FramesStopsAndContactsAreHeardWhileADeviceIsArmedThatDoesNotAnswer) {
  const auto device = std::make_shared<DeviceThatHangs>();
  StationOptions options = defaultStation(Role::kInstructor);
  options.kind = PersonKind::kNone;
  options.devices.front().opened = device;
  EmptyScene scene(options);
  scene.station->press();
  scene.rejoin({HandId{0}});
  EXPECT_EQ(device->armed, 0) << "nothing waits for the device where the session begins";
  ASSERT_TRUE(scene.station->wantsArming());
  std::thread arming([&] { EXPECT_TRUE(scene.station->armDevices()); });
  while (device->armed == 0) std::this_thread::yield();

  std::uint32_t seq = 0;
  WorldFrame frame;
  frame.server_epoch = 1;
  frame.tick = 7;
  HandManifold manifold;
  manifold.hand = HandId{0};
  scene.station->receive(frame);
  EXPECT_TRUE(scene.station->receive(manifold));
  for (int i = 0; i < 10; ++i) scene.station->step(++seq);
  EXPECT_EQ(scene.station->world().tick(), 7U);
  EXPECT_FALSE(scene.hand().active);
  scene.station->receive(haptic::StopSignal{1, true});
  EXPECT_TRUE(scene.station->arming().stopped());
  for (int i = 0; i < 10; ++i) scene.station->step(++seq);
  EXPECT_FALSE(device->answers);

  device->answers = true;
  arming.join();
  scene.station->step(++seq);
  devices::DeviceState state;
  device->read(state);
  EXPECT_FALSE(state.forces_on) << "the stop holds what was armed meanwhile";
}

/// A device with a button that arms, held by its owner.
class DeviceWithButton final : public devices::HapticDevice {
 public:
  DeviceWithButton() { caps_.arming = 1; }
  [[nodiscard]] const devices::DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override {
    armed = true;
    return {};
  }
  void disarm() noexcept override { armed = false; }
  [[nodiscard]] Result<void> resetFault() override { return {}; }
  void read(devices::DeviceState& state) noexcept override {
    state = {};
    state.seq = ++readings_;
    state.buttons = pressed ? 1 : 0;
    state.forces_on = armed;
  }
  void write(const devices::DeviceCommand& command) noexcept override { last = command; }

  bool pressed = false;
  bool armed = false;
  devices::DeviceCommand last;

 private:
  std::uint64_t readings_ = 0;
  devices::DeviceCaps caps_;
};

StationOptions withButton(const std::shared_ptr<DeviceWithButton>& device) {
  StationOptions options = withDevices({"button"}, PersonKind::kNone);
  options.devices.front().opened = device;
  return options;
}

/// A device that says when it was waited for.
class PacingDevice final : public devices::HapticDevice {
 public:
  [[nodiscard]] const devices::DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override { return {}; }
  void disarm() noexcept override {}
  [[nodiscard]] Result<void> resetFault() override { return {}; }
  [[nodiscard]] bool paces() const noexcept override { return true; }
  [[nodiscard]] bool awaitReading(std::chrono::nanoseconds) noexcept override {
    ++awaited;
    return true;
  }
  void read(devices::DeviceState& state) noexcept override {
    state = {};
    state.seq = ++read_;
    state.forces_on = true;
  }
  void write(const devices::DeviceCommand&) noexcept override {}

  int awaited = 0;

 private:
  std::uint64_t read_ = 0;
  devices::DeviceCaps caps_ = devices::sigma7Model().caps;
};

TEST(DeviceStation, IsPacedByTheFirstDeviceThatDoes) {
  EXPECT_EQ((*DeviceStation::open(withDevices({"sigma7-sim"}, PersonKind::kNone)))->pacedBy(), "");
  const auto first = std::make_shared<PacingDevice>(), second = std::make_shared<PacingDevice>();
  StationOptions options = withDevices({"sigma7-sim", "one", "other"}, PersonKind::kNone);
  options.hands = {"left", "right", "third"};
  options.tracker.clear();
  options.devices[1].opened = first;
  options.devices[2].opened = second;
  EmptyScene scene(options);
  EXPECT_EQ(scene.station->pacedBy(), "the device of hand right");
  EXPECT_TRUE(scene.station->awaitReading(std::chrono::milliseconds(3)));
  EXPECT_EQ(first->awaited, 1);
  EXPECT_EQ(second->awaited, 0) << "it follows";
  scene.rejoin({HandId{0}, HandId{}, HandId{2}});
  EXPECT_FALSE(scene.station->awaitReading(std::chrono::milliseconds(3))) << "nobody reads it";
  EXPECT_EQ(first->awaited, 1);
}

TEST(DeviceStation, ItsLoopRunsByTheClockOfASimulatedDevice) {
  StationOptions options = defaultStation(Role::kTrainee);
  options.devices.front().configuration.paces = true;
  EmptyScene scene(options);
  ASSERT_TRUE(scene.station->armDevices());
  EXPECT_EQ(scene.station->pacedBy(), "the device of hand right");
  haptic::ServoThread servo(
      *scene.station, [] {}, false);
  servo.start();
  std::uint32_t seq = 0;
  while (seq < 200) {
    const haptic::StationOutput* const output = servo.loop().takeOutput();
    if (output == nullptr) {
      std::this_thread::yield();
      continue;
    }
    EXPECT_GT(output->seq, seq);
    seq = output->seq;
    EXPECT_EQ(output->inputs.size(), 4U) << "both arms, forearm and head";
  }
  servo.stop(true);
  EXPECT_TRUE(scene.station->finished());
}

// arming has another thread, and no two use a device
TEST(DeviceStation, ADeviceThatIsBeingArmedIsNotWaitedFor) {
  const auto device = std::make_shared<PacingDevice>();
  StationOptions options = withDevices({"one"}, PersonKind::kNone);
  options.devices.front().opened = device;
  EmptyScene scene(options);
  scene.run(0.001);
  scene.station->press();
  ASSERT_TRUE(scene.station->wantsArming());
  EXPECT_FALSE(scene.station->awaitReading(std::chrono::milliseconds(3)));
  EXPECT_EQ(device->awaited, 0);
  ASSERT_TRUE(scene.station->armDevices());
  EXPECT_TRUE(scene.station->awaitReading(std::chrono::milliseconds(3)));
}

TEST(DeviceStation, AButtonThatIsHeldOverARejoinIsNotPressed) {
  const auto device = std::make_shared<DeviceWithButton>();
  EmptyScene scene(withButton(device));
  EXPECT_TRUE(scene.station->hasArmingButton());
  scene.station->receive(haptic::StopSignal{1, true});
  device->pressed = true;
  scene.rejoin({HandId{0}, HandId{1}, HandId{2}});
  scene.run(0.01);
  EXPECT_TRUE(scene.station->arming().awaitsPress());
  device->pressed = false;
  scene.run(0.01);
  device->pressed = true;
  scene.run(0.01);
  EXPECT_FALSE(scene.station->arming().awaitsPress());
}

/// A device at rest far beyond its workspace, whose wall asks for 3 N where no contacts are rendered; its
/// motors can do that for a while.
class DeviceInItsWall final : public devices::HapticDevice {
 public:
  DeviceInItsWall() { caps_.continuous_force = 1.0; }
  [[nodiscard]] const devices::DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override {
    armed_ = true;
    return {};
  }
  void disarm() noexcept override { armed_ = false; }
  [[nodiscard]] Result<void> resetFault() override { return {}; }
  void read(devices::DeviceState& state) noexcept override {
    state = {};
    state.seq = ++readings_;
    state.X_DH = Pose(Vector3(4.0 * caps_.workspace_radius, 0.0, 0.0));
    state.forces_on = armed_;
  }
  void write(const devices::DeviceCommand& command) noexcept override {
    largest = std::max(largest, command.F_Ho_D.force.norm());
    last = command.F_Ho_D.force.norm();
  }

  double largest = 0.0, last = 0.0;  // [N]

 private:
  std::uint64_t readings_ = 0;
  devices::DeviceCaps caps_ = devices::sigma7Model().caps;
  bool armed_ = false;
};

TEST(DeviceStation, MotorsThatAreHotAreSoForTheNextSeat) {
  const auto device = std::make_shared<DeviceInItsWall>();
  StationOptions options = withDevices({"sigma7"}, PersonKind::kNone);
  options.devices.front().opened = device;
  EmptyScene scene(options);
  scene.station->press();
  scene.run(20.0);
  EXPECT_NEAR(device->largest, 3.0, 0.1);
  const double hot = device->caps().continuous_force + 0.2;
  ASSERT_LT(device->last, hot);
  device->largest = 0.0;
  scene.rejoin({HandId{0}, HandId{1}, HandId{2}});
  scene.run(4.0);
  EXPECT_LT(device->largest, 2.0) << "not 3 N: the ramp of a second cools it a little";
  EXPECT_GT(device->last, 0.5 * hot) << "it is armed";
}

// who has the devices gives copies when they are made; a restart makes none
TEST(DeviceStation, CopiesOfTheSceneAreMadeByWhoGivesThemAlone) {
  test::SmallScene small;
  small.hand("right", small.object("ball", test::pointerShape(), Vector3::Zero()));
  const auto model = small.build();
  const long nobodys = model.use_count();
  const long one = [&] {
    const auto copies = haptic::copiesOf(model, 1);
    return model.use_count() - nobodys;
  }();
  EmptyScene scene(withDevices({"sigma7-sim"}, PersonKind::kNone));
  const auto copies = [&] { return (model.use_count() - nobodys) / one; };
  const std::vector<HandId> hands{HandId{0}, HandId{1}, HandId{2}};
  scene.station->setCopies(haptic::copiesOf(model, 1));
  EXPECT_EQ(copies(), 1);
  scene.run(0.01);
  scene.rejoin(hands);
  EXPECT_EQ(copies(), 0) << "it went with its hand";
  scene.station->setCopies(haptic::copiesOf(model, 1));
  scene.run(0.01);
  EXPECT_EQ(copies(), 1);
  // a second one waits for the next hand
  scene.station->setCopies(haptic::copiesOf(model, 1));
  EXPECT_EQ(copies(), 2);
  scene.rejoin(hands);
  EXPECT_EQ(copies(), 1);
}

TEST(DeviceStation, AtItsEndAllDevicesAreDisarmedWithTheBracelet) {
  StationOptions options = defaultStation(Role::kTrainee);
  EmptyScene scene(options);
  scene.run(0.1);
  ASSERT_TRUE(scene.hand(0).active);
  scene.station->finish(true);
  EXPECT_FALSE(scene.station->finished());
  scene.run(0.03);
  EXPECT_TRUE(scene.station->finished());
  for (const HandState& state : scene.station->states()) {
    EXPECT_EQ(state.F_Ho_W.force.norm(), 0.0);
    EXPECT_THAT(state.tactors, testing::Each(0));
  }
  scene.run(1.0);
  EXPECT_FALSE(scene.station->wantsArming()) << "its simulated person does not arm it again";
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
  ASSERT_LT(scene.runUntil(0, false), 3.0) << "open";
  scene.run(0.002);
  EXPECT_FALSE(scene.hand(1).active) << "both arms stop";
  // by one press: what the device said before it does not latch the clutch once more, for another two seconds
  EXPECT_NEAR(scene.runUntil(0, true), 2.0, 0.01);
  EXPECT_TRUE(scene.hand(1).active);
  const Vector3 before = scene.place();
  scene.run(0.5);
  EXPECT_LT((scene.place() - before).norm(), 0.5);
}

}  // namespace
}  // namespace tenon::station
