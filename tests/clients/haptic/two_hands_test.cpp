#include <array>
#include <deque>

#include <gtest/gtest.h>

#include "clients/haptic/coupling.h"
#include "clients/haptic/local_model.h"
#include "server/simulation/environment.h"
#include "tests/support/analytic_structures.h"

namespace tenon {
namespace {

constexpr double kStiffness = 1000.0;  // [N/m] of each hand
constexpr double kLever = 0.12;        // [m] of each hand from the middle
constexpr std::size_t kDelay = 2;      // [ticks] of the network

//   left o======[   bar   ]======o right      a station at each hand, two ticks away from the server
class TwoStations : public testing::Test {
 protected:
  TwoStations() {
    const auto pointer = test::sphereStructures(0.012, 0.002, 0.003);
    const auto scene = std::make_shared<Scene>();
    for (const char* name : {"left pointer", "right pointer", "bar"}) {
      ObjectSpec spec;
      spec.name = name;
      spec.structures = pointer;
      scene->objects.push_back(spec);
    }
    scene->objects[2].structures = test::boxStructures({0.3, 0.04, 0.04}, 0.004, 0.01);
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      HandSpec spec;
      spec.object = ObjectId{hand};
      spec.stiffness = kStiffness;
      scene->hands.push_back(spec);
    }
    environment_ = std::make_unique<Environment>(scene, EnvironmentOptions{});
    std::vector<SceneObject> objects(3);
    for (std::uint32_t i = 0; i < 3; ++i) objects[i].object = ObjectId{i};
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      X_WH_[hand] = Pose(Vector3(hand == 0 ? -kLever : kLever, 0.0, 0.0));
      environment_->setHandPresent(HandId{hand}, true);
      environment_->setHandPose(HandId{hand}, X_WH_[hand], {});
      environment_->grab(HandId{hand}, ObjectId{2});
      stations_[hand].world.begin(objects, 0, 0);
    }
    run(200);
  }

  struct Station {
    WorldView world;
    LocalModel model;
    Coupling coupling{CouplingOptions{.max_stiffness = 5000.0}};
    std::deque<HandManifold> on_the_way;
    Wrench felt;
  };

  /// One millisecond of the server and of both stations.
  void tick() {
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      environment_->setHandPose(HandId{hand}, X_WH_[hand], {});
    }
    environment_->step();
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      Station& station = stations_[hand];
      station.on_the_way.emplace_back();
      environment_->manifold(HandId{hand}, station.on_the_way.back());
      if (station.on_the_way.size() > kDelay) {
        station.model.receive(station.on_the_way.front());
        station.on_the_way.pop_front();
      }
      station.felt =
          station.coupling.step(station.model.step(X_WH_[hand], station.world), X_WH_[hand], kTickSeconds);
    }
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  void move(std::uint32_t hand, const Vector3& way, const Vector3& turn, int ticks) {
    const Pose start = X_WH_[hand];
    for (int i = 1; i <= ticks; ++i) {
      const double share = static_cast<double>(i) / ticks;
      X_WH_[hand] = displaced(start, {share * way, share * turn});
      tick();
    }
  }
  [[nodiscard]] const Wrench& served(std::uint32_t hand) const { return environment_->hands()[hand].F_Ho_W; }
  void expectFeltAsServed() {
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      const Wrench& felt = stations_[hand].felt;
      EXPECT_LE((felt.force - served(hand).force).norm(), 0.02 * served(hand).force.norm() + 1e-3) << hand;
      EXPECT_LE((felt.torque - served(hand).torque).norm(), 0.02 * served(hand).torque.norm() + 1e-3) << hand;
    }
  }

  std::unique_ptr<Environment> environment_;
  std::array<Station, 2> stations_;
  std::array<Pose, 2> X_WH_;
};

TEST_F(TwoStations, EachFeelsTheOtherPull) {
  move(1, {0.01, 0.0, 0.0}, Vector3::Zero(), 200);
  run(200);
  EXPECT_NEAR(stations_[0].felt.force.x(), 5.0, 0.1);
  EXPECT_NEAR(stations_[1].felt.force.x(), -5.0, 0.1);
  expectFeltAsServed();
}

TEST_F(TwoStations, EachFeelsTheOtherTurn) {
  move(1, Vector3::Zero(), {0.0, 0.0, 0.1}, 200);
  run(200);
  EXPECT_GT(std::abs(stations_[0].felt.torque.z()), 0.05);
  expectFeltAsServed();
}

//   the right hand lifts its end: the bar leans, and the left one feels it in its wrist
TEST_F(TwoStations, EachFeelsTheOtherLiftItsEnd) {
  move(1, {0.0, 0.0, 0.02}, Vector3::Zero(), 200);
  run(200);
  EXPECT_GT(std::abs(stations_[0].felt.torque.y()), 0.05);
  expectFeltAsServed();
}

TEST_F(TwoStations, WhenOneLetsGoTheForceOnTheOtherFallsByStepsOfANewton) {
  move(1, {0.01, 0.0, 0.0}, Vector3::Zero(), 200);
  run(200);
  environment_->release(HandId{1});
  double before = stations_[0].felt.force.norm();
  for (int i = 0; i < 100; ++i) {
    tick();
    const double now = stations_[0].felt.force.norm();
    EXPECT_LE(now, before + 1e-6) << i;
    EXPECT_GE(now, before - 1.0) << i;
    before = now;
  }
  EXPECT_LE(before, 1e-3);
}

TEST_F(TwoStations, AManifoldListsNobodyElseWhenNobodyElseHolds) {
  HandManifold manifold;
  environment_->manifold(HandId{0}, manifold);
  ASSERT_EQ(manifold.others.size(), 1U);
  EXPECT_EQ(manifold.others[0].hand, HandId{1});
  environment_->release(HandId{1});
  environment_->step();
  environment_->manifold(HandId{0}, manifold);
  EXPECT_TRUE(manifold.others.empty());
}

}  // namespace
}  // namespace tenon
