#pragma once

#include "clients/haptic/local_model.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/objects.h"

namespace tenon::test {

inline constexpr HandId kHand{0};
inline constexpr ObjectId kFloor{0};
inline constexpr ObjectId kBall{1};

/// Server stand-in with analytic contacts of one ball (object 1) and one floor (object 0, plane z = 0 of its
/// frame).
class PlaneServer {
 public:
  /// `stiffness` [N/m] of the hand.
  explicit PlaneServer(double stiffness = 1000.0) : stiffness_(stiffness) {
    SceneObject floor;
    floor.object = kFloor;
    floor.kind = "scene";
    SceneObject ball;
    ball.object = kBall;
    ball.kind = "pointer";
    objects_ = {floor, ball};
  }

  /// Manifold of `tick`, which answers the input of the tick before: the ball at the hand, kept above the
  /// floor.
  HandManifold manifold(Tick tick, const Pose& X_WH) const {
    HandManifold manifold;
    manifold.hand = kHand;
    manifold.tick = tick;
    manifold.answers_seq = static_cast<std::uint32_t>(tick - 1);
    manifold.object = kBall;
    manifold.object_epoch = epoch;
    manifold.stiffness = stiffness_;
    manifold.rotational_stiffness = 20.0;
    manifold.validity_radius = validity_radius;
    manifold.X_WO = X_WH;
    manifold.X_WO.translation().z() = std::max(floor_height + radius, X_WH.translation().z());
    ManifoldContact contact;
    contact.other = kFloor;
    contact.p_BoP_B = Vector3f(0.0F, 0.0F, static_cast<float>(-radius));
    contact.normal_A = Vector3f::UnitZ();
    contact.gap = static_cast<float>(manifold.X_WO.translation().z() - radius - floor_height);
    manifold.contacts.push_back(contact);
    if (lists_floor) manifold.bodies.push_back({kFloor, floor_epoch});
    return manifold;
  }
  WorldFrame frame(Tick tick) const {
    WorldFrame frame;
    frame.tick = tick;
    ObjectState floor;
    floor.object = kFloor;
    floor.epoch = floor_epoch;
    floor.X_WO = Pose(Vector3(0.0, 0.0, floor_height));
    floor.status = static_cast<std::uint8_t>(ObjectStatus::kFixed);
    ObjectState ball;
    ball.object = kBall;
    ball.epoch = epoch;
    ball.status = static_cast<std::uint8_t>(ObjectStatus::kHeld);
    frame.states.push_back(floor);
    frame.states.push_back(ball);
    return frame;
  }
  const std::vector<SceneObject>& objects() const { return objects_; }

  double radius = 0.012;          ///< [m] of the ball
  double floor_height = 0.0;      ///< [m]
  double validity_radius = 0.05;  ///< [m]
  std::uint32_t epoch = 1;        ///< of the ball
  std::uint32_t floor_epoch = 1;
  bool lists_floor = false;  ///< among the bodies that may jump

 private:
  double stiffness_;  ///< [N/m]
  std::vector<SceneObject> objects_;
};

}  // namespace tenon::test
