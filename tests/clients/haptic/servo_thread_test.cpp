#include "clients/haptic/servo_thread.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/threads/virtual_clock.h"

namespace tenon::haptic {
namespace {

using std::chrono::microseconds;
using testing::ElementsAre;
using threads::Nanoseconds;

/// A station whose device has readings at given times of a virtual clock; it notes its steps.
class PacedStation final : public Station {
 public:
  PacedStation(std::shared_ptr<threads::VirtualClock> clock, std::vector<Nanoseconds> readings)
      : clock_(std::move(clock)), readings_(std::move(readings)) {}
  [[nodiscard]] std::vector<std::string> handNames() const override { return {"right"}; }
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  [[nodiscard]] Result<void> armDevices() override { return {}; }
  [[nodiscard]] std::string pacedBy() const override { return readings_.empty() ? "" : "a device"; }
  [[nodiscard]] bool awaitReading(Nanoseconds longest) noexcept override {
    const Nanoseconds until = clock_->now() + longest;
    const Nanoseconds next = taken_ < readings_.size() ? readings_[taken_] : Nanoseconds::max();
    clock_->sleepUntil(std::min(until, next), over_);
    return clock_->now() >= next;
  }
  void step(std::uint32_t seq) noexcept override {
    seq_ = seq;
    while (taken_ < readings_.size() && readings_[taken_] <= clock_->now()) ++taken_;
    const std::lock_guard<std::mutex> lock(mutex_);
    times_.push_back(clock_->now() / microseconds(1));
    cycles_.push_back(dt_);
  }
  void finish(bool) noexcept override { over_ = true; }

  /// [us] of each step.
  [[nodiscard]] std::vector<long> times() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return times_;
  }
  /// [s] that each step was told it took.
  [[nodiscard]] std::vector<double> cycles() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return cycles_;
  }

 protected:
  void begin(std::span<const HandId>) override {}
  void manifoldReceived(const HandManifold&) noexcept override {}
  void armingChanged() noexcept override {}

 private:
  std::shared_ptr<threads::VirtualClock> clock_;
  std::vector<Nanoseconds> readings_;
  std::size_t taken_ = 0;
  std::atomic<bool> over_{false};
  std::mutex mutex_;
  std::vector<long> times_;
  std::vector<double> cycles_;
};

struct PacedLoop {
  explicit PacedLoop(std::vector<long> readings) : station(clock, inNanoseconds(readings)) {
    thread.start();
    clock->waitUntilAsleep();
  }
  ~PacedLoop() {
    thread.loop().finish(true);
    clock->advance(microseconds(5000));
    thread.stop(true);
  }
  static std::vector<Nanoseconds> inNanoseconds(const std::vector<long>& us) {
    std::vector<Nanoseconds> times;
    for (const long time : us) times.emplace_back(microseconds(time));
    return times;
  }
  void runUntil(long us) {
    while (clock->now() < microseconds(us)) {
      clock->advance(microseconds(50));
      clock->waitUntilAsleep();
    }
  }

  std::shared_ptr<threads::VirtualClock> clock = std::make_shared<threads::VirtualClock>();
  PacedStation station;
  ServoThread thread{station, [] {}, false, clock};
};

TEST(ServoThread, ACycleBeginsWithEachReadingOfTheDeviceThatPaces) {
  PacedLoop rig({1100, 2250, 3150, 4200, 5050});
  rig.runUntil(5050);
  EXPECT_THAT(rig.station.times(), ElementsAre(1100, 2250, 3150, 4200, 5050));
  const std::vector<double> cycles = rig.station.cycles();
  ASSERT_EQ(cycles.size(), 5U);
  for (const auto& [cycle, seconds] :
       std::vector<std::pair<std::size_t, double>>{{1, 1150e-6}, {2, 900e-6}, {3, 1050e-6}, {4, 850e-6}})
    EXPECT_NEAR(cycles[cycle], seconds, 1e-12) << "what the rules are told";
  EXPECT_EQ(rig.thread.lateCycles(), 0U);
}

TEST(ServoThread, AReadingThatIsEarlyWaitsForThreeQuartersOfAPeriod) {
  PacedLoop rig({1000, 1200, 1300, 2900});
  rig.runUntil(3000);
  EXPECT_THAT(rig.station.times(), ElementsAre(1000, 1750, 2900)) << "of two readings the newest";
}

//  readings  1  2 . . . . . . . 9.3  10.4
//  cycles    1  2     5 6 7 8 9  9.75 10.5
TEST(ServoThread, ADeviceThatIsSilentIsWaitedForThenTheClockPacesUntilItHasAReading) {
  PacedLoop rig({1000, 2000, 9300, 10400});
  rig.runUntil(9000);
  EXPECT_THAT(rig.station.times(), ElementsAre(1000, 2000, 5000, 6000, 7000, 8000, 9000));
  EXPECT_NEAR(rig.station.cycles()[2], 0.003, 1e-12);
  EXPECT_EQ(rig.thread.lateCycles(), 1U);
  rig.runUntil(10'600);
  EXPECT_THAT(rig.station.times(), ElementsAre(1000, 2000, 5000, 6000, 7000, 8000, 9000, 9750, 10'500));
}

TEST(ServoThread, WithoutADeviceThatPacesTheClockDoes) {
  PacedLoop rig({});
  rig.runUntil(4000);
  EXPECT_THAT(rig.station.times(), ElementsAre(1000, 2000, 3000, 4000));
}

}  // namespace
}  // namespace tenon::haptic
