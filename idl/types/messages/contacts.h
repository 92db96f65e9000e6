#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "idl/types/spatial.h"

/// Contacts: of a held object for the station that holds it, and of collision pairs.
namespace tenon {

inline constexpr int kManifoldContacts = 16;

/// A contact of the held body B with another body A, as a half-space fixed in A: B is admissible while
/// normal_A · p_AoP_A >= offset for its contact point P.
struct ManifoldContact {
  ObjectId other;
  Vector3f p_BoP_B = Vector3f::Zero();   ///< [m] contact point P, fixed in B
  Vector3f normal_A = Vector3f::Zero();  ///< unit normal, away from A
  float offset = 0.0F;                   ///< [m] of the plane from A's origin, along the normal
  float gap = 0.0F;  ///< [m] at the manifold's tick, signed, measured from the dilated surface
  Vector3f velocity_W = Vector3f::Zero();  ///< [m/s] of the point of A that coincides with P, in W
};

/// The coupling of another hand, which holds the same object or one nearby.
struct HandPull {
  HandId hand;
  ObjectId object;  ///< that it holds
  Pose X_WG;        ///< goal pose of the object for that hand
  Eigen::Matrix<float, 6, 1> V_WG =
      Eigen::Matrix<float, 6, 1>::Zero();  ///< twist of the goal: linear, of its origin, then angular
  Vector3 p_BoC_B = Vector3::Zero();       ///< [m] the point of the object that it holds
  double stiffness = 0.0;                  ///< [N/m]
  double rotational_stiffness = 0.0;       ///< [Nm/rad]
};

inline constexpr int kOtherPulls = 2;
inline constexpr double kNeighbourReach = 0.1;  ///< [m] between the objects' bounding spheres

/// A body that a hand's object touches.
struct ManifoldBody {
  ObjectId object;
  std::uint32_t epoch = 0;  ///< of that body: increased with every jump of its pose
};

inline constexpr int kManifoldBodies = 4;

/// All contacts of the object that one hand holds, with what its station needs to render their force locally.
struct HandManifold {
  HandId hand;
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  std::uint32_t sent = 0;         ///< number of this hand's manifolds on the topic so far: what is lost shows
  std::uint32_t answers_seq = 0;  ///< DeviceSample::seq of the newest sample the server had used
  ObjectId object;                ///< that this hand holds; invalid for none
  std::uint32_t object_epoch = 0;
  Pose X_HO;               ///< of the grasp, constant while it is held
  Pose X_WO;               ///< proxy pose (god object)
  Wrench F_Ho_W;           ///< wrench of the coupling on the hand, about its origin, computed by the server
  double stiffness = 0.0;  ///< [N/m] of the coupling
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
  double validity_radius =
      0.0;  ///< [m] displacement of the object's points within which no unlisted contact can occur
  std::uint32_t step_revision = 0;
  bool frozen = false;  ///< the object is held still: stale input, pause or emergency stop
  /// Other hands that hold the object, by HandId; after them, with an invalid one and as a soft spring whose
  /// goal is far away, what other sources contribute (ForceContribution); then, nearest first, hands that
  /// hold an object within kNeighbourReach of this one, for whoever simulates how that object gives way.
  FixedVector<HandPull, kOtherPulls> others;
  FixedVector<ManifoldContact, kManifoldContacts> contacts;
  /// The bodies of `contacts`, those with the smallest gaps, so that a station knows of their jumps as it
  /// does by object_epoch of the held object's
  FixedVector<ManifoldBody, kManifoldBodies> bodies;
};

/// Contact state of a collision pair.
struct PairContact {
  ObjectId a;           ///< pointshell side
  ObjectId b;           ///< SDF side
  bool enabled = true;  ///< takes part in collisions
  bool colliding = false;
  std::uint32_t contacts = 0;      ///< listed points that touch
  Wrench F_Ao_W;                   ///< wrench of b on a, about a's origin
  Vector3 p_WP = Vector3::Zero();  ///< [m] mean of the contact points
  double depth = 0.0;              ///< [m] penetration depth of the deepest point in the field, 0 when apart
  double gap = 0.0;                ///< [m] smallest signed gap to the dilated surface
  double load_percent = 0.0;       ///< [%] computational load (paper eq. 2)
  double peak_force = 0.0;         ///< [N] since the last sample of this topic
  double peak_depth = 0.0;         ///< [m] since the last sample of this topic
};

inline constexpr std::size_t kMatrixBytes = 1100;

/// Which pairs of the scene may collide, sent when that changes, in numbered parts.
struct CollisionMatrix {
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  Tick tick = 0;
  /// bit i of byte b: pair 8 * (part * kMatrixBytes + b) + i is enabled, and not of objects of one group
  std::vector<std::uint8_t> bits;
};

inline constexpr int kPairsPerSample = 6;

/// Pairs that touched since the last sample and some others round robin, in numbered parts.
struct ContactPairs {
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  Tick tick = 0;
  FixedVector<PairContact, kPairsPerSample> pairs;
};

}  // namespace tenon
