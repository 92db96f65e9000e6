#pragma once

#include <cstdint>
#include <span>

#include "clients/haptic/workspace.h"
#include "clients/simulated_person/path_planner.h"
#include "clients/simulated_person/perception.h"
#include "clients/simulated_person/person.h"
#include "clients/simulated_person/reach_controller.h"
#include "idl/types/messages/steps.h"

namespace tenon::simulated_person {

/// Simulated instructor: pushes the trainee's part sideways with the pointer when its insertion stalls.
///
/// Perceives the step and, with a reaction delay, the object poses. When a part has been near its target for
/// a few seconds without progress, the instructor moves the workspace there ("go to trainee"), places the
/// pointer beside the part on the side to which it is off, pushes it towards the target with a few newtons
/// until it enters, and returns.
///
/// Threads: one. Real-time: step.
class SimulatedInstructor {
 public:
  explicit SimulatedInstructor(const PersonOptions& person) : person_(person) {}

  /// At rest at the home pose X_WH. `objects` must outlive the instructor.
  void begin(std::span<const SceneObject> objects, const Pose& X_WH);
  /// Takes the step to watch.
  void read(const StepState& step);
  /// Advances by `dt` [s]; one millisecond, the clock of DelayedPerception. Moves `workspace` as well.
  void step(const HandPerception& hand, haptic::Workspace& workspace, const haptic::WorldView& world,
            double dt) noexcept;

  /// X_WI, the pose that the arm is to move the hand to.
  [[nodiscard]] const Pose& intendedPose() const noexcept { return reach_controller_.pose(); }
  [[nodiscard]] const Twist& intendedVelocity() const noexcept { return reach_controller_.velocity(); }
  /// [-] Co-contraction of the arm, 0 relaxed to 1 braced.
  [[nodiscard]] double contraction() const noexcept { return phase_ == Phase::kPush ? 1.0 : 0.3; }
  /// In a word or two: for progress output and tests.
  [[nodiscard]] const char* activity() const noexcept;
  /// Number of pushes after which the part entered.
  [[nodiscard]] unsigned helped() const noexcept { return pushes_that_helped_; }

 private:
  enum class Phase : std::uint8_t { kWatch, kTravel, kApproach, kPush, kRelease, kReturn };

  /// The part to watch, and its target.
  struct Task {
    bool active = false;
    ObjectId object;
    Pose X_WG;
    Vector3 approach_W = Vector3::Zero();
    double tolerance = 0.0;  ///< [m]
    std::uint32_t step = 0;
    Tick started = 0;
    Vector3 size = Vector3::Zero();    ///< [m] of the part's bounding box, in its own frame
    Vector3 centre = Vector3::Zero();  ///< [m] of that box, likewise
  };

  void enter(Phase phase) noexcept;
  /// Waits for a stalled insertion; `dt` [s].
  void watch(const HandPerception& hand, double dt) noexcept;
  /// Where to push, and the path to a point above it.
  void planPath(const HandPerception& hand) noexcept;
  /// Moves the workspace along the path, then enters `next`.
  void followPath(const HandPerception& hand, haptic::Workspace& workspace, Phase next) noexcept;
  /// Moves the workspace to the start of the push.
  void approach(const HandPerception& hand, haptic::Workspace& workspace) noexcept;
  /// Pushes with a controlled force until the part enters, or for 12 s; `dt` [s].
  void push(const HandPerception& hand, double dt) noexcept;
  /// Leaves the part and plans the path home; `dt` [s].
  void release(const HandPerception& hand, double dt) noexcept;
  /// [m] From the target to the part, in W.
  [[nodiscard]] Vector3 targetOffset() const noexcept;
  /// [m] Of the part along the approach, 0 at the target.
  [[nodiscard]] double depth() const noexcept;
  /// Moves the hand to p_DH (from the device's centre, in the axes of W) at `speed` [m/s] for `dt` [s].
  void moveHand(const HandPerception& hand, const Vector3& p_DH, double speed, double dt) noexcept;

  PersonOptions person_;
  std::span<const SceneObject> objects_;
  PathPlanner planner_;
  DelayedPerception perception_;
  ReachController reach_controller_;
  Task task_;
  Phase phase_ = Phase::kWatch;
  Vector3 p_WHome_ = Vector3::Zero();
  double pointer_half_ = 0.025;  // [m] half the edge of the instructor's pointer

  double stalled_time_ = 0.0;  // [s] since the error last fell
  double least_error_ = 0.0;   // [m] since then
  double phase_time_ = 0.0;    // [s] since the phase began
  Waypoints path_;
  std::size_t next_waypoint_ = 0;
  bool approaching_ = false;
  Vector3 side_W_ = Vector3::UnitX();        // unit, across the approach, from the target to the part
  Vector3 p_WPushStart_ = Vector3::Zero();   // of the pointer, beside the part
  Vector3 p_WAbove_ = Vector3::Zero();       // of the pointer, clear of the scene
  double initial_depth_ = 0.0;               // [m] depth() when the path was planned
  double push_depth_ = 0.0;                  // [m] of the intended pose from the origin of the push
  double reaction_ = 0.0;                    // [N] reaction force against the push, low-pass filtered
  Vector3 p_WPushOrigin_ = Vector3::Zero();  // of the intended pose
  unsigned pushes_that_helped_ = 0;
};

}  // namespace tenon::simulated_person
