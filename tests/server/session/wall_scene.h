#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "server/bake/shapes.h"
#include "server/session/scene_loader.h"
#include "server/simulation/environment.h"

namespace tenon::test {

/// A wall of a bay that a held box is pushed against, beside a place where a part is mounted with a
/// clearance.
struct WallCase {
  double thickness = 0.001;          ///< [m] 0: a single layer of triangles
  double voxel = 0.005;              ///< [m]
  double clearance = 0.0026;         ///< [m] of the box and the bay, at the mounting place
  Vector3 tilt = Vector3::Zero();    ///< [rad] rotation vector of the wall against the field's axes
  Vector3 offset = Vector3::Zero();  ///< [m] of the wall against the field's samples
  std::string refine;                ///< `refine` of the bay's structures, in YAML; empty: none
};

/// A scenario written to a folder of its own and loaded as tenon-serve loads it; the folder goes with it.
class WallScene {
 public:
  static constexpr double kWallEdge = 0.16;  ///< [m]

  explicit WallScene(const WallCase& wall) : wall_(wall), X_WWall_(wall.offset, expRotation(wall.tilt)) {
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "scenario.yaml") << text();
    const auto written = bake::writeStl(folder_ / "bay.stl", bayMesh(), 0.001);
    loaded_ = written ? session::loadScene(folder_ / "scenario.yaml", {.cache = folder_ / "cache"})
                      : fail(written.error().what);
  }
  ~WallScene() { std::filesystem::remove_all(folder_); }
  WallScene(const WallScene&) = delete;
  WallScene& operator=(const WallScene&) = delete;

  [[nodiscard]] const Result<session::LoadedScene>& loaded() const { return loaded_; }
  [[nodiscard]] const simulation::Scene& scene() const { return *loaded_->scene; }
  [[nodiscard]] const structures::HapticStructures& bay() const { return *scene().objects[0].structures; }
  [[nodiscard]] const Pose& X_WWall() const { return X_WWall_; }

  struct Push {
    double behind = -1.0;  ///< [m] furthest that a point of the box was behind the wall's front, of all ticks
    double final_behind = -1.0;  ///< [m] at the end
    double final_force = 0.0;    ///< [N] of the coupling, at the end
  };

  /// The hand starts in front of the wall and goes `beyond` [m] behind it at `speed` [m/s], then waits. The
  /// box is turned by `turn` (rotation vector) against the wall.
  [[nodiscard]] Push push(double speed, double beyond = 0.05, const Vector3& turn = {0.17, 0.05, 0.0}) const {
    simulation::Environment environment(loaded_->scene, {});
    const HandId hand{0};
    constexpr double kFrom = 0.04;
    const auto poseAt = [&](double height) {
      return X_WWall_ * Pose(Vector3(0.003, 0.002, height), expRotation(turn));
    };
    environment.setHandPresent(hand, true);
    environment.setHandPose(hand, poseAt(kFrom), {});
    Push push;
    const int moving = static_cast<int>((kFrom + beyond) / speed * 1e3) + 1;
    for (int tick = 0; tick < moving + 200; ++tick) {
      environment.setHandPose(hand, poseAt(std::max(kFrom - speed * 1e-3 * tick, -beyond)), {});
      environment.step();
      push.final_behind = behind(environment.objects()[1].X_WO);
      push.behind = std::max(push.behind, push.final_behind);
    }
    push.final_force = environment.forceOn(ObjectId{1}).force.norm();
    return push;
  }

  /// [m] How far the deepest point of the box's pointshell is behind the wall's front, where it is over the
  /// wall.
  [[nodiscard]] double behind(const Pose& X_WBox) const {
    const Pose X_WallBox = X_WWall_.inverse() * X_WBox;
    double deepest = -1.0;
    for (const structures::ShellPoint& point : scene().objects[1].structures->shell.points()) {
      const Vector3 p = X_WallBox * point.p_MP.cast<double>();
      if (std::max(std::abs(p.x()), std::abs(p.y())) > 0.5 * kWallEdge - 0.01) continue;
      deepest = std::max(deepest, 0.5 * wall_.thickness - p.z());
    }
    return deepest;
  }

 private:
  /// The wall, and a block on which the box is mounted. The block's corner is the lowest of all: it decides
  /// where the field's samples are.
  [[nodiscard]] bake::TriangleMesh bayMesh() const {
    bake::TriangleMesh mesh;
    if (wall_.thickness > 0.0) {
      mesh = bake::makeBox({kWallEdge, kWallEdge, wall_.thickness});
    } else {
      constexpr float kHalf = 0.5F * kWallEdge;
      mesh.vertices = {{-kHalf, -kHalf, 0}, {kHalf, -kHalf, 0}, {kHalf, kHalf, 0}, {-kHalf, kHalf, 0}};
      mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    }
    for (Vector3f& p : mesh.vertices) p = (X_WWall_ * p.cast<double>()).cast<float>();
    bake::TriangleMesh block = bake::makeBox({0.06, 0.24, 0.06});
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vector3f& p : block.vertices) mesh.vertices.push_back(p + Vector3f(-0.3F, 0.0F, -0.13F));
    for (const auto& [a, b, c] : block.triangles) mesh.triangles.push_back({a + first, b + first, c + first});
    return mesh;
  }

  [[nodiscard]] std::string text() const {
    return fmt::format(R"(objects:
  - name: bay
    kind: scene
    meshes: [{{file: bay.stl, unit: mm}}]
    structures: {{voxel: {} mm, refinement: 8, points: 500{}}}
    status: fixed
  - name: box
    kind: tool
    meshes: [{{box: [40 mm, 40 mm, 20 mm]}}]
    structures: {{voxel: 2 mm, refinement: 1, spacing: 4 mm}}
    start: {{at: [0, 0, 0.5]}}
hands:
  - {{name: right, object: box}}
pairs:
  - {{between: [box, bay], clearance: {} mm}}
states:
  - name: mount
    object: box
    target: {{at: [-0.3, 0, -0.089], within: 2 mm, angle: 2 deg, dwell: 50 ms}}
    approach: {{direction: [0, 0, -1], distance: 10 mm}}
)",
                       wall_.voxel * 1e3, wall_.refine.empty() ? "" : ", refine: " + wall_.refine,
                       wall_.clearance * 1e3);
  }

  static std::filesystem::path nextFolder() {
    static int number = 0;
    return std::filesystem::temp_directory_path() / fmt::format("tenon_wall_{}_{}", getpid(), number++);
  }

  const WallCase wall_;
  const Pose X_WWall_;
  const std::filesystem::path folder_ = nextFolder();
  Result<session::LoadedScene> loaded_ = fail("not loaded");
};

}  // namespace tenon::test
