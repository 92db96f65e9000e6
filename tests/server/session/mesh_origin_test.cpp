#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "clients/haptic/coupling.h"
#include "server/bake/shapes.h"
#include "server/session/event_generator.h"
#include "server/session/scene_loader.h"
#include "server/session/session_simulation.h"
#include "tests/support/test_meshes.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;

/// [m] From the origin of every mesh of the plain scene to that of the moved one, in the mesh's frame: far more
/// than the parts are large.
const Vector3 kShift(-2.5, 1.3, -0.8);

constexpr HandId kHand{0};

/// "at: [...], q: ..." of a pose whose orientation is a turn about x.
std::string poseText(const Vector3& p_WC, double degrees, const Vector3& p_OC_O) {
  const Pose X_WC(p_WC, expRotation(Vector3(degrees * M_PI / 180.0, 0.0, 0.0)));
  const Vector3 p_WO = p_WC - X_WC.rotation() * p_OC_O;
  return fmt::format("at: [{:.17g} m, {:.17g} m, {:.17g} m], turn: {{axis: x, deg: {}}}", p_WO.x(), p_WO.y(),
                     p_WO.z(), degrees);
}

//                 o pointer
//      z        .---.         _
//      |        |peg|  block |_|
//      |_|   |_ |___|   
//   ---' '---' '-----------------  plate with a socket of 21 x 21 x 30 mm; the peg has 20 x 20 x 60 mm
//
/// The exercise with every mesh file's origin at p_OC_O from the middle of its part.
std::string scenarioText(const Vector3& p_OC_O) {
  const auto corner = [&](const Vector3& p_CP) {
    const Vector3 p_OP = p_CP + p_OC_O;
    return fmt::format("[{:.17g} m, {:.17g} m, {:.17g} m]", p_OP.x(), p_OP.y(), p_OP.z());
  };
  return fmt::format(R"(
title: Origin
reach: 1 m
objects:
  - name: plate
    kind: scene
    meshes: [{{file: plate.stl, unit: mm}}]
    structures: {{voxel: 2 mm, refinement: 8, spacing: 5 mm, refine: [{{from: {}, to: {}}}]}}
    start: {{{}}}
    status: fixed
  - name: peg
    meshes: [{{file: peg.stl, unit: mm}}]
    structures: {{voxel: 2 mm, spacing: 2 mm, refinement: 1}}
    start: {{{}}}
  - name: block
    meshes: [{{file: block.stl, unit: mm}}]
    structures: {{voxel: 1 mm, spacing: 3 mm, refinement: 1}}
    start: {{{}}}
    body: {{density: 2700 kg/m3, friction: 0.4}}
  - name: pointer
    kind: pointer
    meshes: [{{sphere: {{diameter: 24 mm}}}}]
    structures: {{voxel: 1 mm, points: 800, refinement: 1}}
    start: {{at: [0.2, 0, 0.12]}}
hands:
  - {{name: right, object: pointer}}
pairs:
  - {{between: [peg, plate], clearance: 1 mm}}
states:
  - name: take
    touch: peg
    for: 0.1 s
  - name: insert
    hands: {{right: peg}}
    object: peg
    target: {{{}, within: 1 mm, angle: 1 deg, dwell: 0.1 s}}
    approach: {{direction: [0, 0, -1], distance: 50 mm}}
    snap: true
  - name: push
    touch: block
    conditions: {{command: fulfilled}}
)",
                     corner(Vector3(-0.014, -0.014, -0.004)), corner(Vector3(0.014, 0.014, 0.034)),
                     poseText(Vector3::Zero(), 0.0, p_OC_O), poseText(Vector3(0.2, 0.0, 0.032), 0.0, p_OC_O),
                     poseText(Vector3(-0.1, 0.08, 0.03), 4.0, p_OC_O),
                     poseText(Vector3(0.0, 0.0, 0.031), 0.0, p_OC_O));
}

void writeMesh(const fs::path& file, bake::TriangleMesh mesh, const Vector3& p_OC_O) {
  for (Vector3f& p : mesh.vertices) p = (p.cast<double>() + p_OC_O).cast<float>();
  ASSERT_TRUE(bake::writeStl(file, mesh, 1e-3));
}

bake::TriangleMesh box(const Vector3& from, const Vector3& to) { return test::boxMesh(from, to); }

bake::TriangleMesh plate() {
  constexpr double kHole = 0.0105, kWall = 0.025, kTop = 0.03;
  bake::TriangleMesh mesh = box({-0.15, -0.15, -0.02}, {0.35, 0.15, 0.0});
  mesh = test::together(mesh, box({kHole, -kWall, 0.0}, {kWall, kWall, kTop}));
  mesh = test::together(mesh, box({-kWall, -kWall, 0.0}, {-kHole, kWall, kTop}));
  mesh = test::together(mesh, box({-kHole, kHole, 0.0}, {kHole, kWall, kTop}));
  return test::together(mesh, box({-kHole, -kWall, 0.0}, {kHole, -kHole, kTop}));
}

LoadedScene load(const fs::path& folder, const Vector3& p_OC_O) {
  fs::create_directories(folder);
  const Vector3 peg(0.01, 0.01, 0.03);
  const Vector3 block(0.02, 0.015, 0.01);
  writeMesh(folder / "plate.stl", plate(), p_OC_O);
  writeMesh(folder / "peg.stl", box(-peg, peg), p_OC_O);
  writeMesh(folder / "block.stl", box(-block, block), p_OC_O);
  std::ofstream(folder / "scenario.yaml") << scenarioText(p_OC_O);
  auto loaded = loadScene(folder / "scenario.yaml", {.cache = folder / "cache"});
  if (!loaded) ADD_FAILURE() << loaded.error().what;
  return loaded.value();
}

/// What the hand does: between its entries, at constant velocity and angular velocity.
struct Waypoint {
  double tick;  // [ticks]
  Vector3 p_WH;
  Vector3 turn_W;  // [rad]
};
const std::vector<Waypoint> kPath{
    {0, {0.2, 0, 0.12}, {0, 0, 0}},
    {300, {0.2, 0, 0.071}, {0, 0, 0}},                     // presses on the peg until it is taken
    {600, {0.2, 0, 0.071}, {0, 0, 0}},                     //
    {1000, {0.2, 0, 0.2}, {0, 0, 0}},                      //
    {2000, {0.2, 0, 0.2}, {0.6, 0.6, 0.5291503}},          // turns it at 1 rad/s
    {3000, {0.2, 0, 0.2}, {0, 0.1, 0}},                    //
    {3400, {0.2, 0, 0.068}, {0, 0.1, 0}},                  // presses an edge on the plate
    {4000, {0.15, 0.05, 0.068}, {0, 0.05, 0.3}},           // slides it, and turns
    {4300, {0.15, 0.05, 0.15}, {0, 0, 0}},                 //
    {4900, {0.0003, 0.0002, 0.15}, {0.004, 0.008, 0.01}},  //
    {5700, {0.0003, 0.0002, 0.067}, {0.004, 0.008, 0.01}},  // inserts it, and presses on the ground
    {6500, {0.0003, 0.0002, 0.067}, {0.004, 0.008, 0.01}},
    {6800, {-0.03, 0.06, 0.1}, {0, 0, 0}},  // with the pointer to the block
    {7100, {-0.03, 0.08, 0.02}, {0, 0, 0}},
    {7600, {-0.09, 0.08, 0.02}, {0, 0, 0}},  // pushes it
    {8000, {-0.09, 0.08, 0.02}, {0, 0, 0}},
};
constexpr Tick kTicks = 8000;

Pose handAt(Tick tick) {
  const auto now = static_cast<double>(tick);
  std::size_t i = 1;
  while (i + 1 < kPath.size() && kPath[i].tick < now) ++i;
  const Waypoint& from = kPath[i - 1];
  const Waypoint& to = kPath[i];
  const double fraction = (now - from.tick) / (to.tick - from.tick);
  const Pose X_WA(from.p_WH, expRotation(from.turn_W));
  const Displacement path = displacement(X_WA, {to.p_WH, expRotation(to.turn_W)});
  return displaced(X_WA, {fraction * path.translation, fraction * path.rotation});
}

/// A session, with the station of its hand.
class Run {
 public:
  Run(const fs::path& folder, const Vector3& p_OC_O)
      : loaded_(load(folder, p_OC_O)),
        simulation_(loaded_.scenario, loaded_.scene, {}),
        output_(simulation_.makeOutput()),
        events_(loaded_.scenario, 1) {
    for (std::uint32_t i = 0; i < loaded_.scene->objects.size(); ++i) {
      objects_.push_back(describe(ObjectId{i}, loaded_.scene->objects[i]));
      centres_.push_back(loaded_.scene->objects[i].kind == "pointer" ? Vector3(Vector3::Zero()) : p_OC_O);
    }
    world_.begin(objects_, 1, 0);
    packer_.emplace(1);
  }

  void tick() {
    TickInput input;
    input.tick = simulation_.now() + 1;
    if (input.tick == 1) input.changes.push_back({.kind = ChangeKind::kAttach, .hand = kHand});
    // an external push on the free block, and far more torque than is allowed
    if (input.tick == 1500) {
      const Vector3 p_OC_W = objectPose(2).rotation() * centres_[2];
      const Wrench F_Oc_W{Vector3(0.5, 0.0, 0.2), Vector3(0.0, 0.0, 0.01)};
      input.changes.push_back({.kind = ChangeKind::kContributeForce,
                               .object = ObjectId{2},
                               .index = 7,
                               .lifetime_ticks = 100,
                               .F_Oo_W = {F_Oc_W.force, F_Oc_W.torque + p_OC_W.cross(F_Oc_W.force)}});
    }
    const Pose X_WH = handAt(input.tick);
    input.readings.push_back({.hand = kHand, .seq = static_cast<std::uint32_t>(input.tick), .X_WH = X_WH});
    simulation_.tick(input);
    simulation_.fill(output_);
    for (const EventLog& event : events_.generate(output_).log)
      log_.push_back(fmt::format("{} {} {}", event.tick, event.kind, event.text));
    packer_->pack(output_, true, frames_);
    for (const WorldFrame& frame : frames_) world_.receive(frame);
    local_.receive(output_.manifolds[kHand.value]);
    rendered_ = coupling_.step(local_.step(X_WH, world_), X_WH, kTickSeconds);
  }

  [[nodiscard]] std::size_t objects() const { return objects_.size(); }
  [[nodiscard]] const std::string& name(std::size_t i) const { return objects_[i].name; }
  [[nodiscard]] const Pose& objectPose(std::size_t i) const { return output_.objects[i].X_WO; }
  [[nodiscard]] Pose centrePose(std::size_t i) const {
    return {objectPose(i) * centres_[i], objectPose(i).rotation()};
  }
  [[nodiscard]] Vector3 centreVelocity(std::size_t i) const {
    const auto& V_WO = output_.objects[i].V_WO;
    const Vector3 p_OC_W = objectPose(i).rotation() * centres_[i];
    return V_WO.head<3>().cast<double>() + Vector3(V_WO.tail<3>().cast<double>()).cross(p_OC_W);
  }
  [[nodiscard]] const Wrench& serverForce() const { return output_.manifolds[kHand.value].F_Ho_W; }
  [[nodiscard]] const Wrench& renderedForce() const { return rendered_; }
  [[nodiscard]] const game_control::StepStatus& step() const { return output_.step; }
  [[nodiscard]] const std::vector<std::string>& log() const { return log_; }
  [[nodiscard]] std::uint64_t beyondValidity() const { return local_.beyondValidity(); }

 private:
  LoadedScene loaded_;
  SessionSimulation simulation_;
  TickOutput output_;
  EventGenerator events_;
  std::vector<SceneObject> objects_;
  std::vector<Vector3> centres_;
  std::optional<FramePacker> packer_;
  std::vector<WorldFrame> frames_;
  haptic::WorldView world_;
  haptic::LocalModel local_;
  haptic::Coupling coupling_{{}};
  Wrench rendered_;
  std::vector<std::string> log_;
};

class MeshOrigin : public ::testing::Test {
 protected:
  ~MeshOrigin() override { fs::remove_all(folder_); }
  const fs::path folder_ = fs::temp_directory_path() / fmt::format("tenon_mesh_origin_{}", getpid());
};

TEST_F(MeshOrigin, DoesNotMatter) {
  constexpr double kPlace = 1e-5;       // [m]
  constexpr double kPart = 0.01;        // [-] of a force
  constexpr double kForce = 0.01;       // [N] of the coupling at kPlace
  constexpr double kTorque = 2e-3;      // [Nm]
  Run plain(folder_ / "plain", Vector3::Zero());
  Run moved(folder_ / "moved", -kShift);
  double place = 0.0, angle = 0.0, velocity = 0.0, force = 0.0, torque = 0.0, most_force = 0.0, most_torque = 0.0;
  double rendered = 0.0, rendered_torque = 0.0, position_error = 0.0;
  std::array<double, 16> step_place{};
  const bool verbose = std::getenv("VERBOSE") != nullptr;
  for (Tick tick = 1; tick <= kTicks; ++tick) {
    plain.tick();
    moved.tick();
    for (std::size_t i = 0; i < plain.objects(); ++i) {
      const Displacement off = displacement(plain.centrePose(i), moved.centrePose(i));
      place = std::max(place, off.translation.norm());
      angle = std::max(angle, off.rotation.norm());
      velocity = std::max(velocity, (plain.centreVelocity(i) - moved.centreVelocity(i)).norm());
      step_place[i] = std::max(step_place[i], off.translation.norm());
    }
    const auto add = [](double& worst, double off, double of, double part) { worst = std::max(worst, off - part * of); };
    add(force, (plain.serverForce().force - moved.serverForce().force).norm(), plain.serverForce().force.norm(), kPart);
    add(torque, (plain.serverForce().torque - moved.serverForce().torque).norm(), plain.serverForce().torque.norm(), kPart);
    add(rendered, (plain.renderedForce().force - moved.renderedForce().force).norm(), plain.renderedForce().force.norm(), kPart);
    add(rendered_torque, (plain.renderedForce().torque - moved.renderedForce().torque).norm(), plain.renderedForce().torque.norm(), kPart);
    most_force = std::max(most_force, plain.serverForce().force.norm());
    most_torque = std::max(most_torque, plain.serverForce().torque.norm());
    position_error = std::max(position_error, std::abs(plain.step().position_error - moved.step().position_error));
    if (verbose && tick % 100 == 0) {
      std::string line = fmt::format("{:5} F {:7.3f} T {:6.4f} dF {:.4f} dT {:.5f} dR {:.4f} pe {:.5f} |", tick, plain.serverForce().force.norm(), plain.serverForce().torque.norm(), force, torque, rendered, plain.step().position_error);
      for (std::size_t i = 0; i < plain.objects(); ++i) line += fmt::format(" {:.2f}", 1e6 * step_place[i]);
      const Pose b = plain.centrePose(2);
      line += fmt::format(" um  block {:.4f} {:.4f} {:.4f}  peg {:.4f} {:.4f} {:.4f} beyond {} {}", b.translation().x(), b.translation().y(), b.translation().z(), plain.centrePose(1).translation().x(), plain.centrePose(1).translation().y(), plain.centrePose(1).translation().z(), plain.beyondValidity(), moved.beyondValidity());
      fmt::print("{}\n", line);
      step_place.fill(0.0);
    }
  }
  if (verbose) {
    fmt::print("place {:.3g} angle {:.3g} velocity {:.3g} force {:.3g} torque {:.3g} rendered {:.3g} {:.3g} error {:.3g} most {:.3g} {:.3g}\n", place, angle, velocity, force, torque, rendered, rendered_torque, position_error, most_force, most_torque);
    for (const std::string& line : plain.log()) fmt::print("{}\n", line);
  }
  EXPECT_LE(place, kPlace);
  EXPECT_LE(force, kForce);
  EXPECT_LE(torque, kTorque);
  EXPECT_LE(rendered, kForce);
  EXPECT_LE(rendered_torque, kTorque);
  EXPECT_LE(position_error, kPlace);
  EXPECT_EQ(plain.log(), moved.log());
  EXPECT_EQ(plain.beyondValidity(), moved.beyondValidity());
  EXPECT_GT(most_force, 3.0);
  EXPECT_GE(plain.step().step, 2U) << "the peg was mounted";
}

}  // namespace
}  // namespace tenon::session
