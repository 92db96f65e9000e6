#pragma once

#include <cstdint>

#include "clients/simulated_person/insertion_primitives.h"
#include "clients/simulated_person/path_planner.h"
#include "clients/simulated_person/perception.h"
#include "clients/simulated_person/person.h"
#include "clients/simulated_person/reach_controller.h"
#include "idl/types/random.h"

namespace tenon::simulated_person {

/// Mounts the object that the hand holds.
struct MountTask {
  ObjectId object;
  Pose X_WG;                                   ///< target pose (the ghost)
  Vector3 approach_W = Vector3::Zero();        ///< unit direction of insertion; zero: any
  double approach_distance = 0.0;              ///< [m] of the pose before the target where insertion begins
  double tolerance = 0.002;                    ///< [m] of the target position
  Vector3 size = Vector3::Zero();              ///< [m] of the object's bounding box, in its own frame
  Vector3 centre = Vector3::Zero();            ///< [m] of that box, likewise
  ObjectId assistant;                          ///< the instructor's pointer; invalid when there is none
  Vector3 assistant_centre = Vector3::Zero();  ///< [m] of its bounding box, in its own frame
  bool guided_by_contact = true;  ///< aims with an error and relies on contact; false: without an error
  bool misplaced = false;         ///< inserts at a wrong pose and does not search for the opening
};

/// Touches an object.
struct TouchTask {
  Pose X_WO;
  Vector3 size = Vector3::Zero();    ///< [m] of its bounding box, in its own frame
  Vector3 centre = Vector3::Zero();  ///< [m] of that box, likewise
};

/// Behaviour of one hand of a simulated person: rest, touch an object and stay in touch, carry the held
/// object to a target and insert it.
///
/// Decides the intended hand pose I from the exact poses of objects as they were a reaction time ago
/// (DelayedPerception: no noise, no occlusion) and from the displayed force (low pass of 30 ms); the
/// actual pose follows from the simulated arm and the device. The only error is that of
/// the aim: a lateral and an angular one, drawn from the seed once for each mount.
///
/// Up to the begin of the insertion the object's exact delayed pose is brought to that aim, to a millimetre.
/// From then on the part is guided laterally by contact; exact delayed poses still tell its depth, a tilt
/// that the hand turns against, its orientation in a spiral search and, with a force at the seat, its lateral
/// place, and whether it is far beside its aim. Insertion controls the force (a few newtons); when it stalls
/// it searches in a small spiral, then retracts, aims again with a smaller error and retries. A part that is
/// far beside its aim, as after a hand was frozen, is brought back and aligned again. Where contact does not
/// guide (MountTask::guided_by_contact), exact delayed poses align it to the end.
///
/// Threads: one. Real-time: everything but the constructor.
class AssemblyBehavior {
 public:
  AssemblyBehavior(const PersonOptions& person, std::uint64_t seed) : person_(person), random_(seed) {}

  /// At rest at X_WH, which is also the home pose.
  void begin(const Pose& X_WH) noexcept;
  /// Withdraws against the last approach, then moves to the home pose. `planner` must outlive the motion,
  /// here and below.
  void goHome(const HandPerception& hand, const PathPlanner& planner) noexcept;
  /// Approaches the face of touchNormal() and presses lightly on its centre.
  void touch(const HandPerception& hand, const PathPlanner& planner, const TouchTask& task) noexcept;
  void mount(const HandPerception& hand, const PathPlanner& planner, const MountTask& task) noexcept;
  /// Advances by `dt` [s].
  void step(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept;

  /// Goes on after an interruption in which the device was brought elsewhere and the hand was re-anchored.
  void resume(const HandPerception& hand, const DelayedPerception& perception) noexcept;

  /// X_WI, the pose that the arm is to move the hand to.
  [[nodiscard]] const Pose& intendedPose() const noexcept { return X_WI_; }
  [[nodiscard]] const Twist& intendedVelocity() const noexcept { return intended_velocity_; }
  /// The hand was wanted beyond the reach of its device in the last step.
  [[nodiscard]] bool beyondReach() const noexcept { return beyond_reach_; }
  /// [-] Co-contraction of the arm, 0 relaxed to 1 braced.
  [[nodiscard]] double contraction() const noexcept;
  /// A word or two for progress output and tests.
  [[nodiscard]] const char* activity() const noexcept;

 private:
  enum class Phase : std::uint8_t { kRest, kTravel, kTouch, kAlign, kInsert, kSearch, kRetract, kSeated };
  enum class Goal : std::uint8_t { kHome, kTouch, kMount };

  /// Plans a path that keeps `margin` [m] away from obstacles.
  void travelTo(const Pose& X_WH_goal, const HandPerception& hand, const PathPlanner& planner,
                double margin) noexcept;
  void enter(Phase phase) noexcept;
  /// X_WAim_ from the target and the scaled aiming error.
  void aim() noexcept;
  void releaseMounted(const HandPerception& hand) noexcept;
  /// Follows the path for `dt` [s].
  void travel(const HandPerception& hand, double dt) noexcept;
  /// Presses on the touched point, or probes another one; `dt` [s].
  void touchStep(const HandPerception& hand, double dt) noexcept;
  /// Aligns by the delayed pose before the insertion; `dt` [s].
  void align(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept;
  /// Pushes along the axis; `dt` [s].
  void insert(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept;
  /// Spiral search under a light push; `dt` [s].
  void search(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept;
  /// Pulls back and aims again; `dt` [s].
  void retract(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept;
  /// Presses lightly at the target until the server accepts the pose; `dt` [s].
  void holdSeated(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept;
  /// Moves the aim laterally and in rotation towards the perceived pose of the object, at `rate` [1/s] for
  /// `dt` [s].
  void comply(const DelayedPerception& perception, double rate, double dt) noexcept;
  /// In rotation only; `rate` [1/s], `dt` [s].
  void complyInRotation(const DelayedPerception& perception, double rate, double dt) noexcept;
  /// The instructor's pointer is near the object.
  [[nodiscard]] bool isHelped(const DelayedPerception& perception) const noexcept;
  /// Turns the hand against a visible tilt of the object; `dt` [s].
  void correctTilt(const DelayedPerception& perception, double dt) noexcept;
  /// Sets the intended hand pose that puts the object at depth_ along the axis, displaced by offset_W and
  /// turned by `tilt`; `dt` [s].
  void intendObjectPose(const HandPerception& hand, const Vector3& offset_W, const Quaternion& tilt,
                        double dt) noexcept;
  /// X_WI and its velocity over `dt` [s].
  void setIntended(const Pose& X_WI, double dt) noexcept;
  /// The object is perceived so far beside the axis that pushing cannot insert it: it has to be aligned
  /// again.
  [[nodiscard]] bool isAstray(const DelayedPerception& perception) const noexcept;
  /// [m] Of the object along the axis as perceived, 0 at the aim.
  [[nodiscard]] double perceivedDepth(const DelayedPerception& perception) const noexcept;

  PersonOptions person_;
  Random random_;
  Phase phase_ = Phase::kRest;
  Goal goal_ = Goal::kHome;
  MountTask task_;

  Pose X_WI_;
  Twist intended_velocity_;
  Pose X_WHome_;
  bool beyond_reach_ = false;
  ReachController reach_controller_;
  Displacement transition_;  // keeps the intended pose continuous where phases change; decays
  Displacement
      visual_correction_;  // of the hand, integrated by sight: compensates friction and a compliant arm

  Waypoints path_;
  std::size_t next_waypoint_ = 0;
  Quaternion q_WTravel_;                    // orientation of the hand at the end of the path
  Quaternion q_WDepart_;                    // and on the withdrawal
  bool withdrawing_ = false;                // path_[0] is the end of a withdrawal
  Vector3 withdrawal_W_ = Vector3::Zero();  // [m] out of the last target; zero when there was none
  const PathPlanner* planner_ = nullptr;
  double margin_ = 0.1;  // [m]

  Pose X_WAim_;                               // of the object: the target with the aiming error
  Vector3 axis_W_ = Vector3::UnitZ();         // unit direction of the push
  double depth_ = 0.0;                        // [m] of the intended object pose along the axis, 0 at the aim
  double reaction_ = 0.0;                     // [N] reaction force against the push, low-pass filtered
  double aim_error_scale_ = 1.0;              // [-] falls with every new attempt
  Vector3 aim_error_W_ = Vector3::Zero();     // [m]
  Vector3 aim_rotation_W_ = Vector3::Zero();  // [rad] rotation vector
  unsigned probe_ = 0;
  Vector3 p_WTouch_ = Vector3::Zero();

  double phase_time_ = 0.0;       // [s] since the phase began
  double aligned_time_ = 0.0;     // [s] without interruption
  double obstructed_time_ = 0.0;  // [s] without interruption
  double idle_time_ = 0.0;        // [s] of pushing without resistance or progress
  double retract_time_ = 0.0;     // [s] at least, of a retraction
  double deepest_ = 0.0;          // [m] perceived in this phase
  double search_depth_ = 0.0;     // [m] where the search began
  StallDetector stall_detector_;
  SpiralSearch spiral_search_;
};

}  // namespace tenon::simulated_person
