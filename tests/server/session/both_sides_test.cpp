#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <ostream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/session/scene_loader.h"
#include "server/simulation/environment.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using simulation::Environment;

constexpr double kPush = 0.01;  // [m] of the hand beyond the contact: 10 N

/// Scenarios of a fixed part and one in a hand, loaded as a server loads them.
class BothSides : public ::testing::Test {
 protected:
  ~BothSides() override { fs::remove_all(folder_); }

  /// `fixed` and `held` are meshes of a scenario. Points are 4 mm apart, voxels `voxel_mm`.
  std::shared_ptr<const simulation::Scene> load(const std::string& fixed, const std::string& held,
                                                double voxel_mm, const std::string& pair = "dilation: 0 mm") {
    const std::string structures =
        fmt::format("structures: {{voxel: {} mm, refinement: 1, spacing: 4 mm}}", voxel_mm);
    fs::create_directories(folder_);
    const fs::path file = folder_ / "scenario.yaml";
    std::ofstream(file) << "objects:\n  - {name: fixed, status: fixed, meshes: [" << fixed << "], "
                        << structures << "}\n  - {name: held, meshes: [" << held << "], " << structures
                        << ", start: {at: [0, 0, 0.2]}}\n"
                        << "hands: [{name: right, object: held}]\n"
                        << "pairs: [{between: [fixed, held], " << pair << "}]\n"
                        << "states: [{name: wait, conditions: [{command: fulfilled}]}]\n";
    const auto loaded = loadScene(file, {.cache = folder_ / "cache"});
    EXPECT_TRUE(loaded) << (loaded ? "" : loaded.error().what);
    return loaded ? loaded->scene : nullptr;
  }

  /// The same scene, whose parts have no features: one direction is asked, as a comparison.
  static std::shared_ptr<const simulation::Scene> withoutFeatures(const simulation::Scene& scene) {
    auto bare = std::make_shared<simulation::Scene>(scene);
    for (simulation::ObjectSpec& object : bare->objects) {
      auto structures = std::make_shared<structures::HapticStructures>(*object.structures);
      structures->features = {};
      object.structures = structures;
    }
    return bare;
  }

  /// Pose of the held part after the hand went straight down from `above` [m] over X_WO to kPush below.
  static Pose pressedDown(const std::shared_ptr<const simulation::Scene>& scene, const Pose& X_WO,
                          double above = 0.003) {
    constexpr int kTicks = 200;
    constexpr int kSettle = 50;
    Environment environment(scene, {});
    const HandId hand{0};
    environment.setHandPresent(hand, true);
    for (int tick = 0; tick <= kTicks + kSettle; ++tick) {
      const double way = std::min(1.0, static_cast<double>(tick) / kTicks) * (above + kPush);
      environment.setHandPose(hand,
                              Pose(X_WO.translation() + Vector3(0.0, 0.0, above - way), X_WO.rotation()), {});
      environment.step();
    }
    return environment.objects()[1].X_WO;
  }

  fs::path folder_ = fs::temp_directory_path() / fmt::format("tenon_both_sides_{}", getpid());
};

constexpr int kOffsets = 8;           // along x, and along y
constexpr double kOffsetStep = 5e-4;  // [m]

//  [======]   a plate in a hand
//     ||      a stud
//  ========
class Studs : public BothSides, public ::testing::WithParamInterface<double> {};

TEST_P(Studs, DoNotEnterAFlatFaceBetweenItsPoints) {
  constexpr double kTip = 0.015;        // [m]
  constexpr double kHalfPlate = 0.005;  // [m]
  const double radius = 0.5 * GetParam();
  const auto scene = load(fmt::format("{{box: [120 mm, 120 mm, 20 mm], at: [0, 0, -10 mm]}}, "
                                      "{{cylinder: {{radius: {}, length: 20 mm}}, at: [0, 0, 5 mm]}}",
                                      radius),
                          "{box: [40 mm, 40 mm, 10 mm]}", 2.0);
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->pairs.size(), 1U) << "the product makes one pair";
  // [m] how far the rim of the stud's tip is behind the face
  const auto entered = [&](const Pose& X_WO) {
    double deepest = -1.0;
    for (const double x : {-radius, 0.0, radius}) {
      for (const double y : {-radius, 0.0, radius}) {
        deepest = std::max(deepest, (X_WO.inverse() * Vector3(x, y, kTip)).z() + kHalfPlate);
      }
    }
    return deepest;
  };
  double deepest = -1.0;
  double without = -1.0;
  for (int i = 0; i < kOffsets; ++i) {
    for (int j = 0; j < kOffsets; ++j) {
      const Pose X_WO(Vector3(kOffsetStep * i, kOffsetStep * j, kTip + kHalfPlate));
      deepest = std::max(deepest, entered(pressedDown(scene, X_WO)));
      if (i % 4 == 1 && j % 4 == 1)
        without = std::max(without, entered(pressedDown(withoutFeatures(*scene), X_WO)));
    }
  }
  EXPECT_LE(deepest, 0.0003);
  EXPECT_GE(deepest, -0.0003) << "it does not reach the face";
  EXPECT_GT(without, deepest + 1e-4) << "one direction alone is as good: nothing is tested here";
  RecordProperty("deepest_um", static_cast<int>(std::lround(1e6 * deepest)));
  RecordProperty("one_direction_um", static_cast<int>(std::lround(1e6 * without)));
}

INSTANTIATE_TEST_SUITE_P(Diameters, Studs, ::testing::Values(0.001, 0.002, 0.003, 0.004, 0.006),
                         [](const auto& one) { return fmt::format("{}mm", std::lround(1e3 * one.param)); });

struct CrossingCase {
  const char* name;
  double voxel_mm;
  double turn;  ///< [rad] of the held bar about the vertical
  double roll;  ///< [rad] about its length, from edge down
};
void PrintTo(const CrossingCase& one, std::ostream* out) { *out << one.name; }

//   <>     a bar in a hand, one edge down
//  =====   a bar with one edge up, across
class Crossings : public BothSides, public ::testing::WithParamInterface<CrossingCase> {};

TEST_P(Crossings, OfEdgesDoNotOverlap) {
  const CrossingCase& one = GetParam();
  constexpr double kEdge = 0.0070710678;  // [m] of a bar from its axis: half the diagonal of 10 mm
  const auto scene = load("{box: [10 mm, 120 mm, 10 mm], turn: {axis: y, deg: 45}}",
                          "{box: [60 mm, 10 mm, 10 mm], turn: {axis: x, deg: 45}}", one.voxel_mm);
  ASSERT_TRUE(scene);
  const Quaternion q = expRotation({0.0, 0.0, one.turn}) * expRotation({one.roll, 0.0, 0.0});
  const auto overlap = [&](const Pose& X_WO) {
    const Vector3 p_WA = X_WO * Vector3(0.0, 0.0, -kEdge);
    const Vector3 along_A = X_WO.rotation() * Vector3::UnitX();
    const Vector3 n_W = along_A.cross(Vector3::UnitY()).normalized();
    return std::abs(n_W.z()) < 0.5
               ? -1.0
               : -(p_WA - Vector3(0.0, 0.0, kEdge)).dot(n_W * (n_W.z() > 0.0 ? 1.0 : -1.0));
  };
  double deepest = -1.0;
  double without = -1.0;
  for (int i = 0; i < kOffsets; ++i) {
    for (int j = 0; j < kOffsets; ++j) {
      const Pose X_WO(Vector3(kOffsetStep * i, kOffsetStep * j, 2.0 * kEdge), q);
      deepest = std::max(deepest, overlap(pressedDown(scene, X_WO)));
      if (i % 4 == 1 && j % 4 == 1)
        without = std::max(without, overlap(pressedDown(withoutFeatures(*scene), X_WO)));
    }
  }
  EXPECT_LE(deepest, 0.0002);
  EXPECT_GE(deepest, -0.0002) << "they do not reach each other";
  EXPECT_GT(without, deepest + 1e-4) << "one direction alone is as good: nothing is tested here";
  RecordProperty("deepest_um", static_cast<int>(std::lround(1e6 * deepest)));
  RecordProperty("one_direction_um", static_cast<int>(std::lround(1e6 * without)));
}

INSTANTIATE_TEST_SUITE_P(Bars, Crossings,
                         ::testing::Values(CrossingCase{"Voxel1", 1.0, 0.0, 0.0},
                                           CrossingCase{"Voxel2", 2.0, 0.0, 0.0},
                                           CrossingCase{"Turned", 2.0, 0.6, 0.0},
                                           CrossingCase{"Rolled", 2.0, 0.3, 0.3}),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace tenon::session
