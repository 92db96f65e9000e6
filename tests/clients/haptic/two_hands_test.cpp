#include <array>
#include <deque>

#include <gtest/gtest.h>

#include "clients/haptic/coupling.h"
#include "clients/haptic/local_model.h"
#include "server/simulation/environment.h"
#include "tests/support/analytic_structures.h"

namespace tenon::haptic {
namespace {

constexpr double kHandsStiffness = 1000.0;  // [N/m] of each coupling
constexpr double kLever = 0.12;             // [m] from the centre of the bar to each hand
constexpr std::size_t kDelay = 2;           // [ticks] of network delay

//   left o======[   bar   ]======o right      one station per hand, two ticks of delay to the server
class TwoStations : public testing::Test {
 protected:
  TwoStations() {
    const auto pointer = test::sphereStructures(0.012, 0.002, 0.003);
    const auto scene = std::make_shared<simulation::Scene>();
    for (const char* name : {"left pointer", "right pointer", "bar"}) {
      simulation::ObjectSpec spec;
      spec.name = name;
      spec.structures = pointer;
      scene->objects.push_back(spec);
    }
    scene->objects[2].structures = test::boxStructures({0.3, 0.04, 0.04}, 0.004, 0.01);
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      simulation::HandSpec spec;
      spec.object = ObjectId{hand};
      spec.stiffness = kHandsStiffness;
      scene->hands.push_back(spec);
    }
    environment_ = std::make_unique<simulation::Environment>(scene, simulation::EnvironmentOptions{});
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

  struct HandStation {
    WorldView world;
    LocalModel model;
    Coupling coupling{CouplingOptions{.max_stiffness = 5000.0}};
    std::deque<HandManifold> in_transit;
    Wrench wrench;
  };

  /// One millisecond of the server and of both stations.
  void tick() {
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      environment_->setHandPose(HandId{hand}, X_WH_[hand], {});
    }
    environment_->step();
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      HandStation& station = stations_[hand];
      station.in_transit.emplace_back();
      environment_->manifold(HandId{hand}, station.in_transit.back());
      if (station.in_transit.size() > kDelay) {
        station.model.receive(station.in_transit.front());
        station.in_transit.pop_front();
      }
      station.wrench =
          station.coupling.step(station.model.step(X_WH_[hand], station.world), X_WH_[hand], kTickSeconds);
    }
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  void move(std::uint32_t hand, const Vector3& translation, const Vector3& rotation, int ticks) {
    const Pose start = X_WH_[hand];
    for (int i = 1; i <= ticks; ++i) {
      const double fraction = static_cast<double>(i) / ticks;
      X_WH_[hand] = displaced(start, {fraction * translation, fraction * rotation});
      tick();
    }
  }
  [[nodiscard]] const Wrench& serverWrench(std::uint32_t hand) const {
    return environment_->hands()[hand].F_Ho_W;
  }
  void expectRenderedAsByServer() {
    for (std::uint32_t hand = 0; hand < 2; ++hand) {
      const Wrench& rendered = stations_[hand].wrench;
      EXPECT_LE((rendered.force - serverWrench(hand).force).norm(),
                0.02 * serverWrench(hand).force.norm() + 1e-3)
          << hand;
      EXPECT_LE((rendered.torque - serverWrench(hand).torque).norm(),
                0.02 * serverWrench(hand).torque.norm() + 1e-3)
          << hand;
    }
  }

  std::unique_ptr<simulation::Environment> environment_;
  std::array<HandStation, 2> stations_;
  std::array<Pose, 2> X_WH_;
};

TEST_F(TwoStations, EachHandFeelsTheOthersForce) {
  move(1, {0.01, 0.0, 0.0}, Vector3::Zero(), 200);
  run(200);
  EXPECT_NEAR(stations_[0].wrench.force.x(), 5.0, 0.1);
  EXPECT_NEAR(stations_[1].wrench.force.x(), -5.0, 0.1);
  expectRenderedAsByServer();
}

TEST_F(TwoStations, EachHandFeelsTheOthersTorque) {
  move(1, Vector3::Zero(), {0.0, 0.0, 0.1}, 200);
  run(200);
  EXPECT_GT(std::abs(stations_[0].wrench.torque.z()), 0.05);
  expectRenderedAsByServer();
}

//   the right hand lifts its end: the bar tilts and exerts a torque on the left hand
TEST_F(TwoStations, EachHandFeelsTheTiltWhenTheOtherLiftsItsEnd) {
  move(1, {0.0, 0.0, 0.02}, Vector3::Zero(), 200);
  run(200);
  EXPECT_GT(std::abs(stations_[0].wrench.torque.y()), 0.05);
  expectRenderedAsByServer();
}

TEST_F(TwoStations, AfterAReleaseTheForceOnTheOtherHandFallsByAtMostOneNewtonPerTick) {
  move(1, {0.01, 0.0, 0.0}, Vector3::Zero(), 200);
  run(200);
  environment_->release(HandId{1});
  double before = stations_[0].wrench.force.norm();
  for (int i = 0; i < 100; ++i) {
    tick();
    const double now = stations_[0].wrench.force.norm();
    EXPECT_LE(now, before + 1e-6) << i;
    EXPECT_GE(now, before - 1.0) << i;
    before = now;
  }
  EXPECT_LE(before, 1e-3);
}

TEST_F(TwoStations, AContributedForceIsFeltAtTheHandsThatHoldTheObject) {
  constexpr std::uint32_t kLifetime = 100;
  const Wrench F_Oo_W{Vector3(0.0, 0.0, 10.0), Vector3(0.0, 0.3, 0.0)};
  for (int i = 0; i < 300; ++i) {
    environment_->contribute(ObjectId{2}, 1, F_Oo_W, kLifetime);
    tick();
  }
  const double share = 0.5 * 10.0 * (1.0 - 1.0 / kLifetime);
  EXPECT_NEAR(0.5 * (stations_[0].wrench.force.z() + stations_[1].wrench.force.z()), share, 0.1);
  EXPECT_GT(stations_[1].wrench.force.z() + 0.1, share - 0.3 / (2.0 * kLever)) << "and its torque";
  expectRenderedAsByServer();
  run(static_cast<int>(kLifetime) + 300);
  for (const HandStation& station : stations_) EXPECT_LT(station.wrench.force.norm(), 1e-2) << "it has ended";
}

TEST_F(TwoStations, AManifoldTellsWhichHandsHoldTheObject) {
  HandManifold manifold;
  environment_->manifold(HandId{0}, manifold);
  ASSERT_EQ(manifold.others.size(), 1U);
  EXPECT_EQ(manifold.others[0].hand, HandId{1});
  environment_->release(HandId{1});
  environment_->step();
  environment_->manifold(HandId{0}, manifold);
  // what it holds instead is close by: told, but no pull on this object
  for (const HandPull& pull : manifold.others) EXPECT_NE(pull.object, manifold.object);
}

}  // namespace
}  // namespace tenon::haptic
