#include "scenarios/part_generator/scenario_pictures.h"

#include <fmt/format.h>

#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/picture.h"

namespace tenon::part_generator {
namespace {

constexpr Color kGhost = 0xAFC9DD;
constexpr double kGhostOpacity = 0.45;

/// The meshes of a part set by name, generated once.
class PartMeshes {
 public:
  PartMeshes(const PartSet& set, double detail) : set_(set) {
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

PictureCamera cameraOfWidth(int width) {
  PictureCamera camera;
  camera.width = width;
  camera.height = width * 5 / 8;
  return camera;
}

std::vector<PictureObject> engineBayAtStart(const PartMeshes& meshes) {
  std::vector<PictureObject> scene;
  for (const engine_bay::OtherObject& other : engine_bay::others()) {
    scene.push_back({meshes.mesh(other.name), other.X_WO, std::nullopt, other.name == "forearm" ? 0.7 : 1.0});
  }
  for (const engine_bay::PartLayout& part : engine_bay::parts()) {
    scene.push_back({meshes.mesh(part.name), engine_bay::targetPose(part), kGhost, kGhostOpacity});
  }
  const engine_bay::PartLayout& first = engine_bay::parts().front();
  scene.push_back({meshes.mesh(first.name), engine_bay::startPose(first), std::nullopt, 1.0});
  return scene;
}

/// The control box is on its way to its ghost, the other parts are mounted, the drill is at a screw.
std::vector<PictureObject> engineBayInAssembly(const PartMeshes& meshes) {
  std::vector<PictureObject> scene;
  const auto& parts = engine_bay::parts();
  for (const engine_bay::PartLayout& part : parts) {
    const bool held = part.name == "control_box";
    const Pose X_WT = engine_bay::targetPose(part);
    if (!held) {
      scene.push_back({meshes.mesh(part.name), X_WT, std::nullopt, 1.0});
      continue;
    }
    const Pose X_WP(X_WT.translation() + Vector3(0.03, -0.06, 0.30), expRotation(Vector3(-0.15, 0.12, 0.10)));
    scene.push_back({meshes.mesh(part.name), X_WT, kGhost, 0.55});
    scene.push_back({meshes.mesh(part.name), X_WP, std::nullopt, 1.0});
    const Vector3 wrist = X_WP * Vector3(0.05, -0.02, 0.07);
    const Vector3 elbow = wrist + Vector3(0.23, -0.06, 0.10);
    const Quaternion q = Quaternion::FromTwoVectors(Vector3::UnitX(), (wrist - elbow).normalized());
    scene.push_back({meshes.mesh("forearm"), Pose(elbow, q), std::nullopt, 0.75});
    scene.push_back({meshes.mesh("assistant"), Pose(X_WP * Vector3(-0.22, 0.03, 0.05), X_WP.rotation()),
                     std::nullopt, 1.0});
  }
  scene.push_back({meshes.mesh("engine_bay"), Pose(), std::nullopt, 1.0});
  scene.push_back({meshes.mesh("drill"), engine_bay::toolPose(parts[1]), std::nullopt, 1.0});
  scene.push_back({meshes.mesh("haptic_pointer"), Pose(Vector3(0.52, 0.30, 1.05)), std::nullopt, 1.0});
  return scene;
}

Result<void> drawPegAndBox(const PartMeshes& meshes, PictureMoment moment, int width,
                           const std::filesystem::path& file) {
  const Pose X_WB(Vector3(0.0, 0.0, 0.080));
  const double height = moment == PictureMoment::kStart ? 0.16 : 0.02;
  const Pose X_WP(Vector3(0.012, 0.0, 0.080 + height), expRotation(Vector3(0.05, 0.12, 0.0)));
  const std::vector<PictureObject> scene{
      {meshes.mesh("box_with_hole"), X_WB, std::nullopt, 1.0},
      {meshes.mesh("peg"), X_WP, std::nullopt, 1.0},
      {meshes.mesh("peg"), Pose(Vector3(0.0, 0.0, 0.022)), kGhost, kGhostOpacity},
      {meshes.mesh("cube"), Pose(Vector3(0.14, -0.03, 0.16)), std::nullopt, 1.0},
      {meshes.mesh("pointer"), Pose(Vector3(-0.10, -0.10, 0.14)), std::nullopt, 1.0}};
  PictureCamera camera = cameraOfWidth(width);
  camera.p_WE = {0.42, -0.75, 0.55};
  camera.p_WT = {0.0, 0.0, 0.10};
  camera.half_angle_tangent = 0.26;
  return renderScene(scene, camera, file);
}

/// The blocks as they start, or stacked.
Result<void> drawStacking(const PartMeshes& meshes, PictureMoment moment, int width,
                          const std::filesystem::path& file) {
  constexpr Color kRed = 0xC0392B, kGreen = 0x27AE60, kBlue = 0x2980B9;
  const PartMesh* block = meshes.mesh("block");
  std::vector<PictureObject> scene{
      {meshes.mesh("table"), Pose(), std::nullopt, 1.0},
      {meshes.mesh("cube"), Pose(Vector3(-0.30, 0.15, 0.25)), std::nullopt, 1.0}};
  if (moment == PictureMoment::kStart) {
    scene.push_back({block, Pose(Vector3(0.17, -0.09, 0.032)), kRed, 1.0});
    scene.push_back({block, Pose(Vector3(0.17, 0.09, 0.032)), kGreen, 1.0});
    scene.push_back({block, Pose(Vector3(0.0, 0.12, 0.032)), kBlue, 1.0});
    scene.push_back({meshes.mesh("pointer"), Pose(Vector3(0.0, -0.20, 0.15)), std::nullopt, 1.0});
  } else {
    scene.push_back({block, Pose(Vector3(-0.13, 0.0, 0.031)), kRed, 1.0});
    scene.push_back(
        {block, Pose(Vector3(-0.126, -0.003, 0.092), expRotation(Vector3(0.0, 0.0, 0.10))), kGreen, 1.0});
    scene.push_back(
        {block, Pose(Vector3(-0.13, 0.002, 0.20), expRotation(Vector3(0.05, 0.08, -0.1))), kBlue, 1.0});
    scene.push_back({meshes.mesh("pointer"), Pose(Vector3(-0.13, 0.002, 0.242)), std::nullopt, 1.0});
  }
  PictureCamera camera = cameraOfWidth(width);
  camera.p_WE = {0.62, -1.05, 0.75};
  camera.p_WT = {-0.02, 0.0, 0.08};
  camera.half_angle_tangent = 0.30;
  return renderScene(scene, camera, file);
}

}  // namespace

Result<void> drawScenario(const PartSet& set, double detail, PictureMoment moment,
                          const std::filesystem::path& file, int width) {
  const PartMeshes meshes(set, detail);
  if (set.name == "peg_and_box") return drawPegAndBox(meshes, moment, width, file);
  if (set.name == "stacking") return drawStacking(meshes, moment, width, file);
  const std::vector<PictureObject> scene =
      moment == PictureMoment::kStart ? engineBayAtStart(meshes) : engineBayInAssembly(meshes);
  PictureCamera camera = cameraOfWidth(width);
  if (moment == PictureMoment::kStart) {
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

}  // namespace tenon::part_generator
