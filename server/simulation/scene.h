#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/role.h"
#include "idl/types/spatial.h"
#include "server/collision/island_solver.h"
#include "server/structures/haptic_structures.h"

namespace tenon::simulation {

/// The bounding sphere of an object's surface, constant in its structures. Its centre Q is the object's
/// place: the frame's origin O is wherever CAD put it.
struct BoundingSphere {
  Vector3 p_OQ_O = Vector3::Zero();  ///< [m]
  double radius = 0.0;               ///< [m]
};

/// Of radius 0 about the origin for null, an object without structures.
[[nodiscard]] BoundingSphere boundingSphereOf(const structures::HapticStructures* structures);

/// Mass properties of a free rigid body: while no hand holds it, it falls and moves under contact forces.
struct BodySpec {
  double mass = 1.0;                          ///< [kg]
  Vector3 p_OC_O = Vector3::Zero();           ///< [m] centre of mass C
  Matrix3 inertia_C_O = Matrix3::Identity();  ///< [kg m^2] about C, in the axes of O
  bool floating = false;                      ///< not subject to gravity
  double damping = 0.0;                       ///< [1/s] damping rate of linear and angular velocity
  /// [-] Coulomb's coefficient while the body is free, in pairs without a PairSpec::friction
  /// (environment_friction.cpp).
  double friction = 0.0;
};

/// The constant properties and the initial state of an object.
struct ObjectSpec {
  std::string name;                   ///< in files and logs
  std::string title;                  ///< on screens
  std::vector<LocalizedText> titles;  ///< in each language of the scenario, first `title`
  std::string kind = "part";
  std::string color = "#b0b7bf";
  std::uint32_t group = 0;                      ///< objects of one group never collide; 0: no group
  Pose X_WO;                                    ///< at the start
  ObjectStatus status = ObjectStatus::kParked;  ///< at the start
  std::shared_ptr<const structures::HapticStructures> structures;  ///< null: visible, not collidable
  double stiffness = 1000.0;     ///< [N/m] of penalty forces: tracked objects, and the baseline methods
  std::optional<BodySpec> body;  ///< none: kinematic
};

/// Two objects that may collide: one entry of the collision filter (the paper's configuration matrix).
struct PairSpec {
  ObjectId a;            ///< pointshell side
  ObjectId b;            ///< SDF side
  bool enabled = true;   ///< at the start
  bool sensing = false;  ///< contacts are reported (vibrotactile forearm) but exert no force
  /// Friction of patches inside the island solver (island_friction.cpp), replaces BodySpec::friction in this
  /// pair; none: BodySpec::friction applies.
  std::optional<collision::Friction> friction;
  /// [m] Of the dilation of a's field so much counts for features of b: a share of the clearance, if there is
  /// one. That of b's field is what the bake made of the place.
  double most_dilation_a = std::numeric_limits<double>::infinity();
};

enum class HandKind : std::uint8_t {
  kCoupled,  ///< moves its object through a virtual coupling, with force feedback
  kTracked,  ///< its object has the pose of the tracker; no force feedback
};

/// A participant's hand (the paper's hdIndex) or tracked limb.
struct HandSpec {
  std::string name;
  Role role = Role::kTrainee;
  HandKind kind = HandKind::kCoupled;
  ObjectId object;            ///< default object: moved while the hand holds no other (pointer, forearm)
  double stiffness = 1000.0;  ///< [N/m] of the virtual coupling, unless Environment::setHandStiffness says it
  double rotational_stiffness = 20.0;  ///< [Nm/rad] likewise
};

/// The constant part of the simulation: objects, pairs and hands, with ids as indices.
///
/// Threads: built once, then read by any. Real-time: no (the searches by name are linear).
struct Scene {
  std::vector<ObjectSpec> objects;
  std::vector<PairSpec> pairs;
  std::vector<HandSpec> hands;
  Vector3 gravity_W{0.0, 0.0, -9.81};  ///< [m/s^2]

  [[nodiscard]] ObjectId objectNamed(std::string_view name) const;  ///< invalid id when there is none
  [[nodiscard]] HandId handNamed(std::string_view name) const;      ///< invalid id when there is none
  /// Index of the pair of `a` and `b`, in either order; -1 when there is none.
  [[nodiscard]] int pairOf(ObjectId a, ObjectId b) const;
};

}  // namespace tenon::simulation
