#include "scenarios/scenario_pictures.h"

#include <fmt/format.h>

#include "scenarios/engine_bay/layout.h"
#include "scenarios/picture.h"

namespace tenon {
namespace {

constexpr Color kGhost = 0xAFC9DD;
constexpr double kGhostOpacity = 0.45;

/// The meshes of a set by name, made once.
class Workshop {
 public:
  Workshop(const PartSet& set, double detail) : set_(set) {
    for (const ScenarioPart& part : set.parts) meshes_.push_back(part.make(detail));
  }
  [[nodiscard]] const PartMesh* mesh(std::string_view name) const {
    for (std::size_t i = 0; i < set_.parts.size(); ++i) {
      if (set_.parts[i].name == name) return &meshes_[i];
    }
    return nullptr;
  }

 private:
  const PartSet& set_;
  std::vector<PartMesh> meshes_;
};

std::vector<PictureObject> engineBayAtStart(const Workshop& workshop) {
  std::vector<PictureObject> scene;
  for (const engine_bay::OtherObject& other : engine_bay::others()) {
    scene.push_back(
        {workshop.mesh(other.name), other.X_WO, std::nullopt, other.name == "forearm" ? 0.7 : 1.0});
  }
  for (const engine_bay::PartLayout& part : engine_bay::parts()) {
    scene.push_back({workshop.mesh(part.name), engine_bay::targetPose(part), kGhost, kGhostOpacity});
  }
  const engine_bay::PartLayout& first = engine_bay::parts().front();
  scene.push_back({workshop.mesh(first.name), engine_bay::startPose(first), std::nullopt, 1.0});
  return scene;
}

/// The wiper mechanism is on its way to its ghost, the rest is mounted, the drill is in the other hand.
std::vector<PictureObject> engineBayInAssembly(const Workshop& workshop) {
  std::vector<PictureObject> scene;
  const auto& parts = engine_bay::parts();
  for (const engine_bay::PartLayout& part : parts) {
    const bool held = part.name == "control_box";
    const Pose X_WT = engine_bay::targetPose(part);
    if (!held) {
      scene.push_back({workshop.mesh(part.name), X_WT, std::nullopt, 1.0});
      continue;
    }
    const Pose X_WP(X_WT.translation() + Vector3(0.03, -0.06, 0.30), expRotation(Vector3(-0.15, 0.12, 0.10)));
    scene.push_back({workshop.mesh(part.name), X_WT, kGhost, 0.55});
    scene.push_back({workshop.mesh(part.name), X_WP, std::nullopt, 1.0});
    const Vector3 wrist = X_WP * Vector3(0.05, -0.02, 0.07);
    const Vector3 elbow = wrist + Vector3(0.23, -0.06, 0.10);
    const Quaternion q = Quaternion::FromTwoVectors(Vector3::UnitX(), (wrist - elbow).normalized());
    scene.push_back({workshop.mesh("forearm"), Pose(elbow, q), std::nullopt, 0.75});
    scene.push_back({workshop.mesh("assistant"), Pose(X_WP * Vector3(-0.22, 0.03, 0.05), X_WP.rotation()),
                     std::nullopt, 1.0});
  }
  scene.push_back({workshop.mesh("engine_bay"), Pose(), std::nullopt, 1.0});
  scene.push_back({workshop.mesh("drill"), engine_bay::toolPose(parts[1]), std::nullopt, 1.0});
  scene.push_back({workshop.mesh("haptic_pointer"), Pose(Vector3(0.52, 0.30, 1.05)), std::nullopt, 1.0});
  return scene;
}

Result<void> drawPegAndBox(const Workshop& workshop, Moment moment, const std::filesystem::path& file) {
  const Pose stand(Vector3(0.0, 0.0, 0.080));
  const double height = moment == Moment::kStart ? 0.16 : 0.02;
  const Pose X_WP(Vector3(0.012, 0.0, 0.080 + height), expRotation(Vector3(0.05, 0.12, 0.0)));
  const std::vector<PictureObject> scene{
      {workshop.mesh("box_with_hole"), stand, std::nullopt, 1.0},
      {workshop.mesh("peg"), X_WP, std::nullopt, 1.0},
      {workshop.mesh("peg"), Pose(Vector3(0.0, 0.0, 0.022)), kGhost, kGhostOpacity},
      {workshop.mesh("cube"), Pose(Vector3(0.14, -0.03, 0.16)), std::nullopt, 1.0},
      {workshop.mesh("pointer"), Pose(Vector3(-0.10, -0.10, 0.14)), std::nullopt, 1.0}};
  Camera camera;
  camera.p_WE = {0.42, -0.75, 0.55};
  camera.p_WT = {0.0, 0.0, 0.10};
  camera.half_angle_tangent = 0.26;
  return renderScene(scene, camera, file);
}

}  // namespace

Result<void> drawScenario(const PartSet& set, double detail, Moment moment,
                          const std::filesystem::path& file) {
  const Workshop workshop(set, detail);
  if (set.name == "peg_and_box") return drawPegAndBox(workshop, moment, file);
  const std::vector<PictureObject> scene =
      moment == Moment::kStart ? engineBayAtStart(workshop) : engineBayInAssembly(workshop);
  Camera camera;
  if (moment == Moment::kStart) {
    camera.p_WE = {2.3, -3.3, 2.6};
    camera.p_WT = {0.05, 0.60, 0.62};
    camera.half_angle_tangent = 0.30;
  } else {
    camera.p_WE = {1.05, -1.75, 2.15};
    camera.p_WT = {-0.02, 0.78, 0.66};
    camera.half_angle_tangent = 0.34;
  }
  return renderScene(scene, camera, file);
}

}  // namespace tenon
