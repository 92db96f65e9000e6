#pragma once

#include <cstdint>
#include <span>

#include "clients/simulated_person/assembly_behavior.h"
#include "clients/simulated_person/declutching.h"
#include "clients/simulated_person/path_planner.h"
#include "clients/simulated_person/perception.h"
#include "clients/simulated_person/person.h"
#include "idl/types/messages/steps.h"

namespace tenon::simulated_person {

/// A hand of the simulated trainee: what it does in the scene, and how it keeps its device in reach
/// meanwhile.
///
/// Threads: one. Real-time: step.
struct TraineeHand {
  TraineeHand(const PersonOptions& person, std::uint64_t seed) : behavior(person, seed) {}
  void begin(const Pose& X_WH) noexcept;
  /// Advances by `dt` [s].
  void step(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept;

  AssemblyBehavior behavior;
  Declutching declutching;
};

/// Simulated trainee: carries out the active step with the hand it names; the other hand returns to its home
/// pose.
///
/// Uses object and target poses with a reaction delay, the instruction with its direction of approach, and
/// the forces on both hands; no recorded solution. Sight is better than that of a person: the delayed poses
/// are exact, see AssemblyBehavior.
///
/// Threads: one. Real-time: step.
class SimulatedTrainee {
 public:
  explicit SimulatedTrainee(const PersonOptions& person);

  /// Both hands at rest at their home poses. `objects` must outlive the trainee.
  void begin(std::span<const SceneObject> objects, const Pose& X_WRight, const Pose& X_WLeft);
  /// Takes a new instruction; acted upon after reaction and reading time.
  void read(const StepState& step);
  /// Advances by `dt` [s]; one millisecond, the clock of DelayedPerception.
  void step(const HandPerception& right, const HandPerception& left, const haptic::WorldView& world,
            double dt) noexcept;

  [[nodiscard]] const TraineeHand& right() const noexcept { return right_; }
  [[nodiscard]] const TraineeHand& left() const noexcept { return left_; }
  /// What the working hand does, in a word or two: for progress output and tests.
  [[nodiscard]] const char* activity() const noexcept;

 private:
  /// The part of a StepState that is acted upon.
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
    double approach_distance = 0.0;  ///< [m]
    double tolerance = 0.0;          ///< [m]
  };

  void act(const HandPerception& right, const HandPerception& left) noexcept;

  PersonOptions person_;
  TraineeHand right_;
  TraineeHand left_;
  PathPlanner planner_;
  DelayedPerception perception_;
  std::span<const SceneObject> objects_;
  Instruction instruction_;
  int mounts_ = 0;  // begun so far
  bool acted_ = true;
  bool left_works_ = false;
  double since_read_ = 0.0;  // [s]
};

}  // namespace tenon::simulated_person
