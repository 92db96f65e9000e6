#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/simulation/environment.h"
#include "tests/support/analytic_structures.h"

namespace tenon::test {

/// Structures of a box, built once per size.
inline StructuresPtr boxShape(const Vector3& size) {
  static std::vector<std::pair<Vector3, StructuresPtr>> shapes;
  for (const auto& [known, shape] : shapes) {
    if (known == size) return shape;
  }
  return shapes.emplace_back(size, boxStructures(size, 0.002, 0.005)).second;
}

/// A homogeneous box of `mass` [kg].
inline simulation::BodySpec boxBody(const Vector3& size, double mass, bool floating) {
  const Vector3 squares = size.cwiseProduct(size);
  const Vector3 moments(squares.y() + squares.z(), squares.x() + squares.z(), squares.x() + squares.y());
  simulation::BodySpec body;
  body.mass = mass;
  body.inertia_C_O = (mass / 12.0) * Matrix3(moments.asDiagonal());
  body.floating = floating;
  return body;
}

/// Builds a scene; ids are assigned in the order of calls.
class SmallScene {
 public:
  ObjectId object(const std::string& name, StructuresPtr structures, const Vector3& p_WO,
                  ObjectStatus status = ObjectStatus::kParked, std::uint32_t group = 0) {
    simulation::ObjectSpec spec;
    spec.name = name;
    spec.structures = std::move(structures);
    spec.X_WO = Pose(p_WO);
    spec.status = status;
    spec.group = group;
    scene_.objects.push_back(spec);
    return {static_cast<std::uint32_t>(scene_.objects.size() - 1)};
  }
  /// A free body: a homogeneous box of `mass` [kg].
  ObjectId freeBox(const std::string& name, const Vector3& size, double mass, const Vector3& p_WO,
                   bool floating = false) {
    const ObjectId object = this->object(name, boxShape(size), p_WO, ObjectStatus::kFree);
    scene_.objects.back().body = boxBody(size, mass, floating);
    return object;
  }
  HandId hand(const std::string& name, ObjectId object,
              simulation::HandKind kind = simulation::HandKind::kCoupled) {
    simulation::HandSpec spec;
    spec.name = name;
    spec.object = object;
    spec.kind = kind;
    scene_.hands.push_back(spec);
    return {static_cast<std::uint32_t>(scene_.hands.size() - 1)};
  }
  /// `dilation` [m] of the object `field` from now on.
  std::size_t pair(ObjectId shell, ObjectId field, bool sensing = false, double dilation = 0.0) {
    StructuresPtr& other = scene_.objects[field.value].structures;
    if (other) other = dilated(other, dilation);
    scene_.pairs.push_back({shell, field, true, sensing});
    return scene_.pairs.size() - 1;
  }
  void gravity(const Vector3& gravity_W) { scene_.gravity_W = gravity_W; }
  [[nodiscard]] simulation::ObjectSpec& spec(ObjectId object) { return scene_.objects[object.value]; }
  [[nodiscard]] std::shared_ptr<const simulation::Scene> build() const {
    return std::make_shared<simulation::Scene>(scene_);
  }

 private:
  simulation::Scene scene_;
};

inline constexpr double kPointerRadius = 0.012;  ///< [m]
inline constexpr double kCubeEdge = 0.04;        ///< [m]

inline StructuresPtr pointerShape() {
  static const StructuresPtr shape = sphereStructures(kPointerRadius, 0.002, 0.003);
  return shape;
}
inline StructuresPtr cubeShape() {
  static const StructuresPtr shape = boxStructures(Vector3::Constant(kCubeEdge), 0.002, 0.005);
  return shape;
}
inline StructuresPtr floorShape() {
  static const StructuresPtr shape = floorStructures(0.6, 0.005);
  return shape;
}

/// The hand becomes present, at p_WH.
inline void activateHand(simulation::Environment& environment, HandId hand, const Vector3& p_WH) {
  environment.setHandPresent(hand, true);
  environment.setHandPose(hand, Pose(p_WH), {});
}

/// Moves the hand in a straight line from its pose to p_WH, in `ticks` steps of the environment.
inline void moveHandTo(simulation::Environment& environment, HandId hand, const Vector3& p_WH, int ticks) {
  const Pose start = environment.hands()[hand.value].X_WH;
  for (int tick = 1; tick <= ticks; ++tick) {
    const double fraction = static_cast<double>(tick) / ticks;
    const Vector3 p = start.translation() + fraction * (p_WH - start.translation());
    environment.setHandPose(hand, Pose(p, start.rotation()), {});
    environment.step();
  }
}

inline void stepTicks(simulation::Environment& environment, int ticks) {
  for (int tick = 0; tick < ticks; ++tick) environment.step();
}

}  // namespace tenon::test
