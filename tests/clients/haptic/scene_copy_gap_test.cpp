#include <algorithm>
#include <deque>
#include <memory>

#include <gtest/gtest.h>

#include "clients/haptic/haptic_hand.h"
#include "devices/simulated/sigma7.h"
#include "tests/clients/haptic/delayed_station.h"
#include "tests/clients/rehearse/path_device.h"

// A gap of a long link while the force is that of the station's copy of the scene.

namespace tenon::haptic {
namespace {

constexpr Tick kLongWay = 100;        // [ticks] one way
constexpr double kPressed = 4e-3;     // [m] into the table
constexpr double kBelow = 8e-3;       // [m] beside it
constexpr double kOffTheEdge = 0.05;  // [m] where block and table are 10 mm apart

/// A block in the hand over a table of its size.
std::shared_ptr<const simulation::Scene> blockOverTable() {
  test::SmallScene small;
  const auto cube = test::boxShape(Vector3::Constant(test::kEdge));
  const ObjectId block = small.object("block", cube, {0.025, 0.0, 0.03});
  const ObjectId table = small.object("table", cube, {0.0, 0.0, -0.5 * test::kEdge}, ObjectStatus::kFixed);
  small.hand("right", block);
  small.pair(block, table);
  auto scene = std::make_shared<simulation::Scene>(*small.build());
  scene->hands[0].stiffness = test::kStiffness;
  return scene;
}

/// Until its hand is where a path brings it, `kLongWay` from its server.
class HandOverTable {
 public:
  explicit HandOverTable(const test::PathDevice::Path& path)
      : scene_(blockOverTable()),
        device_(devices::sigma7Model(),
                [=](double t) { return Pose(path(t).translation() - path(0.0).translation()); }),
        hand(device_),
        server_(scene_, kLongWay, {}) {
    hand.setCopy(std::make_unique<SceneCopy>(scene_));
    hand.setForceModel(ForceModelKind::kSceneCopy);
    hand.setLinkRoundTrip(2.0 * kLongWay * kTickSeconds);
    hand.begin(test::kRight, ClientId{1}, path(0.0).translation(), true);
    EXPECT_TRUE(hand.armDevice());
    hand.handBack();
  }
  void tick() {
    const std::uint32_t seq =
        server_.deliver([this](const HandManifold& manifold) { hand.receive(manifold); });
    hand.step(seq, server_.world(), kTickSeconds);
    server_.step(hand.input().sample.X_WH, hand.input().sample.V_WH, Vector3::Zero());
  }
  void tickUntil(double t) {
    while (device_.now() < t) tick();
  }
  void setSilent(bool is_silent) { server_.is_silent = is_silent; }
  [[nodiscard]] double force() const { return hand.state().F_Ho_W.force.norm(); }
  [[nodiscard]] bool fades() const {
    return (hand.state().safety_flags & devices::bit(devices::SafetyRule::kAgeFading)) != 0;
  }

 private:
  std::shared_ptr<const simulation::Scene> scene_;
  test::PathDevice device_;

 public:
  HapticHand hand;

 private:
  test::DelayedServer server_;
};

/// Comes down to the table within a second, and presses.
double heightAt(double t) {
  return 0.5 * test::kEdge + 0.01 - (0.01 + kPressed) * std::clamp(t - 0.5, 0.0, 1.0);
}

//   [block]->          the hand slides off the table's edge and moves on, 8 mm below its top, all of it while
//   [ table ] |        the server's last word, which lists the top, is on its way
//             v
TEST(ForceReturnOfCopy, AGapBesideAnEdgeBringsNoForceOfTheServersOldContacts) {
  constexpr double kSlide = 3.5, kSlid = 3.6, kDown = 3.65;  // [s]
  HandOverTable setup([](double t) {
    const double slid = std::clamp((t - kSlide) / (kSlid - kSlide), 0.0, 1.0);
    const double down = std::clamp((t - kSlid) / (kDown - kSlid), 0.0, 1.0);
    return Pose(Vector3(0.025 + (kOffTheEdge - 0.025) * slid, 0.0, heightAt(t) - (kBelow - kPressed) * down));
  });
  setup.tickUntil(kSlide);
  ASSERT_EQ(setup.hand.forceModel(), ForceModelKind::kSceneCopy);
  ASSERT_GT(setup.force(), 1.0) << "it presses";
  setup.setSilent(true);
  setup.tickUntil(kDown + 0.02);
  ASSERT_LT(setup.force(), 0.2) << "nothing is below it";
  ASSERT_FALSE(setup.fades()) << "the gap is still to come";
  int faded = 0;
  for (int i = 0; i < 1000; ++i) {
    setup.tick();
    ASSERT_LT(setup.force(), 0.2) << i << " ms later";
    faded += setup.fades() ? 1 : 0;
  }
  EXPECT_GT(faded, 500);
  setup.setSilent(false);
  for (int i = 0; i < 2000; ++i) {
    setup.tick();
    ASSERT_LT(setup.force(), 0.2) << i << " ms after the gap";
  }
  EXPECT_EQ(setup.hand.forceModel(), ForceModelKind::kSceneCopy);
}

TEST(ForceReturnOfCopy, AfterAGapIsSoft) {
  HandOverTable setup([](double t) { return Pose(Vector3(0.025, 0.0, heightAt(t))); });
  setup.tickUntil(4.0);
  const double before = setup.force();
  ASSERT_GT(before, 1.0);
  setup.setSilent(true);
  double last = before;
  for (int i = 0; i < 800; ++i) {
    setup.tick();
    ASSERT_EQ(setup.hand.forceModel(), ForceModelKind::kSceneCopy) << i << " ms into the gap";
    ASSERT_LE(setup.force(), last + 0.05) << i << " ms into the gap";
    last = setup.force();
  }
  EXPECT_EQ(setup.force(), 0.0);
  setup.setSilent(false);
  constexpr std::size_t kWithin = 20;  // [ms]
  std::deque<double> forces;
  for (int i = 0; i < 3000; ++i) {
    setup.tick();
    forces.push_back(setup.force());
    ASSERT_LE(forces.back(), std::max(before, 3.0)) << i << " ms after the gap";
    if (forces.size() <= kWithin) continue;
    ASSERT_LE(forces.back() - forces.front(), (20.0 + 0.5) * kWithin * kTickSeconds) << i;
    forces.pop_front();
  }
  EXPECT_EQ(setup.hand.forceModel(), ForceModelKind::kSceneCopy);
}

}  // namespace
}  // namespace tenon::haptic
