#pragma once

#include <cstdint>
#include <span>

#include "clients/haptic/clear_way.h"
#include "clients/haptic/person.h"
#include "clients/haptic/senses.h"
#include "clients/trainee/assembly_skill.h"

namespace tenon {

/// A trainee who does what she is told: reads the step, decides which hand does it and lets the other rest.
///
/// She knows only what a person at the station would: where things are and where the ghost is, a reaction
/// late, the instruction with its direction of approach, and the force in her hands; never a recorded
/// solution.
///
/// Threads: one. Real-time: step.
class SimulatedTrainee {
 public:
  explicit SimulatedTrainee(const PersonOptions& person);

  void begin(std::span<const SceneObject> objects, const Pose& X_WRight, const Pose& X_WLeft);
  void read(const StepState& step);
  void step(const HandSense& right, const HandSense& left, const WorldView& world, double dt) noexcept;

  [[nodiscard]] const AssemblySkill& right() const noexcept { return right_; }
  [[nodiscard]] const AssemblySkill& left() const noexcept { return left_; }
  [[nodiscard]] const char* doing() const noexcept;

 private:
  /// What of a StepState she acts upon.
  struct Instruction {
    bool active = false;
    std::uint32_t step = 0;
    Tick started = 0;
    ObjectId object;
    ObjectId touch;
    HandId hand;
    bool has_target = false;
    bool is_part = false;
    Pose X_WG;
    Vector3 approach_W = Vector3::Zero();
    double approach_distance = 0.0;
    double tolerance = 0.0;
  };

  void act(const HandSense& right, const HandSense& left) noexcept;

  PersonOptions person_;
  AssemblySkill right_;
  AssemblySkill left_;
  ClearWay clear_way_;
  DelayedSight sight_;
  std::span<const SceneObject> objects_;
  Instruction instruction_;
  int mounts_ = 0;
  bool acted_ = true;
  bool works_left_ = false;
  double since_read_ = 0.0;
};

}  // namespace tenon
