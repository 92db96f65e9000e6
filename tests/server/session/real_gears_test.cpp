#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/shapes.h"
#include "server/session/scene_loader.h"
#include "server/simulation/environment.h"
#include "tests/server/collision/real_parts.h"

namespace tenon::session {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kHigh = 0.0225;      // [m] height of a gear that is off its shaft
constexpr double kBacklash = 0.025;   // [rad] of the small gear, to either side, with the play of both bores
constexpr double kOverlap = 5e-6;     // [m] noise of the overlap of the meshes
constexpr int kInsertionTicks = 500;  // at 47 mm/s
constexpr int kTurnTicks = 600;
const Vector3 kMedium(0.020, 0.0, 0.015);  // centres of the gears when mounted, in the files' common frame
const Vector3 kSmall(0.0505, 0.0, 0.015);

/// A scenario of the gears, loaded as a server loads it: origins of gears are at their centres. A hand holds
/// the small gear, another one the medium gear, which turns freely.
class Gears {
 public:
  Gears() {
    std::filesystem::create_directories(folder_);
    base_ = write("base", "factory_gear_base_loose_space_5e-4_subdiv_4x.ply", Vector3::Zero());
    medium_ = write("medium", "factory_gear_medium_space_5e-4.ply", kMedium);
    small_ = write("small", "factory_gear_small_space_5e-4.ply", kSmall);
    if (testing::Test::HasFailure()) return;
    const auto object = [](const char* name, double spacing_mm, const std::string& refine,
                           const std::string& keys) {
      return fmt::format(
          "  - {{name: {0}, meshes: [{{file: {0}.stl, unit: mm}}], {3}, structures: {{voxel: 0.85 mm, "
          "refinement: 8, spacing: {1} mm, refine: [{2}]}}}}\n",
          name, spacing_mm, refine, keys);
    };
    const auto box = [](double x, double half, double from, double to) {
      return fmt::format("{{from: [{}, {}, {}], to: [{}, {}, {}]}}", x - half, -half, from, x + half, half,
                         to);
    };
    constexpr double kShaft = 0.0056;
    std::ofstream(folder_ / "scenario.yaml")
        << "objects:\n"
        << object("base", 1.0,
                  box(kMedium.x(), kShaft, 0.0045, 0.0255) + ", " + box(kSmall.x(), kShaft, 0.0045, 0.0255),
                  "status: fixed")
        << object("medium", 0.8,
                  box(0.0, kShaft, -0.0105, 0.0105) + ", " + box(0.019, 0.007, -0.0105, 0.0005),
                  "start: {at: [20 mm, 0, 15 mm]}")
        << object("small", 0.8, box(0.0, 0.0115, -0.0105, 0.0005) + ", " + box(0.0, kShaft, -0.0105, 0.0105),
                  "start: {at: [50.5 mm, 0, 60 mm]}")
        << "hands:\n"
        << "  - {name: right, object: small, rotational_stiffness: 1.4 Nm/rad}\n"
        << "  - {name: left, object: medium, stiffness: 200 N/m, rotational_stiffness: 0.01 Nm/rad}\n"
        << "pairs: [{between: [small, base]}, {between: [medium, base]}, {between: [small, medium]}]\n"
        << "states: [{name: wait, conditions: [{command: fulfilled}]}]\n";
    const auto loaded = loadScene(folder_ / "scenario.yaml", {.cache = folder_ / "cache"});
    EXPECT_TRUE(loaded) << (loaded ? "" : loaded.error().what);
    if (!loaded) return;
    base_->structures = loaded->scene->objects[0].structures;
    medium_->structures = loaded->scene->objects[1].structures;
    small_->structures = loaded->scene->objects[2].structures;
    environment_ = std::make_unique<simulation::Environment>(loaded->scene, simulation::EnvironmentOptions{});
    for (const HandId hand : {kRight, kLeft}) environment_->setHandPresent(hand, true);
  }
  ~Gears() { std::filesystem::remove_all(folder_); }
  Gears(const Gears&) = delete;
  Gears& operator=(const Gears&) = delete;

  [[nodiscard]] bool loaded() const { return environment_ != nullptr; }

  /// Moves the right hand, whose gear's centre goes `beside` [m] its shaft and `high` [m] above its seat.
  void step(double high, const Vector3& beside, const Quaternion& q) {
    environment_->setHandPose(kRight, Pose(kSmall + beside + Vector3(0.0, 0.0, high), q), {});
    environment_->setHandPose(kLeft, Pose(kMedium), {});
    environment_->step();
    largest_force = std::max(largest_force, force());
    if (ticks_++ % 20 == 0) overlap = std::max(overlap, currentOverlap());
  }

  [[nodiscard]] const Pose& small() const { return environment_->objects()[2].X_WO; }
  [[nodiscard]] const Pose& medium() const { return environment_->objects()[1].X_WO; }
  /// [N] On the right hand.
  [[nodiscard]] double force() const { return environment_->hands()[0].F_Ho_W.force.norm(); }

  double largest_force = 0.0;  ///< [N] on the hand
  double overlap = 0.0;        ///< [m] of the exact meshes

 private:
  static constexpr HandId kRight{0};
  static constexpr HandId kLeft{1};

  /// Writes a mesh with its origin at `centre` [m].
  std::unique_ptr<test::RealPart> write(const std::string& name, const std::string& file,
                                        const Vector3& centre) {
    auto mesh = bake::importMesh(test::pairsFolder() / "nv_factory_gears" / file, 1.0);
    if (!mesh) {
      ADD_FAILURE() << mesh.error().what;
      return nullptr;
    }
    for (Vector3f& vertex : mesh->vertices) vertex -= centre.cast<float>();
    const auto written = bake::writeStl(folder_ / (name + ".stl"), *mesh, 0.001);
    if (!written) ADD_FAILURE() << written.error().what;
    return std::make_unique<test::RealPart>(
        test::RealPart{nullptr, *mesh, test::ExactDistance(mesh->vertices, mesh->triangles)});
  }

  [[nodiscard]] double currentOverlap() const {
    return std::max({test::overlapOfMeshes(*small_, *base_, small(), kOverlap),
                     test::overlapOfMeshes(*medium_, *base_, medium(), kOverlap),
                     test::overlapOfMeshes(*small_, *medium_, medium().inverse() * small(), kOverlap)});
  }

  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / fmt::format("tenon_gears_{}", getpid());
  std::unique_ptr<test::RealPart> base_, medium_, small_;
  std::unique_ptr<simulation::Environment> environment_;
  int ticks_ = 0;
};

//       |#|   the small gear is put on its shaft tilted, its teeth between those of the medium one, which
//  ##|##|#|   turns freely on its own shaft; the small one turns the other half as far, and is taken off
//  ________   again
TEST(RealGearsNightly, AGearIsPutOnItsShaftDrivesItsNeighbourAndIsTakenOff) {
  Gears gears;
  ASSERT_TRUE(gears.loaded());
  const Vector3 kBeside(0.0002, -0.0001, 0.0);
  for (const double lean : {0.0, 0.01, 0.02, 0.035}) {
    for (int quarter = 0; quarter < (lean > 0.0 ? 4 : 1); ++quarter) {
      const double azimuth = 0.25 * kTurn * quarter;
      const Quaternion tilted = expRotation(lean * Vector3(std::cos(azimuth), std::sin(azimuth), 0.0));
      const auto go = [&](double from, double to) {
        for (int tick = 0; tick <= kInsertionTicks; ++tick)
          gears.step(from + (to - from) * tick / kInsertionTicks, kBeside, tilted);
      };
      go(kHigh, -0.001);
      EXPECT_NEAR((gears.small().translation() - kSmall).z(), 0.0, 5e-5)
          << "not mounted with " << lean << " rad, " << quarter;
      go(-0.001, kHigh);
      EXPECT_EQ(gears.force(), 0.0) << "not taken off";
    }
  }
  for (int tick = 0; tick <= kInsertionTicks; ++tick)
    gears.step(kHigh - (kHigh + 0.0005) * tick / kInsertionTicks, Vector3::Zero(), Quaternion::Identity());
  double play = 0.0;  // [rad]
  for (int tick = 0; tick <= kTurnTicks; ++tick) {
    const double turn = 0.4 * std::sin(kTurn * tick / kTurnTicks);
    gears.step(-0.0005, Vector3::Zero(), expRotation({0.0, 0.0, turn}));
    const double here = logRotation(gears.small().rotation()).z();
    const double there = logRotation(gears.medium().rotation()).z();
    if (tick > 20) {
      ASSERT_NEAR(here, turn, 0.005) << "the neighbour resists";
    }
    play = std::max(play, std::abs(here + 2.0 * there));
  }
  EXPECT_LE(play, kBacklash) << "20 teeth drive 40";
  EXPECT_LE(gears.largest_force, 5.0);
  EXPECT_LE(gears.overlap, 5e-5);
  RecordProperty("largest_force_mN", static_cast<int>(std::lround(1e3 * gears.largest_force)));
}

}  // namespace
}  // namespace tenon::session
