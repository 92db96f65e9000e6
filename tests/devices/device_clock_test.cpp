#include "devices/simulated/device_clock.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "devices/catalog.h"
#include "devices/simulated/sigma7.h"
#include "devices/simulated/simulated_device.h"
#include "idl/threads/clock.h"

namespace tenon::devices {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using threads::Nanoseconds;

/// Time passes by sleeping alone.
class SleepingClock final : public threads::Clock {
 public:
  [[nodiscard]] Nanoseconds now() const noexcept override { return now_; }
  void sleepUntil(Nanoseconds time, const std::atomic<bool>&) noexcept override {
    now_ = std::max(now_, time);
  }
  void interrupt() noexcept override {}
  void pass(Nanoseconds time) { now_ += time; }

 private:
  Nanoseconds now_ = milliseconds(5000);
};

struct OpenSigma {
  explicit OpenSigma(std::uint64_t seed = 1) : device(sigma7Model(), seed) {
    EXPECT_TRUE(device.open());
    device.addClock(clock, seed);
  }
  /// The time of the next reading, which is read.
  Nanoseconds next() {
    EXPECT_TRUE(device.awaitReading(milliseconds(3)));
    DeviceState state;
    device.read(state);
    return clock->now();
  }

  std::shared_ptr<SleepingClock> clock = std::make_shared<SleepingClock>();
  SimulatedDevice device;
};

TEST(DeviceClock, GivesAReadingEachMillisecondByACrystalOfItsOwn) {
  OpenSigma rig;
  ASSERT_TRUE(rig.device.paces());
  const Nanoseconds first = rig.next();
  Nanoseconds last = first;
  for (int i = 1; i <= 20'000; ++i) {
    const Nanoseconds now = rig.next();
    EXPECT_GE(now - last, microseconds(899));
    EXPECT_LE(now - last, microseconds(1101));
    last = now;
  }
  EXPECT_NEAR(std::chrono::duration<double>(last - first).count(), 20.0, 20.0 * 60e-6);
}

TEST(DeviceClock, IsWaitedForNoLongerThanAskedAndItsReadingStaysUntilItIsRead) {
  OpenSigma rig;
  rig.next();
  const Nanoseconds before = rig.clock->now();
  EXPECT_FALSE(rig.device.awaitReading(microseconds(300)));
  EXPECT_EQ(rig.clock->now() - before, microseconds(300));
  EXPECT_TRUE(rig.device.awaitReading(milliseconds(3)));
  const Nanoseconds there = rig.clock->now();
  EXPECT_TRUE(rig.device.awaitReading(milliseconds(3)));
  EXPECT_EQ(rig.clock->now(), there);
  DeviceState state;
  rig.device.read(state);
  EXPECT_FALSE(rig.device.awaitReading(microseconds(300))) << "that one was read";
}

TEST(DeviceClock, OfReadingsThatNobodyTookTheNewestIsLeft) {
  OpenSigma rig;
  rig.next();
  rig.clock->pass(milliseconds(10));
  EXPECT_TRUE(rig.device.awaitReading(milliseconds(3)));
  const Nanoseconds late = rig.next();
  EXPECT_GE(rig.next(), late + microseconds(1)) << "no burst";
  const Nanoseconds again = rig.next();
  EXPECT_GE(rig.next() - again, microseconds(899));
}

TEST(DeviceClock, RepeatsWithItsSeed) {
  OpenSigma one(3), same(3), other(4);
  std::vector<Nanoseconds> times, same_times, other_times;
  for (int i = 0; i < 50; ++i) {
    times.push_back(one.next());
    same_times.push_back(same.next());
    other_times.push_back(other.next());
  }
  EXPECT_EQ(times, same_times);
  EXPECT_NE(times, other_times);
}

TEST(DeviceClock, ADeviceThatIsUnpluggedIsNotWaitedFor) {
  OpenSigma rig;
  rig.device.unplug();
  const Nanoseconds before = rig.clock->now();
  EXPECT_FALSE(rig.device.awaitReading(milliseconds(3)));
  EXPECT_EQ(rig.clock->now(), before);
}

TEST(DeviceClock, IsThereWhereItIsAskedForAlsoBehindAMounting) {
  EXPECT_FALSE((*openDevice("sigma7-sim"))->paces());
  const DeviceConfiguration turned{.q_DM = Quaternion(0.0, 0.0, 0.0, 1.0), .paces = true};
  const auto device = std::move(*openDevice("sigma7-sim", turned));
  ASSERT_TRUE(device->paces());
  EXPECT_TRUE(device->awaitReading(std::chrono::seconds(100)));
  const auto pair = std::move(*openBimanualDevice("hug-sim", {.paces = true}));
  EXPECT_TRUE(pair->right().paces());
}

}  // namespace
}  // namespace tenon::devices
