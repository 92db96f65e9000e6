#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/hash.h"
#include "idl/types/messages.h"
#include "idl/types/result.h"
#include "server/game_control/condition.h"
#include "server/game_control/game_command.h"
#include "server/game_control/scenario.h"

namespace tenon {

class Environment;

/// Where the training is, as of the last tick.
struct StepStatus {
  std::uint32_t revision = 0;  ///< raised whenever step or phase changes: publish then
  std::uint32_t step = 0;
  StepPhase phase = StepPhase::kWaiting;
  HandId hand;                   ///< that is meant to do it, swapped hands followed
  Tick started = 0;              ///< tick of the Environment at which the state began
  Tick changed = 0;              ///< tick of the last revision
  Tick tick = 0;                 ///< of the Environment when this was measured
  bool finished = false;         ///< the last state is over
  bool failed = false;           ///< a state timed out that may not
  double position_error = 0.0;   ///< [m] of the state's object to its target
  double angle_error = 0.0;      ///< [rad]
  double contact_seconds = 0.0;  ///< that the object has been in contact in this state
  FixedVector<ConditionReading, kMaxConditions> conditions;  ///< groups left out, in file order
};

/// Leads the trainee through the scenario's states (paper §3.3) by the calls of the Environment.
///
/// A state that ends stays visible for one tick as kDone, kSkipped or kTimedOut before the next begins, so
/// each has a revision that tells how it ended. Skipping a state that snaps puts its object where it belongs:
/// the next states build on it. Time is counted in calls of step(): while the session is paused nothing times
/// out.
///
/// Threads: one caller, the tick. Real-time: start, step, status, addTo.
class StateMachine {
 public:
  explicit StateMachine(std::shared_ptr<const ScenarioFile> scenario);

  /// Begins the first state.
  void start(Environment& environment) noexcept;

  /// One tick, before Environment::step: what the last tick left decides. Takes kFulfilled, kSignal,
  /// kSkipStep, kRelease, kSetCollision and kReset (all objects and pairs as at the start, first state);
  /// others are the session's.
  void step(Environment& environment, std::span<const GameCommand> commands) noexcept;

  [[nodiscard]] const StepStatus& status() const { return memory_.status; }
  [[nodiscard]] const ScenarioFile& scenario() const { return *scenario_; }

  void addTo(StateHash& hash) const noexcept;
  [[nodiscard]] std::vector<std::uint8_t> save() const;
  /// The same at the end of `bytes`: allocates nothing when there is room.
  void append(std::vector<std::uint8_t>& bytes) const;
  [[nodiscard]] Result<void> restore(std::span<const std::uint8_t> bytes);

 private:
  /// All that changes.
  struct Memory {
    StepStatus status;
    ConditionProgress progress;
    std::uint64_t elapsed = 0;        ///< [ticks] in this state
    std::uint64_t contact_ticks = 0;  ///< of the state's object
    ContactTimer retake;              ///< of a part that was let go and the hand that shall move it
    std::array<ContactTimer, kMostHelpers> helping;  ///< of the hands that may take a part as well
  };
  template <typename Visitor>
  static void visitMemory(Memory& memory, Visitor&& visit);

  void enter(Environment& environment, std::uint32_t step) noexcept;
  void leave(Environment& environment, StepPhase phase) noexcept;
  void reset(Environment& environment) noexcept;
  void obey(Environment& environment, const GameCommand& command) noexcept;
  void place(Environment& environment, const Placement& placement) noexcept;
  void takeAgain(Environment& environment, const SceneView& scene) noexcept;
  void letHelpersTake(Environment& environment, const SceneView& scene) noexcept;
  void dismissHelpers(Environment& environment) noexcept;
  void swapHands(Environment& environment) noexcept;
  void measure(const SceneView& scene) noexcept;
  void listReadings() noexcept;
  [[nodiscard]] const ScenarioState& state() const { return scenario_->states[memory_.status.step]; }

  std::shared_ptr<const ScenarioFile> scenario_;
  Memory memory_;
};

/// The state as a person is told it. Not real-time: strings.
[[nodiscard]] StepState describe(const ScenarioFile& scenario, const StepStatus& status);

/// How far it is. Not real-time: strings.
[[nodiscard]] StepProgress progress(const ScenarioFile& scenario, const StepStatus& status);

}  // namespace tenon
