#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/cache_folder.h"
#include "server/bake/bake.h"
#include "server/session/scene_loader.h"
#include "server/simulation/environment.h"
#include "tests/support/exact_distance.h"
#include "tests/support/source_folder.h"

namespace tenon::session {
namespace {

/// [m] Furthest that a point of a held part may be behind an exact sheet of the bay.
constexpr double kBehind = 0.0003;
constexpr double kBeyond = 0.1;      ///< [m] behind the sheet where the hand ends
constexpr double kNear = 0.02;       ///< [m] A part that is kept further away was not pressed at the sheet.
constexpr double kLeastForce = 5.0;  ///< [N] of the coupling
constexpr double kFrom = 0.1;        ///< [m] before the sheet where it begins
/// [m] along a sheet, places that are tried until one is pressed
constexpr std::array kPlaces{0.0, -0.1, 0.1, -0.2, 0.2, -0.3, 0.3, -0.4, 0.4};
/// [rad] How often a part is turned about the push by as much, at places where none was pressed: its corners
/// are at other heights, and what else is in the bay is elsewhere beside it.
constexpr int kTurns = 4;

/// A sheet of the engine bay, and the side from which parts are pushed against it.
struct Sheet {
  std::string name;
  Vector3 p_WP;         ///< a point of it, or near
  Vector3 direction_W;  ///< of the push
  Vector3 along_W;      ///< along the sheet, where other places of it are free
};

const std::array<Sheet, 3>& sheets() {
  static const std::array<Sheet, 3> kSheets{
      {{"fender", {0.946, 0.75, 0.80}, {-1.0, 0.0, 0.0}, Vector3::UnitY()},
       {"flange", {0.87, 1.00, 0.93}, {0.0, 0.0, -1.0}, Vector3::UnitY()},
       {"bumper", {0.0, 0.042, 0.195}, {0.0, 1.0, 0.0}, Vector3::UnitX()}}};
  return kSheets;
}

/// The parts that hands hold in this scenario.
constexpr std::array kParts{"control_box", "covering_board", "grid", "bracket", "wiper_mechanism", "drill"};

/// Connected triangles, with their distance.
struct ExactSheet {
  ExactSheet(const bake::TriangleMesh& whole, std::vector<std::array<std::uint32_t, 3>> part)
      : mesh{whole.vertices, std::move(part), {}}, distance(mesh.vertices, mesh.triangles) {}

  [[nodiscard]] Vector3 normalOf(std::uint32_t triangle) const {
    const auto& [a, b, c] = mesh.triangles[triangle];
    return (mesh.vertices[b] - mesh.vertices[a])
        .cross(mesh.vertices[c] - mesh.vertices[a])
        .cast<double>()
        .normalized();
  }

  bake::TriangleMesh mesh;
  test::ExactDistance distance;
};

/// The engine bay as tenon-serve loads it, and its exact mesh.
class BayOfSheets {
 public:
  BayOfSheets()
      : loaded_(loadScene(test::sourceFolder() / "scenarios" / "engine_bay",
                          {.cache = defaultCache(), .detail = 0.12})) {
    if (!loaded_) return;
    const structures::StructureInfo& info = object("engine_bay").structures->info;
    auto mesh = bake::importMesh(info.meshes.front(), info.unit);
    if (mesh) mesh_ = std::move(*mesh);
    number();
  }

  [[nodiscard]] const Result<LoadedScene>& loaded() const { return loaded_; }
  [[nodiscard]] const std::shared_ptr<const simulation::Scene>& scene() const { return loaded_->scene; }
  [[nodiscard]] ObjectId idOf(const std::string& name) const { return loaded_->scenario->objectNamed(name); }
  [[nodiscard]] const simulation::ObjectSpec& object(const std::string& name) const {
    return scene()->objects[idOf(name).value];
  }

  /// The connected triangles of the mesh that contain the one nearest to a point.
  [[nodiscard]] ExactSheet sheetAt(const Vector3& p_WP) const {
    const test::ExactDistance all(mesh_.vertices, mesh_.triangles);
    const std::uint32_t part = part_[all.nearest(p_WP).triangle];
    std::vector<std::array<std::uint32_t, 3>> triangles;
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i)
      if (part_[i] == part) triangles.push_back(mesh_.triangles[i]);
    return {mesh_, std::move(triangles)};
  }

 private:
  /// Numbers the connected parts: triangles that share a position.
  void number() {
    std::map<std::array<float, 3>, std::uint32_t> vertex;
    std::vector<std::uint32_t> root;
    const auto find = [&](std::uint32_t i) {
      while (root[i] != i) i = root[i] = root[root[i]];
      return i;
    };
    const auto vertexAt = [&](const Vector3f& p) {
      const auto [at, fresh] =
          vertex.try_emplace({p.x(), p.y(), p.z()}, static_cast<std::uint32_t>(root.size()));
      if (fresh) root.push_back(at->second);
      return at->second;
    };
    std::vector<std::uint32_t> first;
    for (const auto& triangle : mesh_.triangles) {
      const std::uint32_t a = vertexAt(mesh_.vertices[triangle[0]]);
      for (const std::size_t k : {1U, 2U}) root[find(vertexAt(mesh_.vertices[triangle[k]]))] = find(a);
      first.push_back(a);
    }
    for (const std::uint32_t a : first) part_.push_back(find(a));
  }

  Result<LoadedScene> loaded_;
  bake::TriangleMesh mesh_;
  std::vector<std::uint32_t> part_;  // per triangle
};

const BayOfSheets& engineBay() {
  static const BayOfSheets bay;
  return bay;
}

/// [m] How far the deepest point of a part is behind a sheet that was approached along `direction_W`; points
/// beside its border, or where it is bent out of the way, are not behind it.
double depthBehind(const ExactSheet& sheet, const Vector3& direction_W, const structures::Pointshell& shell,
                   const Pose& X_WO) {
  constexpr double kFar = 0.05;    // [m] another side of the sheet may be nearer there
  constexpr double kFacing = 0.5;  // [-] cosine
  double deepest = -1.0;
  for (const structures::ShellPoint& point : shell.points()) {
    const Vector3 p = X_WO * point.p_MP.cast<double>();
    const test::ExactDistance::Nearest nearest = sheet.distance.nearest(p);
    if (nearest.distance > kFar) continue;
    const Vector3 away = p - nearest.p_MQ;
    Vector3 normal_W = sheet.normalOf(nearest.triangle);
    if (std::abs(normal_W.dot(direction_W)) < kFacing) continue;
    if (normal_W.dot(direction_W) > 0.0) normal_W = -normal_W;
    const double height = away.dot(normal_W);
    if (std::abs(height) < 0.999 * nearest.distance) continue;
    deepest = std::max(deepest, -height);
  }
  return deepest;
}

class EngineBayPushNightly : public testing::TestWithParam<const char*> {};

//   |  v   a hand pushes a part at a sheet of the bay, flat and corner first, and goes 100 mm behind it
//  ----    sheet without thickness, voxels of 5 mm
TEST_P(EngineBayPushNightly, NoPointOfThePartIsBehindTheSheet) {
  const BayOfSheets& bay = engineBay();
  ASSERT_TRUE(bay.loaded()) << bay.loaded().error().what;
  const ObjectId part = bay.idOf(GetParam());
  const structures::HapticStructures& structures = *bay.object(GetParam()).structures;
  const Vector3 middle = structures.info.box_M.center();
  for (const Sheet& at : sheets()) {
    const ExactSheet sheet = bay.sheetAt(at.p_WP);
    for (const bool corner_first : {false, true}) {
      // the diagonal of a cube along the push
      const Quaternion first = corner_first ? expRotation({0.61548, -0.61548, 0.3}) : Quaternion::Identity();
      // what else is in the bay may keep the part away from one place of the sheet
      bool near = false;
      for (std::size_t tried = 0; tried < kPlaces.size() * kTurns && !near; ++tried) {
        const double shift = kPlaces[tried % kPlaces.size()];
        const double about = 2.0 * std::numbers::pi / kTurns * static_cast<double>(tried / kPlaces.size());
        const Quaternion turn = Quaternion(Eigen::AngleAxisd(about, at.direction_W)) * first;
        double reach = 0.0;
        for (const structures::ShellPoint& point : structures.shell.points())
          reach = std::max(reach, (turn * (point.p_MP.cast<double>() - middle)).dot(at.direction_W));
        const auto poseAt = [&](double ahead) {
          return Pose(at.p_WP + shift * at.along_W + (ahead - reach) * at.direction_W - turn * middle, turn);
        };
        simulation::Environment environment(bay.scene(), {});
        const HandId hand{0};
        environment.setHandPresent(hand, true);
        environment.setHandPose(hand, poseAt(-kFrom), {});
        environment.step();
        environment.place(part, poseAt(-kFrom), ObjectStatus::kParked);
        environment.grab(hand, part);
        double behind = -1.0;
        constexpr double kSpeed = 0.5;  // [m/s]
        const int moving = static_cast<int>((kFrom + kBeyond) / kSpeed * 1e3);
        for (int tick = 0; tick < moving + 300; ++tick) {
          environment.setHandPose(hand, poseAt(std::min(kSpeed * 1e-3 * tick - kFrom, kBeyond)), {});
          environment.step();
          if (tick % 50 == 0 || tick + 1 == moving + 300)
            behind = std::max(behind, depthBehind(sheet, at.direction_W, structures.shell,
                                                  environment.objects()[part.value].X_WO));
        }
        const double force = environment.forceOn(part).force.norm();
        EXPECT_LE(behind, kBehind) << at.name << (corner_first ? ", corner first" : ", flat");
        // other things of the bay, or the part's own shape, may keep it away from the sheet
        near = behind > -kNear && force > kLeastForce;
        std::printf("%s at %s, %s, %+.0f mm along it: %.3f mm behind, %.0f N\n", GetParam(), at.name.c_str(),
                    corner_first ? "corner first" : "flat", 1e3 * shift, 1e3 * behind, force);
      }
      EXPECT_TRUE(near) << at.name << (corner_first ? ", corner first" : ", flat") << ": was not pressed";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Parts, EngineBayPushNightly, testing::ValuesIn(kParts),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace tenon::session
