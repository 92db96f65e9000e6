#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages.h"
#include "idl/types/spatial.h"
#include "server/collision/island_solver.h"
#include "server/structures/haptic_structures.h"

namespace tenon {

/// An object that has a mass: nobody holds it, it falls, flies and is pushed.
struct BodySpec {
  double mass = 1.0;                          ///< [kg]
  Vector3 p_OC_O = Vector3::Zero();           ///< centre of mass
  Matrix3 inertia_C_O = Matrix3::Identity();  ///< [kg m^2] about it
  bool floating = false;                      ///< gravity does not pull at it
  double damping = 0.0;                       ///< [1/s] share of its speed that the air takes
  /// Coulomb's coefficient while it is free, on whatever its pair has no friction of its own with
  /// (environment_friction.cpp).
  double friction = 0.0;
};

/// An object of the scene as it never changes.
struct ObjectSpec {
  std::string name;   ///< in files and logs
  std::string title;  ///< on screen: the trainer's word
  std::string kind = "part";
  std::string color = "#b0b7bf";
  std::uint32_t group = 0;                             ///< objects of one group never touch; 0: no group
  Pose X_WO;                                           ///< at the start
  ObjectStatus status = ObjectStatus::kParked;         ///< at the start
  std::shared_ptr<const HapticStructures> structures;  ///< none: seen, never felt
  double stiffness = 1000.0;     ///< [N/m] of its penalty force (of what a tracker moves, and the baselines)
  std::optional<BodySpec> body;  ///< none: it stands where it is put
};

/// Two objects that may touch.
struct PairSpec {
  ObjectId a;             ///< asked as a shell
  ObjectId b;             ///< asked as a field
  double dilation = 0.0;  ///< [m] of b's surface
  bool enabled = true;    ///< at the start: a cell of the configuration matrix
  bool sensing = false;   ///< felt as vibration, never resisted: a forearm
  /// In the islands, on patches (island_friction.cpp), instead of the friction of bodies; none: theirs.
  std::optional<Friction> friction;
};

enum class HandKind : std::uint8_t {
  kCoupled,  ///< holds its object by a virtual coupling and feels it
  kTracked,  ///< its object is where the tracker is
};

/// Somebody's hand (the paper's hdIndex) or tracked limb.
struct HandSpec {
  std::string name;
  Role role = Role::kTrainee;
  HandKind kind = HandKind::kCoupled;
  ObjectId object;            ///< what it moves when nothing else is said: pointer, drill, cube, forearm
  double stiffness = 1000.0;  ///< [N/m] of the coupling
  double rotational_stiffness = 20.0;  ///< [Nm/rad]
};

/// The read-only scene: built once, shared by all threads.
struct Scene {
  std::vector<ObjectSpec> objects;
  std::vector<PairSpec> pairs;
  std::vector<HandSpec> hands;
  Vector3 gravity_W{0.0, 0.0, -9.81};  ///< [m/s^2]

  [[nodiscard]] ObjectId objectNamed(std::string_view name) const;  ///< invalid when there is none
  [[nodiscard]] HandId handNamed(std::string_view name) const;
  /// The pair of these two, in either order; -1 when they never touch.
  [[nodiscard]] int pairOf(ObjectId a, ObjectId b) const;
};

}  // namespace tenon
