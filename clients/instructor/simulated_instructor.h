#pragma once

#include <cstdint>
#include <span>

#include "clients/haptic/clear_way.h"
#include "clients/haptic/person.h"
#include "clients/haptic/senses.h"
#include "clients/haptic/smooth_reach.h"
#include "clients/haptic/workspace.h"

namespace tenon {

/// An instructor who watches, and pushes the trainee's part sideways with the cube when it does not get on.
///
/// Knows the step and sees, a reaction late, where things are. When a part has been near its ghost for a few
/// seconds without getting nearer, the instructor takes the workspace there ("go to trainee"), sets the cube
/// beside the part on the side to which it is off, pushes it towards the ghost with a few newtons until it
/// drops in, and withdraws.
///
/// Threads: one. Real-time: step.
class SimulatedInstructor {
 public:
  explicit SimulatedInstructor(const PersonOptions& person) : person_(person) {}

  void begin(std::span<const SceneObject> objects, const Pose& X_WH);
  void read(const StepState& step);
  /// Moves `workspace` by its "go to".
  void step(const HandSense& hand, Workspace& workspace, const WorldView& world, double dt) noexcept;

  /// Where the hand wants to be.
  [[nodiscard]] const Pose& intent() const noexcept { return reach_.pose(); }
  [[nodiscard]] const Twist& intentVelocity() const noexcept { return reach_.velocity(); }
  [[nodiscard]] double contraction() const noexcept { return phase_ == Phase::kPush ? 1.0 : 0.3; }
  [[nodiscard]] const char* doing() const noexcept;
  [[nodiscard]] unsigned helped() const noexcept { return helped_; }

 private:
  enum class Phase : std::uint8_t { kWatch, kGoThere, kComeNear, kPush, kLetGo, kGoBack };

  struct Concern {
    bool active = false;
    ObjectId object;
    Pose X_WG;
    Vector3 approach_W = Vector3::Zero();
    double tolerance = 0.0;
    std::uint32_t step = 0;
    Tick started = 0;
    Vector3 size = Vector3::Zero();
    Vector3 centre = Vector3::Zero();
  };

  void enter(Phase phase) noexcept;
  void watch(const HandSense& hand, double dt) noexcept;
  void planWay(const HandSense& hand) noexcept;
  void goAlong(const HandSense& hand, Workspace& workspace, Phase next) noexcept;
  void comeNear(const HandSense& hand, Workspace& workspace) noexcept;
  void push(const HandSense& hand, double dt) noexcept;
  void letGo(const HandSense& hand, double dt) noexcept;
  [[nodiscard]] Vector3 offTarget() const noexcept;
  [[nodiscard]] double depth() const noexcept;
  void moveHand(const HandSense& hand, const Vector3& p_DH, double speed, double dt) noexcept;

  PersonOptions person_;
  std::span<const SceneObject> objects_;
  ClearWay clear_way_;
  DelayedSight sight_;
  SmoothReach reach_;
  Concern concern_;
  Phase phase_ = Phase::kWatch;
  Vector3 p_WHome_ = Vector3::Zero();
  double cube_half_ = 0.025;  // [m]

  double watched_ = 0.0;     // [s] since the error last fell
  double best_error_ = 0.0;  // [m]
  double phase_time_ = 0.0;
  Waypoints way_;
  std::size_t next_ = 0;
  bool under_way_ = false;
  Vector3 side_W_ = Vector3::UnitX();  // from the ghost to where the part is off, seen along the approach
  Vector3 p_WBeside_ = Vector3::Zero();
  Vector3 p_WAbove_ = Vector3::Zero();
  double depth_before_ = 0.0;
  double pushed_ = 0.0;  // [m] of the intent, from where the push began
  double felt_ = 0.0;    // [N]
  Vector3 p_WPush_ = Vector3::Zero();
  unsigned helped_ = 0;
};

}  // namespace tenon
