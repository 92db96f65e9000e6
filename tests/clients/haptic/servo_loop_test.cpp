#include "clients/haptic/servo_loop.h"

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/lockstep_answers.h"
#include "tests/support/realtime_guard.h"

namespace tenon::haptic {
namespace {

constexpr HandId kServoHand{2};

/// A station of one hand whose force is given, and which says what it was told.
class ToldStation final : public Station {
 public:
  ToldStation() {
    SceneObject object;
    object.object = ObjectId{0};
    Welcome welcome;
    welcome.hands = {kServoHand};
    Station::welcome(welcome, std::vector<SceneObject>{object});
  }
  [[nodiscard]] std::vector<std::string> handNames() const override { return {"right"}; }
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  [[nodiscard]] Result<void> armDevices() override { return {}; }
  void setForceModel(ForceModelKind kind) noexcept override { model = kind; }
  void finish(bool disarms) noexcept override {
    finishing = true;
    disarmed = disarms;
  }
  [[nodiscard]] bool finished() const noexcept override { return finishing && steps_to_finish == 0; }
  void step(std::uint32_t seq) noexcept override {
    seq_ = seq;
    if (finishing && steps_to_finish > 0) --steps_to_finish;
    inputs_.clear();
    states_.clear();
    inputs_.push_back({.hand = kServoHand, .sample = {.seq = seq}});
    states_.push_back({.hand = kServoHand, .seq = seq});
    states_[0].F_Ho_W.force = Vector3(0, 0, force);
    if (force > 5.0) report(StationEventKind::kStale, kServoHand, 0, force);
    jitter = link_jitter_;
    round_trip = link_round_trip_;
  }

  double force = 0.0;       // [N] of the next step
  double jitter = 0.0;      // [s]
  double round_trip = 0.0;  // [s]
  int steps_to_finish = 3;
  bool finishing = false, disarmed = false;
  ForceModelKind model = ForceModelKind::kManifold;
  std::vector<Tick> manifolds = std::vector<Tick>(8);
  std::size_t heard = 0;

 protected:
  void begin(std::span<const HandId>) override {}
  void manifoldReceived(const HandManifold& manifold) noexcept override {
    manifolds[heard++ % manifolds.size()] = manifold.tick;
  }
  void armingChanged() noexcept override {}
};

struct ServoLoopOf {
  ToldStation station;
  int woken = 0;
  ServoLoop loop{station, [this] { ++woken; }};
};

TEST(ServoLoop, GivesTheStationWhatWasReceivedAndHandsOverItsNewestOutput) {
  ServoLoopOf rig;
  EXPECT_EQ(rig.loop.takeOutput(), nullptr);
  for (const Tick tick : {7U, 8U}) {
    HandManifold manifold;
    manifold.hand = kServoHand;
    manifold.tick = tick;
    rig.loop.receive(manifold);
  }
  rig.loop.setForceModel(ForceModelKind::kSceneCopy);
  rig.loop.setLink(0.01, 0.02);
  rig.loop.cycle();
  rig.loop.cycle();
  EXPECT_EQ(rig.station.heard, 2U);
  EXPECT_EQ(rig.station.manifolds[1], 8U);
  EXPECT_EQ(rig.station.model, ForceModelKind::kSceneCopy);
  EXPECT_EQ(rig.station.jitter, 0.01);
  EXPECT_EQ(rig.station.round_trip, 0.02);
  EXPECT_EQ(rig.woken, 2);
  const StationOutput* const output = rig.loop.takeOutput();
  ASSERT_NE(output, nullptr);
  EXPECT_EQ(output->seq, 2U);
  ASSERT_EQ(output->inputs.size(), 1U);
  EXPECT_EQ(output->inputs[0].sample.seq, 2U);
  EXPECT_EQ(rig.loop.takeOutput(), nullptr);
}

TEST(ServoLoop, APressThatCameBeforeARaiseIsNoAnswerToIt) {
  ServoLoopOf rig;
  rig.loop.press();
  rig.loop.receive(StopSignal{1, true});
  rig.loop.cycle();
  rig.loop.receive(StopSignal{1, false});
  rig.loop.cycle();
  EXPECT_FALSE(rig.station.arming().permitsForces());
  rig.loop.press();
  rig.loop.cycle();
  EXPECT_TRUE(rig.station.arming().permitsForces());
}

TEST(ServoLoop, OfTheForcesOfAllCyclesThePeakIsTakenOnce) {
  ServoLoopOf rig;
  for (const double force : {1.0, 9.0, 2.0}) {
    rig.station.force = force;
    rig.loop.cycle();
  }
  EXPECT_EQ(rig.loop.takePeak(0), 9.0F);
  EXPECT_EQ(rig.loop.takePeak(0), 0.0F);
  StationEvent event;
  ASSERT_TRUE(rig.loop.takeEvent(event));
  EXPECT_EQ(event.value, 9.0);
  EXPECT_FALSE(rig.loop.takeEvent(event));
}

TEST(ServoLoop, FinishesWhenTheStationHasAndMayBeginAgain) {
  for (const bool disarms : {true, false}) {
    ServoLoopOf rig;
    rig.loop.cycle();
    rig.loop.finish(disarms);
    for (int i = 0; i < 2; ++i) rig.loop.cycle();
    EXPECT_FALSE(rig.loop.finished()) << "its force is not yet away";
    rig.loop.cycle();
    EXPECT_TRUE(rig.loop.finished());
    EXPECT_EQ(rig.station.disarmed, disarms);
    rig.loop.restart();
    EXPECT_FALSE(rig.loop.finished());
  }
}

TEST(ServoLoop, ACycleAllocatesAndLocksNothing) {
  ServoLoopOf rig;
  HandManifold manifold;
  manifold.hand = kServoHand;
  rig.loop.receive(manifold);
  rig.loop.receive(StepState{});
  rig.loop.receive(StopSignal{});
  rig.loop.press();
  rig.station.force = 9.0;
  const test::RealtimeGuard guard;
  for (int i = 0; i < 2000; ++i) rig.loop.cycle();
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

TEST(ServoLoop, ServoAndWireThreadShareIt) {
  ServoLoopOf rig;
  std::atomic<bool> over{false};
  std::thread servo([&] {
    while (!over) rig.loop.cycle();
  });
  std::uint32_t newest = 0;
  HandManifold manifold;
  manifold.hand = kServoHand;
  for (int i = 0; i < 20'000 || newest < 100; ++i) {
    if (i >= 20'000) std::this_thread::yield();
    manifold.tick = static_cast<Tick>(i);
    rig.loop.receive(manifold);
    rig.loop.setLink(1e-6 * i, 1e-6 * (i % 3));
    static_cast<void>(rig.loop.takePeak(0));
    if (const StationOutput* const output = rig.loop.takeOutput()) {
      EXPECT_GT(output->seq, newest);
      newest = output->seq;
    }
  }
  rig.loop.finish(true);
  while (!rig.loop.finished()) std::this_thread::yield();
  over = true;
  servo.join();
  EXPECT_GT(newest, 0U);
}

TEST(LockstepAnswers, AreCompleteWithAllPartsAllManifoldsAndTheStepThatTheFramesName) {
  const std::vector<HandId> hands{HandId{0}, HandId{3}};
  LockstepAnswers answers;
  const auto frame = [](Tick tick, std::uint32_t part, std::uint32_t revision) {
    WorldFrame of_tick;
    of_tick.tick = tick;
    of_tick.part = part;
    of_tick.parts = 2;
    of_tick.step_revision = revision;
    return of_tick;
  };
  const auto manifold = [](Tick tick, HandId hand) {
    HandManifold of_tick;
    of_tick.tick = tick;
    of_tick.hand = hand;
    return of_tick;
  };
  EXPECT_FALSE(answers.complete(0, hands));
  answers.received(frame(5, 0, 1));
  answers.received(frame(5, 0, 1));
  answers.received(manifold(5, hands[0]));
  answers.received(manifold(5, hands[1]));
  StepState step;
  step.revision = 1;
  answers.received(step);
  EXPECT_FALSE(answers.complete(5, hands)) << "a part twice is one part";
  answers.received(frame(5, 1, 1));
  EXPECT_TRUE(answers.complete(5, hands));
  answers.received(frame(6, 0, 2));
  answers.received(frame(6, 1, 2));
  for (const HandId hand : hands) answers.received(manifold(6, hand));
  EXPECT_FALSE(answers.complete(6, hands)) << "without the step of revision 2";
  step.revision = 2;
  answers.received(step);
  EXPECT_TRUE(answers.complete(6, hands));
  answers.reset();
  EXPECT_FALSE(answers.complete(6, hands));
}

}  // namespace
}  // namespace tenon::haptic
