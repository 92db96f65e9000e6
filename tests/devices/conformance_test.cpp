#include <chrono>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"
#include "tests/support/realtime_guard.h"

// Contract of HapticDevice. Runs for every device of the catalog, new ones included.

namespace tenon::devices {
namespace {

struct CatalogDevice {
  std::string name;
  std::function<HapticDevice*()> open;
};

void PrintTo(const CatalogDevice& entry, std::ostream* out) { *out << entry.name; }

/// Keeps an opened device alive until the test process ends.
template <typename T>
T* keepAlive(Result<std::unique_ptr<T>> opened) {
  static std::vector<std::unique_ptr<T>> keeper;
  if (!opened) return nullptr;
  keeper.push_back(std::move(*opened));
  return keeper.back().get();
}

std::vector<CatalogDevice> everyDevice() {
  std::vector<CatalogDevice> devices;
  for (const std::string_view view : deviceNames()) {
    const std::string name(view);
    devices.push_back({name, [name] { return keepAlive(openDevice(name)); }});
  }
  for (const std::string_view view : bimanualDeviceNames()) {
    const std::string name(view);
    devices.push_back({name + "-right", [name] { return &keepAlive(openBimanualDevice(name))->right(); }});
    devices.push_back({name + "-left", [name] { return &keepAlive(openBimanualDevice(name))->left(); }});
  }
  return devices;
}

class Conformance : public testing::TestWithParam<CatalogDevice> {
 protected:
  void SetUp() override {
    device_ = GetParam().open();
    ASSERT_NE(device_, nullptr);
  }
  DeviceState read() {
    DeviceState state;
    device_->read(state);
    return state;
  }
  /// One servo cycle.
  DeviceState cycle(const DeviceCommand& command) {
    const DeviceState state = read();
    device_->write(command);
    return state;
  }
  static DeviceCommand push(double x) {
    DeviceCommand command;
    command.F_Ho_D.force.x() = x;
    return command;
  }

  HapticDevice* device_ = nullptr;
};

/// Tests that need a simulated human arm at the handle.
class HeldDevice : public Conformance {};

std::vector<CatalogDevice> everyHeldDevice() {
  std::vector<CatalogDevice> held;
  for (const CatalogDevice& entry : everyDevice())
    if (HapticDevice* const device = entry.open(); device && simulatedHumanArm(*device))
      held.push_back(entry);
  return held;
}

TEST_P(Conformance, ANumberThatChangesSaysThatAReadingIsNew) {
  const DeviceState first = read();
  EXPECT_NE(read().seq, first.seq) << "a hand whose readings keep their number loses its force";
}

TEST_P(Conformance, OneThatDoesNotPaceIsNotWaitedFor) {
  if (!device_->paces()) {
    EXPECT_FALSE(device_->awaitReading(std::chrono::hours(1)));
  }
}

TEST_P(Conformance, ReportsConsistentCapabilities) {
  const DeviceCaps& caps = device_->caps();
  EXPECT_FALSE(caps.model.empty());
  EXPECT_GT(caps.rate, 0.0);
  if (caps.dof_mask == 0) {
    EXPECT_GT(caps.tactors, 0U) << "a device without axes has tactors";
    return;
  }
  EXPECT_GT(caps.workspace_radius, caps.indexing_radius);
  EXPECT_GT(caps.indexing_radius, 0.0);
  EXPECT_GT(caps.indexing_gain, 0.0);
  EXPECT_GT(caps.peak_force, 0.0);
  EXPECT_LE(caps.continuous_force, caps.peak_force);
  EXPECT_LE(caps.command_limit, caps.peak_force);
  EXPECT_GT(caps.max_stiffness, 0.0);
  EXPECT_GT(caps.physical_damping, 0.0);
  EXPECT_GT(caps.max_speed, 0.0);
}

TEST_P(Conformance, ArmsAndDisarmsRepeatedly) {
  EXPECT_FALSE(read().forces_on);
  for (int round = 0; round < 3; ++round) {
    EXPECT_TRUE(device_->arm());
    EXPECT_TRUE(device_->arm()) << "arming twice has no effect";
    EXPECT_TRUE(read().forces_on);
    device_->disarm();
    device_->disarm();
    EXPECT_FALSE(read().forces_on);
  }
}

TEST_P(Conformance, NumbersItsReadings) {
  std::uint64_t last = read().seq;
  for (int tick = 0; tick < 100; ++tick) {
    const std::uint64_t now = read().seq;
    EXPECT_GT(now, last);
    last = now;
  }
}

TEST_P(Conformance, StaysAtRestWithoutAForce) {
  ASSERT_TRUE(device_->arm());
  const Pose start = read().X_DH;
  for (int tick = 0; tick < 1000; ++tick) {
    const DeviceState state = cycle({});
    EXPECT_LT((state.X_DH.translation() - start.translation()).norm(), 1e-4);
    EXPECT_EQ(state.fault, DeviceFault::kNone);
  }
}

TEST_P(Conformance, DoesNotMoveTheHandWhileDisarmed) {
  const Pose start = read().X_DH;
  for (int tick = 0; tick < 500; ++tick) cycle(push(5.0));
  EXPECT_LT((read().X_DH.translation() - start.translation()).norm(), 1e-4);
}

TEST_P(HeldDevice, PushesAlongTheCommandedForceUpToItsPeakForce) {
  auto* const simulated = dynamic_cast<SimulatedDevice*>(device_);
  ASSERT_NE(simulated, nullptr);
  ASSERT_TRUE(device_->arm());
  simulated->humanArm().setContraction(1.0);
  const Pose start = read().X_DH;
  for (int tick = 0; tick < 100; ++tick) cycle(push(2.0));
  EXPECT_GT(read().X_DH.translation().x(), start.translation().x() + 1e-4);
  for (int tick = 0; tick < 10; ++tick) {
    cycle(push(1e4));
    EXPECT_LE(simulated->motorWrench().force.norm(), device_->caps().peak_force + 1e-9);
  }
}

TEST_P(HeldDevice, BrakesOnCommand) {
  HumanArm* const hand = simulatedHumanArm(*device_);
  ASSERT_NE(hand, nullptr);
  ASSERT_TRUE(device_->arm());
  const double reach = 0.3 * device_->caps().workspace_radius;
  hand->setIntent(Pose(Vector3(reach, 0.0, 0.0)));
  DeviceCommand brake;
  brake.brake = true;
  for (int tick = 0; tick < 100; ++tick) cycle(brake);
  const double braked = read().X_DH.translation().x();
  for (int tick = 0; tick < 100; ++tick) cycle({});
  EXPECT_GT(read().X_DH.translation().x() - braked, 3.0 * braked);
}

TEST_P(Conformance, TurnsItsForcesOffWhenWritesStop) {
  ASSERT_TRUE(device_->arm());
  for (int tick = 0; tick < 10; ++tick) cycle(push(1.0));
  DeviceState state;
  for (int tick = 0; tick < 150; ++tick) state = read();
  EXPECT_FALSE(state.forces_on);
  EXPECT_EQ(state.fault, DeviceFault::kStale);
}

TEST_P(Conformance, AFaultStaysUntilAnOperatorResetsIt) {
  ASSERT_TRUE(device_->arm());
  for (int tick = 0; tick < 150; ++tick) read();
  const auto refused = device_->arm();
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find(device_->caps().model), std::string::npos) << refused.error().what;
  EXPECT_TRUE(device_->resetFault());
  EXPECT_EQ(read().fault, DeviceFault::kNone);
  EXPECT_FALSE(read().forces_on) << "a reset does not arm";
  EXPECT_TRUE(device_->arm());
  EXPECT_TRUE(read().forces_on);
}

TEST_P(Conformance, IgnoresANonFiniteForce) {
  ASSERT_TRUE(device_->arm());
  cycle(push(std::numeric_limits<double>::quiet_NaN()));
  for (int tick = 0; tick < 20; ++tick) EXPECT_TRUE(cycle({}).X_DH.isFinite());
}

TEST_P(Conformance, ReadsAndWritesWithoutAllocatingOrLocking) {
  ASSERT_TRUE(device_->arm());
  cycle(push(1.0));
  const test::RealtimeGuard guard;
  for (int tick = 0; tick < 1000; ++tick) cycle(push(1.0));
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

std::string nameOf(const testing::TestParamInfo<CatalogDevice>& device) {
  std::string name = device.param.name;
  for (char& c : name)
    if (c == '-') c = '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Catalog, Conformance, testing::ValuesIn(everyDevice()), nameOf);
INSTANTIATE_TEST_SUITE_P(Catalog, HeldDevice, testing::ValuesIn(everyHeldDevice()), nameOf);

}  // namespace
}  // namespace tenon::devices
