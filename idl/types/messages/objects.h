#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/localized_text.h"
#include "idl/types/messages/role.h"
#include "idl/types/spatial.h"

/// Objects: their constant data, their state at a tick, who holds them.
namespace tenon {

struct ObjectState {
  ObjectId object;
  std::uint32_t epoch =
      0;  ///< increased with every jump of the pose: displays must not interpolate across it
  Pose X_WO;
  Eigen::Matrix<float, 6, 1> V_WO =
      Eigen::Matrix<float, 6, 1>::Zero();  ///< linear [m/s], angular [rad/s], in W
  HandId holder;                           ///< invalid when no hand holds it
  std::uint8_t status = 0;                 ///< ObjectStatus
  bool in_contact = false;
};

enum class ObjectStatus : std::uint8_t {
  kHidden,   ///< not in the scene: neither displayed nor in collisions
  kParked,   ///< kinematic and at rest, collides
  kHeld,     ///< moved by a hand through its coupling, subject to contacts
  kTracked,  ///< kinematic: has the pose of its tracker whatever it touches (forearm, head)
  kFixed,    ///< mounted
  kFree,     ///< dynamic: moves by gravity and contact forces
};

inline constexpr int kStatesPerFrame = 12;

/// Object states at one tick, in numbered parts: in lockstep of all objects, in real time of those that moved
/// and, round robin, of some at rest.
struct WorldFrame {
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  std::uint32_t step_revision = 0;  ///< of the StepState this frame belongs to
  FixedVector<ObjectState, kStatesPerFrame> states;
};

/// The constant data of an object.
struct SceneObject {
  ObjectId object;
  std::string name;
  std::string title;
  std::string kind;  ///< how a display draws it: part, tool, pointer, assistant, forearm, head, scene
  std::string structure_hash;         ///< of the haptic structures, empty for none
  std::string color;                  ///< `#rrggbb` or `#rrggbbaa`
  Pose X_WO;                          ///< initial pose
  Vector3 size = Vector3::Zero();     ///< [m] of the bounding box in the object's frame
  Vector3 centre = Vector3::Zero();   ///< [m] of the bounding box, in O
  std::vector<LocalizedText> titles;  ///< of which `title` is the first
};

/// The constant data of a hand of the scenario, moved by a device.
struct SceneHand {
  HandId hand;
  std::string name;
  Role role = Role::kTrainee;   ///< whose clients may move it
  ObjectId object;              ///< that it moves while it holds no other; may be invalid
  HandLimits limits;            ///< in force now; chosen by its station's link
  bool guidance_alone = false;  ///< its station's link is too long for contacts (kLongestContactDelay)
};

/// State of an object for late joiners: after each jump, and once in 1000 ticks.
struct ObjectSnapshot {
  Tick tick = 0;
  ObjectState state;
};

/// Which hand holds an object.
struct GrabState {
  ObjectId object;
  HandId hand;              ///< invalid: no hand
  std::uint32_t epoch = 0;  ///< of the object
  Pose X_HO;                ///< of the grasp
  Tick tick = 0;
};

}  // namespace tenon
