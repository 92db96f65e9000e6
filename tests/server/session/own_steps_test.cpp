#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/shapes.h"
#include "server/session/scene_loader.h"
#include "server/simulation/environment.h"
#include "tests/support/test_meshes.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using simulation::Environment;

constexpr HandId kRight{0};
constexpr HandId kLeft{1};

/// Objects of the scenarios below.
constexpr ObjectId kWall{0};
constexpr ObjectId kPart{1};
constexpr ObjectId kDrill{2};

/// Scenarios of a fixed wall, a part in the right hand and a drill in the left one, loaded as a server loads
/// them.
class OwnSteps : public ::testing::Test {
 protected:
  ~OwnSteps() override { fs::remove_all(folder_); }

  /// `wall`, `part` and `drill` are meshes of a scenario.
  std::shared_ptr<const simulation::Scene> load(const std::string& wall, const std::string& part,
                                                const std::string& drill, int wall_voxel_mm = 2) {
    fs::create_directories(folder_);
    const std::string structures = "structures: {voxel: 2 mm, spacing: 4 mm, refinement: 1}";
    std::ofstream(folder_ / "scenario.yaml")
        << "objects:\n  - {name: wall, status: fixed, meshes: [" << wall << "], "
        << fmt::format("structures: {{voxel: {} mm, spacing: 10 mm, refinement: 1}}}}\n", wall_voxel_mm)
        << "  - {name: part, meshes: [" << part << "], " << structures << ", start: {at: [0, 0, 0.5]}}\n"
        << "  - {name: drill, meshes: [" << drill << "], " << structures << ", start: {at: [0, 0, 0.9]}}\n"
        << "hands: [{name: right, object: part}, {name: left, object: drill}]\n"
        << "states: [{name: wait, conditions: [{command: fulfilled}]}]\n";
    const auto loaded = loadScene(folder_ / "scenario.yaml", {.cache = folder_ / "cache"});
    EXPECT_TRUE(loaded) << (loaded ? "" : loaded.error().what);
    return loaded ? loaded->scene : nullptr;
  }

  fs::path folder_ = fs::temp_directory_path() / fmt::format("tenon_own_steps_{}", getpid());
};

void place(Environment& environment, HandId hand, const Pose& X_WH) {
  environment.setHandPresent(hand, true);
  environment.setHandPose(hand, X_WH, {});
}

/// [m] How far any point of a hand's own object, within `radius` [m] of its frame, is from where it belongs.
double lagOf(const Environment& environment, HandId hand, double radius) {
  const simulation::HandMotion& motion = environment.hands()[hand.value];
  return maxPointMotion(
      displacement(environment.objects()[motion.object.value].X_WO, motion.X_WH * motion.X_HO), radius);
}

/// [m] Smallest gap of the pair of two objects; large when it is not near.
double gapOf(const Environment& environment, ObjectId a, ObjectId b) {
  double gap = 1.0;
  for (const std::uint32_t pair : environment.nearPairs()) {
    PairContact contact;
    environment.pairContact(pair, contact);
    const bool is = (contact.a == a && contact.b == b) || (contact.a == b && contact.b == a);
    if (is && environment.pairs()[pair].result != nullptr) gap = std::min(gap, contact.gap);
  }
  return gap;
}

/// From -1 to 1 and back at constant speed, in `period` ticks.
double swing(int tick, int period) {
  const double phase = std::fmod(static_cast<double>(tick) / period, 1.0);
  return phase < 0.5 ? 4.0 * phase - 1.0 : 3.0 - 4.0 * phase;
}

//        |   drill: at 2.5 m/s up and down beside the arm, and 30 mm into the wall
//   _    |
//  | |_______   part, an angle whose ball contains the drill: at 0.5 m/s, 5 mm above the wall or pressed on
//  it
//  |_________|
//  ============ wall
struct AngleAndDrill {
  static constexpr const char* kWallMesh = "{box: [800 mm, 400 mm, 20 mm], at: [0, 0, -10 mm]}";
  static constexpr const char* kPartMesh =
      "{box: [20 mm, 60 mm, 200 mm], at: [-90 mm, 0, 90 mm]}, {box: [200 mm, 60 mm, 20 mm]}";
  static constexpr const char* kDrillMesh = "{box: [20 mm, 20 mm, 120 mm]}";
  static constexpr double kRadius = 0.25;  // [m] of the angle about its frame

  /// `height` [m] of the part's lower face above the wall.
  static Pose rightAt(int tick, double height) {
    return Pose(Vector3(0.05 * swing(tick, 400), 0.0, 0.01 + height));
  }
  /// Beside the part, `y` [m] from its middle; it starts above.
  static Pose leftAt(int tick, double y) {
    return Pose(Vector3(0.0, y, 0.18 + 0.15 * swing(tick + 120, 240)));
  }
};

TEST_F(OwnSteps, AHandInFreeAirDoesNotLagWhileAnotherMovesFastBesideItAndHitsAWall) {
  using Rig = AngleAndDrill;
  const auto scene = load(Rig::kWallMesh, Rig::kPartMesh, Rig::kDrillMesh);
  ASSERT_TRUE(scene);
  Environment environment(scene, {});
  int pressed = 0;
  for (int tick = 0; tick < 2000; ++tick) {
    place(environment, kRight, Rig::rightAt(tick, 0.005));
    place(environment, kLeft, Rig::leftAt(tick, 0.05));
    environment.step();
    ASSERT_EQ(lagOf(environment, kRight, Rig::kRadius), 0.0) << "tick " << tick;
    ASSERT_TRUE(environment.hands()[kRight.value].F_Ho_W.force.isZero(1e-12)) << "tick " << tick;
    pressed += environment.inContact(kDrill, kWall) ? 1 : 0;
  }
  EXPECT_GT(pressed, 100) << "the drill hits the wall";
  EXPECT_LT(pressed, 1000) << "and is in free air too";
}

TEST_F(OwnSteps, WhatAnotherHandDoesChangesNotOneBit) {
  using Rig = AngleAndDrill;
  const auto scene = load(Rig::kWallMesh, Rig::kPartMesh, Rig::kDrillMesh);
  ASSERT_TRUE(scene);
  Environment alone(scene, {});
  Environment beside(scene, {});
  int pressed = 0;
  for (int tick = 0; tick < 2000; ++tick) {
    // on the wall and off it
    const Pose X_WH = Rig::rightAt(tick, 0.004 * swing(tick + 350, 700));
    place(alone, kRight, X_WH);
    place(beside, kRight, X_WH);
    place(alone, kLeft, Pose(Vector3(0.3, 0.3, 0.9)));
    place(beside, kLeft, Rig::leftAt(tick, 0.1));
    alone.step();
    beside.step();
    ASSERT_EQ(alone.objects()[kPart.value].X_WO, beside.objects()[kPart.value].X_WO) << "tick " << tick;
    ASSERT_EQ(alone.hands()[kRight.value].F_Ho_W.force, beside.hands()[kRight.value].F_Ho_W.force);
    ASSERT_EQ(alone.hands()[kRight.value].F_Ho_W.torque, beside.hands()[kRight.value].F_Ho_W.torque);
    pressed += alone.inContact(kPart, kWall) ? 1 : 0;
  }
  EXPECT_GT(pressed, 500);
  EXPECT_LT(pressed, 1800);
}

//   | drill -> at 3 m/s past the part, 4 mm beside it
//   part, pressed 10 mm into the wall: both may meet in a tick, but do not
TEST_F(OwnSteps, AHandIsFreeBesideOneThatIsBlocked) {
  const auto scene = load("{box: [800 mm, 400 mm, 20 mm], at: [0, 0, -10 mm]}",
                          "{box: [40 mm, 40 mm, 40 mm]}", "{box: [20 mm, 20 mm, 20 mm]}");
  ASSERT_TRUE(scene);
  Environment environment(scene, {});
  Vector3 rest = Vector3::Zero();
  constexpr int kSettle = 200;
  for (int tick = 0; tick < 1000; ++tick) {
    place(environment, kRight, Pose(Vector3(0.0, 0.0, 0.03 - std::min(tick, kSettle) * 1e-4)));
    const double x = tick < kSettle ? -0.2 : 0.2 * swing(tick - kSettle, 268);
    place(environment, kLeft, Pose(Vector3(x, 0.034, 0.05)));
    environment.step();
    ASSERT_EQ(lagOf(environment, kLeft, 0.02), 0.0) << "tick " << tick;
    const Vector3& p_WO = environment.objects()[kPart.value].X_WO.translation();
    if (tick == kSettle + 50) rest = p_WO;
    if (tick > kSettle + 50) {
      ASSERT_LT((p_WO - rest).norm(), 1e-6) << "tick " << tick;
    }
  }
  EXPECT_TRUE(environment.inContact(kPart, kWall));
  EXPECT_NEAR(environment.hands()[kRight.value].F_Ho_W.force.z(), 10.0, 2.0);
}

//   bar  |  at 0.5 to 3 m/s down through the plate and sideways off it
//   _____v_____
//  |___plate___|   held too, its device at rest
TEST_F(OwnSteps, PartsThatComeFreeReturnToTheirHandsWithinTheirReach) {
  const auto scene = load("{box: [10 mm, 10 mm, 10 mm], at: [2, 0, 0]}", "{box: [300 mm, 20 mm, 20 mm]}",
                          "{box: [150 mm, 150 mm, 20 mm]}");
  ASSERT_TRUE(scene);
  constexpr double kSpare = 1.05e-3;  // [m] each tick beside the motion of a hand, and rounding
  std::mt19937 engine(1);
  const auto between = [&engine](double low, double high) {
    return low + (high - low) * static_cast<double>(engine()) / 4294967296.0;
  };
  double lag = 0.0;
  for (int run = 0; run < 24; ++run) {
    const double speed = std::array{0.5, 1.0, 2.0, 3.0}[static_cast<std::size_t>(run % 4)];
    const Vector3 above(between(-0.1, 0.1), between(-0.06, 0.06), 0.08);
    const Vector3 below(above.x(), above.y(), between(-0.1, -0.03));
    const Vector3 beside = below + Vector3(between(-0.3, 0.3), between(-0.2, 0.2), 0.0);
    Environment environment(scene, {});
    Vector3 goal = above;
    int tick = 0;
    for (const Vector3& end : {below, beside, above}) {
      const Vector3 start = goal;
      const int ticks = static_cast<int>((end - start).norm() / (speed * kTickSeconds)) + 1;
      for (int i = 1; i <= ticks; ++i, ++tick) {
        const Vector3 before = goal;
        goal = start + (end - start) * i / ticks;
        place(environment, kRight, Pose(goal));
        place(environment, kLeft, Pose());
        const Pose X_WPart = environment.objects()[kPart.value].X_WO;
        const Pose X_WPlate = environment.objects()[kDrill.value].X_WO;
        environment.step();
        SCOPED_TRACE(fmt::format("run {}, {} m/s, tick {}", run, speed, tick));
        if (tick > 1) {
          const double limit = (goal - before).norm() + kSpare;
          const auto moved = [&](ObjectId object, const Pose& X_WO_before, double radius) {
            return maxPointMotion(displacement(X_WO_before, environment.objects()[object.value].X_WO),
                                  radius);
          };
          ASSERT_LE(moved(kPart, X_WPart, 0.151), limit);
          ASSERT_LE(moved(kDrill, X_WPlate, 0.107), limit);
        }
        ASSERT_GT(gapOf(environment, kPart, kDrill), -3e-4);
        lag = std::max(lag, lagOf(environment, kRight, 0.151));
      }
    }
  }
  EXPECT_GT(lag, 0.02) << "they meet";
}

struct Flight {
  const char* name;
  double speed;      // [m/s]
  double turn_rate;  // [rad/s]
};

//   ------- a bar of 600 mm, whose file may have its origin 2.5 m away, moves and turns
//   _______ 12 mm above a wall: the ends move by 6 mm in a tick
class FreeFlights : public OwnSteps, public ::testing::WithParamInterface<Flight> {};

TEST_P(FreeFlights, HaveNoLag) {
  const Vector3 half(0.3, 0.01, 0.01);
  for (const Vector3& p_OC : {Vector3(0.0, 0.0, 0.0), Vector3(-2.5, 1.3, -0.8)}) {
    fs::create_directories(folder_);
    bake::TriangleMesh bar = test::boxMesh(-half, half);
    for (Vector3f& p : bar.vertices) p = (p.cast<double>() + p_OC).cast<float>();
    ASSERT_TRUE(bake::writeStl(folder_ / "bar.stl", bar, 1e-3));
    const auto scene = load("{box: [1600 mm, 1600 mm, 20 mm], at: [0, 0, -10 mm]}",
                            "{file: bar.stl, unit: mm}", "{box: [20 mm, 20 mm, 20 mm]}", 6);
    ASSERT_TRUE(scene);
    const double height = 0.01 + 0.012;
    const double step = GetParam().speed * kTickSeconds;
    // turning about the vertical near the wall, then about another axis high above it
    for (const bool low : {true, false}) {
      Environment environment(scene, {});
      const Vector3 axis = low ? Vector3(0.0, 0.0, 1.0) : Vector3(0.6, 0.0, 0.8);
      for (int tick = 0; tick < 800; ++tick) {
        const double angle = GetParam().turn_rate * kTickSeconds * tick;
        const Vector3 p_WC(step * 100.0 * swing(tick, 400), 0.0, low ? height : 0.5);
        place(environment, kRight, Pose(p_WC, expRotation(angle * axis)) * Pose(Vector3(-p_OC)));
        environment.step();
        ASSERT_LE(lagOf(environment, kRight, 3.5), 1e-12) << "tick " << tick << (low ? ", low" : ", high");
      }
      EXPECT_FALSE(environment.inContact(kPart, kWall));
    }
    fs::remove_all(folder_);
  }
}

INSTANTIATE_TEST_SUITE_P(Speeds, FreeFlights,
                         ::testing::Values(Flight{"slow", 0.5, 1.0}, Flight{"fast", 2.1, 5.0},
                                           Flight{"straight", 3.0, 0.0}, Flight{"turning", 0.0, 10.0},
                                           Flight{"fastest", 3.0, 10.0}),
                         [](const auto& flight) { return std::string(flight.param.name); });

/// Directions from which a body meets a wall: towards its faces and towards its corners.
std::vector<Vector3> directions() {
  std::vector<Vector3> all;
  for (const double x : {-1.0, 0.0, 1.0}) {
    for (const double y : {-1.0, 0.0, 1.0}) {
      for (const double z : {-1.0, 0.0, 1.0}) {
        const double sides = std::abs(x) + std::abs(y) + std::abs(z);
        if (sides == 1.0 || sides == 3.0) all.push_back(Vector3(x, y, z + 0.02 * x).normalized());
      }
    }
  }
  return all;
}

struct WallAndPart {
  const char* name;
  const char* wall;
  const char* part;
  double start;  // [m] from the wall's middle
};

//   part --> at 3 m/s, turning at 10 rad/s, through the middle of the wall to as far behind it
class NeverThrough : public OwnSteps, public ::testing::WithParamInterface<WallAndPart> {};

TEST_P(NeverThrough, AtThreeMetresPerSecondFromAnyDirection) {
  const WallAndPart& obstacle = GetParam();
  const auto scene = load(obstacle.wall, obstacle.part, "{box: [20 mm, 20 mm, 20 mm]}");
  ASSERT_TRUE(scene);
  for (const Vector3& way : directions()) {
    for (const double turn_rate : {0.0, 10.0}) {
      SCOPED_TRACE(fmt::format("along {:.2f} {:.2f} {:.2f}, {} rad/s", way.x(), way.y(), way.z(), turn_rate));
      Environment environment(scene, {});
      const int ticks = static_cast<int>(2.0 * obstacle.start / 3e-3);
      double nearest = 1.0;  // [m]
      for (int tick = 0; tick < ticks + 50; ++tick) {
        const double along = -obstacle.start + 3e-3 * std::min(tick, ticks);
        const Vector3 turn = turn_rate * kTickSeconds * std::min(tick, ticks) * Vector3(0.36, 0.48, 0.8);
        place(environment, kRight, Pose(along * way + Vector3(0.001, 0.002, -0.001), expRotation(turn)));
        environment.step();
        nearest = std::min(nearest, gapOf(environment, kPart, kWall));
        ASSERT_GT(nearest, -1e-4) << "tick " << tick;
      }
      EXPECT_LT(nearest, 1e-3) << "it meets the wall";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Obstacles, NeverThrough,
                         ::testing::Values(WallAndPart{"box", "{box: [60 mm, 60 mm, 60 mm]}",
                                                       "{box: [20 mm, 20 mm, 20 mm]}", 0.12},
                                           WallAndPart{"plate", "{box: [200 mm, 200 mm, 4 mm]}",
                                                       "{box: [30 mm, 20 mm, 10 mm]}", 0.25},
                                           WallAndPart{"bar", "{box: [60 mm, 60 mm, 60 mm]}",
                                                       "{box: [300 mm, 20 mm, 20 mm]}", 0.35}),
                         [](const auto& obstacle) { return std::string(obstacle.param.name); });

}  // namespace
}  // namespace tenon::session
