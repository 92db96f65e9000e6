#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <memory>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/session/scene_loader.h"
#include "server/simulation/environment.h"
#include "tests/support/known_shortfall.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;

constexpr HandId kHand{0};

/// The inner edge of an angle profile along y, at x = 50 mm and z = 0: floor and wall are 5 mm thick. `X_WM`:
/// the mesh's frame, so that the field's samples lie anyhow.
std::string angleMesh(const Pose& X_WM) {
  constexpr double kThick = 0.005, kReach = 0.1, kEdge = 0.05;
  const std::array<Vector3, 6> profile{{{kEdge, 0, 0},
                                        {kEdge, 0, kReach},
                                        {kEdge + kThick, 0, kReach},
                                        {kEdge + kThick, 0, -kThick},
                                        {kEdge - kReach, 0, -kThick},
                                        {kEdge - kReach, 0, 0}}};
  constexpr std::array<std::array<int, 3>, 4> kCap{{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}};
  std::string text = "OFF\n12 20 0\n";
  for (const double y : {-0.1, 0.1})
    for (const Vector3& p : profile) {
      const Vector3 p_M = X_WM.inverse() * Vector3(p.x(), y, p.z());
      text += fmt::format("{:.9f} {:.9f} {:.9f}\n", p_M.x(), p_M.y(), p_M.z());
    }
  for (int i = 0; i < 6; ++i) {
    const int next = (i + 1) % 6;
    text += fmt::format("3 {} {} {}\n3 {} {} {}\n", i, i + 6, next + 6, i, next + 6, next);
  }
  for (const auto& [a, b, c] : kCap)
    text += fmt::format("3 {} {} {}\n3 {} {} {}\n", a, b, c, a + 6, c + 6, b + 6);
  return text;
}

class InnerCorner : public ::testing::TestWithParam<int> {
 protected:
  ~InnerCorner() override { fs::remove_all(folder_); }

  std::shared_ptr<const simulation::Scene> load(const Pose& X_WM, int voxel_mm) {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "angle.off") << angleMesh(X_WM);
    const Quaternion& q = X_WM.rotation();
    const Vector3& p = X_WM.translation();
    std::ofstream(folder_ / "scenario.yaml")
        << "objects:\n  - {name: angle, kind: scene, status: fixed, meshes: [{file: angle.off, unit: m}], "
        << fmt::format("structures: {{voxel: {} mm, spacing: 4 mm}}, ", voxel_mm)
        << fmt::format("start: {{at: [{}, {}, {}], q: [{:.12f}, {:.12f}, {:.12f}, {:.12f}]}}}}\n", p.x(),
                       p.y(), p.z(), q.w(), q.x(), q.y(), q.z())
        << "  - {name: box, meshes: [{box: [60 mm, 40 mm, 20 mm]}], structures: {voxel: 1 mm, spacing: 4 "
           "mm}, "
           "start: {at: [0, -30 mm, 30 mm]}}\n"
        << "hands: [{name: right, object: box}]\nstates: [{name: wait, conditions: [{command: "
           "fulfilled}]}]\n";
    const auto loaded = loadScene(folder_ / "scenario.yaml", {.cache = folder_ / "cache"});
    EXPECT_TRUE(loaded) << (loaded ? "" : loaded.error().what);
    return loaded ? loaded->scene : nullptr;
  }

  fs::path folder_ =
      fs::temp_directory_path() / fmt::format("tenon_inner_corner_{}_{}", getpid(), GetParam());
};

//            | wall        the box is pressed 1 mm into both and slides 60 mm along the edge; no friction.
//      .---. |             Interpolation rounds the edge off by up to 0.4 voxels, differently at each place.
//      '---' |
//   ---------'
TEST_P(InnerCorner, ABoxThatSlidesAlongItIsNotHeld) {
  const int number = GetParam();
  const Pose X_WM(0.001 * Vector3(0.3 * number, 0.7, -0.4 * number),
                  expRotation(Vector3(0.7 + 0.9 * number, 1.1 - 0.5 * number, 0.4 * number)));
  const auto scene = load(X_WM, 2 + number % 2);
  ASSERT_TRUE(scene);
  simulation::Environment environment(scene, {});
  constexpr double kPress = 0.001;  // [m]
  environment.setHandPresent(kHand, true);
  double hold = 0.0;    // [N] longest mean, of 100 ms, of the force along the edge
  double behind = 0.0;  // [m] how far the box was from its hand along the edge, at most
  double sum = 0.0;
  for (int tick = 0; tick < 1300; ++tick) {
    const double down = std::min(tick / 200.0, 1.0);
    const double along = std::clamp((tick - 200) / 1000.0, 0.0, 1.0);
    const Vector3 p(down * (0.02 + kPress), -0.03 + 0.06 * along, 0.03 - down * (0.02 + kPress));
    environment.setHandPose(kHand, Pose(p), {});
    environment.step();
    const Pose& X_WO = environment.objects()[1].X_WO;
    const double lag = p.y() - X_WO.translation().y();
    behind = std::max(behind, lag);
    sum += lag * scene->hands[0].stiffness;
    if (tick % 100 != 99) continue;
    hold = std::max(hold, sum / 100.0);
    sum = 0.0;
    EXPECT_LT(X_WO.translation().x(), 0.0201) << tick;
    EXPECT_GT(X_WO.translation().z(), 0.0099) << tick;
  }
  RecordProperty("hold_mN", static_cast<int>(1e3 * hold));
  RecordProperty("behind_um", static_cast<int>(1e6 * behind));
  // by rotation; up to 60 N if a jump of the interpolated distance holds it for good
  constexpr double kPromised = 2.0;
  constexpr std::array<double, 8> kKnown{0.0, 3.0, 0.0, 11.5, 0.0, 6.0, 0.0, 5.0};  // 0: as promised
  const double known = kKnown[static_cast<std::size_t>(number)];
  if (known > 0.0) {
    EXPECT_TRUE(test::knownShortfall(hold, kPromised, known));
  } else {
    EXPECT_LT(hold, kPromised);
  }
  EXPECT_LT(behind, 0.018);
}

INSTANTIATE_TEST_SUITE_P(Rotations, InnerCorner, ::testing::Range(0, 8));

}  // namespace
}  // namespace tenon::session
