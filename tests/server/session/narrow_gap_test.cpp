#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/shapes.h"
#include "server/session/scene_loader.h"
#include "server/simulation/environment.h"
#include "tests/support/test_meshes.h"

namespace tenon::session {
namespace {

constexpr double kVoxel = 0.003;

/// A block of 400 mm with two cheeks on it, a slot apart; and a blade that a hand holds.
class SlotScene {
 public:
  explicit SlotScene(double slot) {
    std::filesystem::create_directories(folder_);
    const bake::TriangleMesh mesh =
        test::together(test::boxMesh({-0.2, -0.2, -0.04}, {0.2, 0.2, 0.0}),
                       test::together(test::boxMesh({-0.02, -0.015, -0.01}, {-slot / 2, 0.015, 0.025}),
                                      test::boxMesh({slot / 2, -0.015, -0.01}, {0.02, 0.015, 0.025})));
    std::ofstream(folder_ / "scenario.yaml") << fmt::format(R"(objects:
  - name: block
    kind: scene
    meshes: [{{file: block.stl, unit: mm}}]
    structures: {{voxel: {} mm, points: 500}}
    status: fixed
  - name: blade
    kind: tool
    meshes: [{{box: [{} mm, 20 mm, 40 mm]}}]
    structures: {{voxel: 0.5 mm, refinement: 1, spacing: 2 mm}}
    start: {{at: [0, 0, 0.5]}}
hands:
  - {{name: right, object: blade}}
states:
  - name: lift
    object: blade
    target: {{at: [0, 0, 0.2], within: 2 mm, angle: 2 deg, dwell: 50 ms}}
)",
                                                            1e3 * kVoxel, 0.8e3 * kVoxel);
    const auto written = bake::writeStl(folder_ / "block.stl", mesh, 0.001);
    loaded_ = written ? loadScene(folder_ / "scenario.yaml", {.cache = folder_ / "cache"})
                      : fail(written.error().what);
  }
  ~SlotScene() { std::filesystem::remove_all(folder_); }
  SlotScene(const SlotScene&) = delete;
  SlotScene& operator=(const SlotScene&) = delete;

  [[nodiscard]] const Result<LoadedScene>& loaded() const { return loaded_; }

 private:
  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / fmt::format("tenon_slot_{}", getpid());
  Result<LoadedScene> loaded_ = fail("not loaded");
};

//      ||       a blade of 0.8 voxels goes into a slot of 1.2 voxels, that nobody asked to refine; at 1 mm
//    ## ||##    beside the middle it still does not enter the cheeks
//   #########
TEST(NarrowGap, LetsABladeIn) {
  const SlotScene slot(1.2 * kVoxel);
  ASSERT_TRUE(slot.loaded()) << slot.loaded().error().what;
  simulation::Environment environment(slot.loaded()->scene, {});
  const HandId hand{0};
  const auto poseAt = [](double x, double low) { return Pose(Vector3(x, 0.0, low + 0.02)); };
  constexpr double kStart = 0.03;
  constexpr double kEnd = 0.004;  // [m] above the bottom of the slot, which is 25 mm deep
  environment.setHandPresent(hand, true);
  environment.setHandPose(hand, poseAt(0.0, kStart), {});
  for (int tick = 0; tick < 500; ++tick) {
    environment.setHandPose(hand, poseAt(0.0, std::max(kStart - 1e-4 * tick, kEnd)), {});
    environment.step();
  }
  const auto p_WB = [&] { return environment.objects()[1].X_WO.translation(); };
  EXPECT_LT((p_WB() - poseAt(0.0, kEnd).translation()).norm(), 2e-4);
  for (int tick = 0; tick < 300; ++tick) {
    environment.setHandPose(hand, poseAt(1e-5 * std::min(tick, 100) * 10.0, kEnd), {});
    environment.step();
  }
  EXPECT_NEAR(p_WB().x(), 0.2 * kVoxel, 5e-5) << "0.6 mm of air on each side";
}

}  // namespace
}  // namespace tenon::session
