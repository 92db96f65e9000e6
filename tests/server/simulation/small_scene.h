#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/simulation/environment.h"
#include "tests/support/analytic_structures.h"

namespace tenon::test {

/// One for each size, made once.
inline StructuresPtr boxShape(const Vector3& size) {
  static std::vector<std::pair<Vector3, StructuresPtr>> shapes;
  for (const auto& [known, shape] : shapes) {
    if (known == size) return shape;
  }
  return shapes.emplace_back(size, boxStructures(size, 0.002, 0.005)).second;
}

inline BodySpec boxBody(const Vector3& size, double mass, bool floating) {
  const Vector3 squares = size.cwiseProduct(size);
  const Vector3 moments(squares.y() + squares.z(), squares.x() + squares.z(), squares.x() + squares.y());
  BodySpec body;
  body.mass = mass;
  body.inertia_C_O = (mass / 12.0) * Matrix3(moments.asDiagonal());
  body.floating = floating;
  return body;
}

/// Puts a scene together in the order of calls; ids are that order.
class SmallScene {
 public:
  ObjectId object(const std::string& name, StructuresPtr structures, const Vector3& p_WO,
                  ObjectStatus status = ObjectStatus::kParked, std::uint32_t group = 0) {
    ObjectSpec spec;
    spec.name = name;
    spec.structures = std::move(structures);
    spec.X_WO = Pose(p_WO);
    spec.status = status;
    spec.group = group;
    scene_.objects.push_back(spec);
    return {static_cast<std::uint32_t>(scene_.objects.size() - 1)};
  }
  /// A box that falls and is pushed, of even density.
  ObjectId freeBox(const std::string& name, const Vector3& size, double mass, const Vector3& p_WO,
                   bool floating = false) {
    const ObjectId object = this->object(name, boxShape(size), p_WO, ObjectStatus::kFree);
    scene_.objects.back().body = boxBody(size, mass, floating);
    return object;
  }
  HandId hand(const std::string& name, ObjectId object, HandKind kind = HandKind::kCoupled) {
    HandSpec spec;
    spec.name = name;
    spec.object = object;
    spec.kind = kind;
    scene_.hands.push_back(spec);
    return {static_cast<std::uint32_t>(scene_.hands.size() - 1)};
  }
  std::size_t pair(ObjectId shell, ObjectId field, bool sensing = false, double dilation = 0.0) {
    scene_.pairs.push_back({shell, field, dilation, true, sensing});
    return scene_.pairs.size() - 1;
  }
  void gravity(const Vector3& gravity_W) { scene_.gravity_W = gravity_W; }
  [[nodiscard]] ObjectSpec& spec(ObjectId object) { return scene_.objects[object.value]; }
  [[nodiscard]] std::shared_ptr<const Scene> build() const { return std::make_shared<Scene>(scene_); }

 private:
  Scene scene_;
};

inline constexpr double kPointerRadius = 0.012;
inline constexpr double kCubeEdge = 0.04;

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

/// The hand is there, at p.
inline void enter(Environment& environment, HandId hand, const Vector3& p_WH) {
  environment.setHandPresent(hand, true);
  environment.setHandPose(hand, Pose(p_WH), {});
}

/// The hand goes straight from where it is to p, in so many ticks.
inline void moveTo(Environment& environment, HandId hand, const Vector3& p_WH, int ticks) {
  const Pose start = environment.hands()[hand.value].X_WH;
  for (int tick = 1; tick <= ticks; ++tick) {
    const double share = static_cast<double>(tick) / ticks;
    const Vector3 p = start.translation() + share * (p_WH - start.translation());
    environment.setHandPose(hand, Pose(p, start.rotation()), {});
    environment.step();
  }
}

inline void stay(Environment& environment, int ticks) {
  for (int tick = 0; tick < ticks; ++tick) environment.step();
}

}  // namespace tenon::test
