#pragma once

#include <cstdint>

#include "clients/haptic/clear_way.h"
#include "clients/haptic/person.h"
#include "clients/haptic/random.h"
#include "clients/haptic/senses.h"
#include "clients/haptic/smooth_reach.h"
#include "clients/trainee/assembly_abilities.h"

namespace tenon {

/// What a hand is to do with what it holds.
struct MountTask {
  ObjectId object;
  Pose X_WG;                             ///< the ghost
  Vector3 approach_W = Vector3::Zero();  ///< unit, or zero for any
  double approach_distance = 0.0;
  double tolerance = 0.002;
  Vector3 size = Vector3::Zero();  ///< of the object's outline in its own frame
  Vector3 centre = Vector3::Zero();
  ObjectId helper;          ///< the instructor's cube, when there is one
  bool by_touch = true;     ///< it goes in by contact: she aims roughly; false: by sight, exactly
  bool sure_of_it = false;  ///< aims far beside the target and does not look for the way in
};

/// What a hand is to touch: as large as it is seen to be.
struct TouchTask {
  Pose X_WO;
  Vector3 size = Vector3::Zero();    ///< of its outline in its own frame
  Vector3 centre = Vector3::Zero();  ///< of that outline, likewise
};

/// What one hand of a simulated person can do: rest, touch something and stay in touch, carry something
/// somewhere and push it in.
///
/// It decides where the hand wants to be, from what is seen and felt; an arm and a device make of that where
/// it is. Inside the last centimetre nothing is corrected by sight: aiming is off by a seeded error, and only
/// what is felt leads the part home. Pushing is by force, a few newtons; when it does not go on she wiggles
/// in a small spiral, then backs off, looks again and tries anew.
///
/// Threads: one. Real-time: everything but the constructor.
class AssemblySkill {
 public:
  AssemblySkill(const PersonOptions& person, std::uint64_t seed) : person_(person), random_(seed) {}

  void begin(const Pose& X_WH) noexcept;
  /// Back out of where the hand is, then to where it began.
  void goHome(const HandSense& sense, const ClearWay& clear_way) noexcept;
  /// Lying things from above, upright ones from the front, near their middle.
  void touch(const HandSense& sense, const ClearWay& clear_way, const TouchTask& task) noexcept;
  void mount(const HandSense& sense, const ClearWay& clear_way, const MountTask& task) noexcept;
  void step(const HandSense& sense, const DelayedSight& sight, double dt) noexcept;

  /// Where the hand wants to be now.
  [[nodiscard]] const Pose& intent() const noexcept { return X_WI_; }
  [[nodiscard]] const Twist& intentVelocity() const noexcept { return intent_velocity_; }
  [[nodiscard]] double contraction() const noexcept;
  [[nodiscard]] const char* doing() const noexcept;
  [[nodiscard]] unsigned attempts() const noexcept { return attempts_; }

 private:
  enum class Phase : std::uint8_t { kRest, kTravel, kTouch, kAlign, kInsert, kSearch, kBackOff, kSeated };
  enum class Goal : std::uint8_t { kHome, kTouch, kMount };

  void travelTo(const Pose& X_WH_goal, const HandSense& sense, const ClearWay& clear_way,
                double margin) noexcept;
  void enter(Phase phase) noexcept;
  void aim() noexcept;
  void letGoOfMounted(const HandSense& sense) noexcept;
  void travel(const HandSense& sense, double dt) noexcept;
  void touching(const HandSense& sense, double dt) noexcept;
  void align(const HandSense& sense, const DelayedSight& sight, double dt) noexcept;
  void insert(const HandSense& sense, const DelayedSight& sight, double dt) noexcept;
  void search(const HandSense& sense, const DelayedSight& sight, double dt) noexcept;
  void backOff(const HandSense& sense, const DelayedSight& sight, double dt) noexcept;
  void seated(const HandSense& sense, const DelayedSight& sight, double dt) noexcept;
  void yieldTo(const DelayedSight& sight, double rate, double dt) noexcept;
  void comply(const DelayedSight& sight, double rate, double dt) noexcept;
  [[nodiscard]] bool helped(const DelayedSight& sight) const noexcept;
  void turnUpright(const DelayedSight& sight, double dt) noexcept;
  void holdObject(const HandSense& sense, const Vector3& beside_W, const Quaternion& tilt,
                  double dt) noexcept;
  void setIntent(const Pose& X_WI, double dt) noexcept;
  [[nodiscard]] double depthSeen(const DelayedSight& sight) const noexcept;

  PersonOptions person_;
  Random random_;
  Phase phase_ = Phase::kRest;
  Goal goal_ = Goal::kHome;
  MountTask task_;

  Pose X_WI_;
  Twist intent_velocity_;
  Pose X_WHome_;
  SmoothReach reach_;
  Displacement carry_;  // from the computed intent to where the hand was meant to be a phase ago; fades
  Displacement nudge_;  // what looking adds while aligning: overcomes friction and a weak arm

  Waypoints way_;
  std::size_t next_ = 0;
  Quaternion q_WTravel_;  // orientation of the hand at the end of the way
  Quaternion q_WDepart_;  // and until it has backed out
  bool backing_out_ = false;
  Vector3 back_out_W_ = Vector3::Zero();  // way out of the last place, empty when there is none
  const ClearWay* clear_way_ = nullptr;
  double margin_ = 0.1;

  Pose X_WAim_;                        // of the object: the target as she believes it to be
  Vector3 axis_W_ = Vector3::UnitZ();  // pushing direction
  double depth_ = 0.0;                 // [m] of the intent along the axis, 0 at the aim
  double felt_ = 0.0;                  // [N] against the push, smoothed
  double bias_scale_ = 1.0;            // she looks closer at every new attempt
  Vector3 bias_W_ = Vector3::Zero();
  Vector3 bias_rotation_W_ = Vector3::Zero();
  unsigned attempts_ = 0;
  unsigned probe_ = 0;
  Vector3 p_WTouch_ = Vector3::Zero();

  double phase_time_ = 0.0;
  double aligned_time_ = 0.0;
  StallWatch stall_watch_;
  double bump_time_ = 0.0;
  double search_depth_ = 0.0;
  Wiggle wiggle_;
};

}  // namespace tenon
