#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
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

/// [m] From the origin of every mesh of the plain scene to that of the moved one, in the mesh's frame: far
/// more than the parts are large.
const Vector3 kShift(-2.5, 1.3, -0.8);

constexpr HandId kHand{0};

/// "at: [...], q: ..." of a pose whose orientation is a turn about x.
std::string poseText(const Vector3& p_WC, double degrees, const Vector3& p_OC_O) {
  const Pose X_WC(p_WC, expRotation(Vector3(degrees * std::numbers::pi / 180.0, 0.0, 0.0)));
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
  - name: buoy
    meshes: [{{file: block.stl, unit: mm}}]
    structures: {{voxel: 1 mm, spacing: 3 mm, refinement: 1}}
    start: {{{}}}
    body: {{density: 2700 kg/m3, floating: true}}
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
                     poseText(Vector3(0.3, -0.1, 0.4), 30.0, p_OC_O),
                     poseText(Vector3(0.0, 0.0, 0.031), 0.0, p_OC_O));
}

void writeMesh(const fs::path& file, bake::TriangleMesh mesh, const Vector3& p_OC_O) {
  for (Vector3f& p : mesh.vertices) p = (p.cast<double>() + p_OC_O).cast<float>();
  ASSERT_TRUE(bake::writeStl(file, mesh, 1e-3));
}

bake::TriangleMesh plate() {
  constexpr double kHole = 0.0105, kWall = 0.025, kTop = 0.03;
  bake::TriangleMesh mesh = test::boxMesh({-0.15, -0.15, -0.02}, {0.35, 0.15, 0.0});
  mesh = test::together(mesh, test::boxMesh({kHole, -kWall, 0.0}, {kWall, kWall, kTop}));
  mesh = test::together(mesh, test::boxMesh({-kWall, -kWall, 0.0}, {-kHole, kWall, kTop}));
  mesh = test::together(mesh, test::boxMesh({-kHole, kHole, 0.0}, {kHole, kWall, kTop}));
  return test::together(mesh, test::boxMesh({-kHole, -kWall, 0.0}, {kHole, -kHole, kTop}));
}

LoadedScene load(const fs::path& folder, const Vector3& p_OC_O) {
  fs::create_directories(folder);
  const Vector3 peg(0.01, 0.01, 0.03);
  const Vector3 block(0.02, 0.015, 0.01);
  writeMesh(folder / "plate.stl", plate(), p_OC_O);
  writeMesh(folder / "peg.stl", test::boxMesh(-peg, peg), p_OC_O);
  writeMesh(folder / "block.stl", test::boxMesh(-block, block), p_OC_O);
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
    {300, {0.2, 0, 0.071}, {0, 0, 0}},                       // presses on the peg until it is taken
    {600, {0.2, 0, 0.071}, {0, 0, 0}},                       //
    {1000, {0.2, 0, 0.2}, {0, 0, 0}},                        //
    {2000, {0.2, 0, 0.2}, {0.6, 0.6, 0.5291503}},            // turns it at 1 rad/s
    {3000, {0.2, 0, 0.2}, {0, 0.1, 0}},                      //
    {3400, {0.2, 0, 0.068}, {0, 0.1, 0}},                    // presses an edge on the plate
    {4000, {0.15, 0.05, 0.068}, {0, 0.05, 0.3}},             // slides it, and turns
    {4300, {0.15, 0.05, 0.15}, {0, 0, 0}},                   //
    {4900, {0.0001, 0.0001, 0.15}, {0.001, 0.002, 0.004}},   //
    {5700, {0.0001, 0.0001, 0.067}, {0.001, 0.002, 0.004}},  // inserts it, and presses on the ground
    {6500, {0.0001, 0.0001, 0.067}, {0.001, 0.002, 0.004}},
    {6600, {0.0001, 0.0001, 0.12}, {0, 0, 0}},
    {6800, {-0.03, 0.06, 0.1}, {0, 0, 0}},  // with the pointer to the block
    {7100, {-0.03, 0.08, 0.015}, {0, 0, 0}},
    {7600, {-0.09, 0.08, 0.015}, {0, 0, 0}},  // pushes it, at its middle
    {8000, {-0.09, 0.08, 0.015}, {0, 0, 0}},
};
constexpr Tick kOriginTicks = 8000;

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
class SessionWithStation {
 public:
  SessionWithStation(const fs::path& folder, const Vector3& p_OC_O)
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
    // an external push: moderate about the centre, far more torque than is allowed about a distant origin
    if (input.tick == 1500) {
      constexpr std::uint32_t kBuoy = 3;
      const Vector3 p_OC_W = objectPose(kBuoy).rotation() * centres_[kBuoy];
      const Wrench F_Oc_W{Vector3(2.0, 0.0, 1.0), Vector3(0.0, 0.0, 0.001)};
      input.changes.push_back({.kind = ChangeKind::kContributeForce,
                               .object = ObjectId{kBuoy},
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

/// The largest difference of two wrenches so far, beyond one part in a hundred.
struct Difference {
  void add(const Wrench& a, const Wrench& b) {
    constexpr double kPart = 0.01;  // [-]
    force = std::max(force, (a.force - b.force).norm() - kPart * a.force.norm());
    torque = std::max(torque, (a.torque - b.torque).norm() - kPart * a.torque.norm());
    most = std::max(most, a.force.norm());
  }
  double force = 0.0, torque = 0.0;  // [N], [Nm]
  double most = 0.0;                 // [N] of the forces themselves
};

// the pointer takes the peg, turns it at 1 rad/s, presses and slides it, inserts it; then it pushes a block
// that has fallen from 20 mm; something else pushes a body that floats
TEST_F(MeshOrigin, DoesNotMatter) {
  constexpr double kPlace = 1e-5;   // [m]
  constexpr double kForce = 0.01;   // [N] of the coupling for kPlace
  constexpr double kTorque = 1e-3;  // [Nm]
  // [Nm] of the station's local model: which contacts of a manifold represent all may differ
  constexpr double kTorqueOfManifold = 0.03;
  SessionWithStation plain(folder_ / "plain", Vector3::Zero());
  SessionWithStation moved(folder_ / "moved", -kShift);
  double place = 0.0, position_error = 0.0;
  Difference server, station;
  for (Tick tick = 1; tick <= kOriginTicks; ++tick) {
    plain.tick();
    moved.tick();
    for (std::size_t i = 0; i < plain.objects(); ++i) {
      const Pose X_WC = plain.centrePose(i);
      const double off = (X_WC.translation() - moved.centrePose(i).translation()).norm();
      EXPECT_LE(off, kPlace) << plain.name(i) << ", tick " << tick;
      place = std::max(place, off);
    }
    server.add(plain.serverForce(), moved.serverForce());
    station.add(plain.renderedForce(), moved.renderedForce());
    position_error =
        std::max(position_error, std::abs(plain.step().position_error - moved.step().position_error));
    ASSERT_LE(place, kPlace) << "tick " << tick;
  }
  EXPECT_LE(server.force, kForce);
  EXPECT_LE(server.torque, kTorque);
  EXPECT_LE(station.force, kForce);
  EXPECT_LE(station.torque, kTorqueOfManifold);
  EXPECT_LE(position_error, kPlace);
  EXPECT_EQ(plain.log(), moved.log());
  EXPECT_EQ(plain.beyondValidity(), moved.beyondValidity());
  // all of that has happened
  EXPECT_GT(server.most, 3.0);
  EXPECT_EQ(plain.step().step, 2U) << "the peg was mounted";
  EXPECT_LT(plain.centrePose(2).translation().x(), -0.11) << "the block was pushed";
  EXPECT_GT((plain.centrePose(3).translation() - Vector3(0.3, -0.1, 0.4)).norm(), 0.01)
      << "the floating body too";
}

}  // namespace
}  // namespace tenon::session
