#include "clients/haptic/arming_thread.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/station_program.h"

namespace tenon::haptic {
namespace {

/// A station with a device that answers once it is told to, or after ten seconds.
class SlowStation final : public Station {
 public:
  [[nodiscard]] std::vector<std::string> handNames() const override { return {}; }
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  void step(std::uint32_t) noexcept override {}
  [[nodiscard]] bool wantsArming() const noexcept override { return wants; }
  [[nodiscard]] Result<void> armDevices() override {
    ++armings;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!answers && std::chrono::steady_clock::now() < until) std::this_thread::yield();
    wants = false;
    return fail("the device is not there");
  }

  std::atomic<bool> wants = true, answers = false;
  std::atomic<int> armings = 0;

 protected:
  void begin(std::span<const HandId>) override {}
  void manifoldReceived(const HandManifold&) noexcept override {}
  void armingChanged() noexcept override {}
};

TEST(ArmingThread, TheCallerHearsAStopWhileADeviceDoesNotAnswer) {
  SlowStation station;
  std::string printed;
  ArmingThread arming(station, [&](const std::string& text) { printed = text; });
  arming.start();
  EXPECT_TRUE(arming.isUnderWay());
  arming.start();
  int heard = 0;
  arming.await([&] {
    if (++heard == 3) station.answers = true;
    std::this_thread::yield();
  });
  EXPECT_GE(heard, 3);
  EXPECT_EQ(station.armings, 1) << "one at a time";
  EXPECT_EQ(printed, "the device is not there");
  arming.start();
  EXPECT_FALSE(arming.isUnderWay()) << "there is nothing to arm";
  station.wants = true;
  arming.start();
  arming.await([] { std::this_thread::yield(); });
  EXPECT_EQ(station.armings, 2);
}

//   the first one ends the program in its own time, for which it may have to wait for a device
TEST(StationProgram, ASecondSignalEndsItWhileItWaitsForADevice) {
  const auto signalTwice = [](int first, int second) {
    const std::atomic<bool>& stop = stopSignal();
    std::raise(first);
    std::raise(first);  // while forces are taken away, none ends it
    if (!stop) return;
    endAtNextSignal();
    std::raise(second);
  };
  EXPECT_EXIT(signalTwice(SIGINT, SIGINT), testing::KilledBySignal(SIGINT), "");
  EXPECT_EXIT(signalTwice(SIGTERM, SIGINT), testing::KilledBySignal(SIGINT), "");
}

}  // namespace
}  // namespace tenon::haptic
