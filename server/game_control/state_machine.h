#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/hash.h"
#include "idl/types/messages/steps.h"
#include "idl/types/result.h"
#include "server/game_control/condition.h"
#include "server/game_control/game_command.h"
#include "server/game_control/scenario.h"

namespace tenon::simulation {
class Environment;
}  // namespace tenon::simulation

namespace tenon::game_control {

/// Progress of the training, as of the last tick.
struct StepStatus {
  std::uint32_t revision = 0;  ///< incremented whenever `step`, `phase` or `hand` changes: publish then
  std::uint32_t step = 0;      ///< index of the current state
  StepPhase phase = StepPhase::kWaiting;
  HandId hand;                   ///< that has to do it; differs from the scenario's after hands were swapped
  Tick started = 0;              ///< tick of the Environment at which the state began
  Tick elapsed = 0;              ///< [ticks] of this state, without pauses: what its timeout is compared with
  Tick changed = 0;              ///< tick of the last revision
  Tick tick = 0;                 ///< tick of the Environment of the values below
  bool finished = false;         ///< the last state has ended
  bool failed = false;           ///< a state timed out whose timeout fails the training
  std::uint32_t skipped = 0;     ///< states whose last visit was skipped
  std::uint32_t timed_out = 0;   ///< states whose last visit timed out
  double position_error = 0.0;   ///< [m] of its object's centre to the target; 0 without a target
  double angle_error = 0.0;      ///< [rad] likewise
  double contact_seconds = 0.0;  ///< [s] that the object has been in contact in this state
  FixedVector<ConditionReading, kMaxConditions> conditions;  ///< of the nodes of its tree, in file order
};

/// The task state machine (paper §3.3): leads the trainee through the scenario's states by calls of the
/// Environment.
///
/// A state that ends stays current for one tick as kDone, kSkipped or kTimedOut before the next begins, so
/// each has a revision that tells how it ended. Skipping a state puts its object to its target (fixed where
/// the state snaps, else if it is a free body), because the next states build on it. Time is what the calls
/// of step() say: in a pause, where they come with commands alone, none passes.
///
/// Threads: one caller, the tick. Real-time: start, step, status, addTo.
class StateMachine {
 public:
  /// The scenario has at least one state (assert).
  explicit StateMachine(std::shared_ptr<const ScenarioFile> scenario);

  /// Begins the first state.
  void start(simulation::Environment& environment) noexcept;

  /// One tick, before Environment::step: conditions are evaluated on the result of the last tick. Returns how
  /// many of the commands were taken, which are in order: those behind one that may end the state wait for
  /// the next one, and are to be given again with the next tick. Handles kFulfilled, kSignal, kSkipStep,
  /// kRelease, kSetCollision, kSwapHands, kReset (all objects, groups and pairs as at the start, first
  /// state), kGoToStep, kBack, kRepeatStep and kHandOver; other commands are the session's. `ticks` [ticks]
  /// of time have passed since the last call, 0 or 1.
  ///
  /// Going to a state makes the scene what it is when all states before have been skipped: what the trainee
  /// has moved since is undone. States that are passed over without having been visited count as skipped;
  /// those from the target on as not visited.
  std::size_t step(simulation::Environment& environment, std::span<const GameCommand> commands,
                   std::uint32_t ticks = 1) noexcept;

  /// A state has ended, and the next step() begins the one that follows it.
  [[nodiscard]] bool betweenStates() const noexcept;
  [[nodiscard]] const StepStatus& status() const { return memory_.status; }
  [[nodiscard]] const ScenarioFile& scenario() const { return *scenario_; }

  void addTo(StateHash& hash) const noexcept;
  [[nodiscard]] std::vector<std::uint8_t> save() const;
  /// Appends what save() returns; does not allocate when `bytes` has the capacity.
  void append(std::vector<std::uint8_t>& bytes) const;
  /// [bytes] Positions in save() of all its floating-point numbers: none of them may be infinite or NaN.
  [[nodiscard]] std::vector<std::size_t> savedDoubles() const;
  /// Fails, and changes nothing, when the size is wrong, a number is not finite or the saved step does not
  /// exist.
  [[nodiscard]] Result<void> restore(std::span<const std::uint8_t> bytes);

 private:
  /// A set of states.
  using StateSet = std::array<std::uint64_t, kMaxStates / 64>;

  static constexpr std::size_t kMaxRegrabs = 16;  ///< entries of ScenarioState::hands: hands

  /// The whole mutable state.
  struct Memory {
    StepStatus status;
    StateSet skipped{};    ///< states whose last visit was skipped
    StateSet timed_out{};  ///< states whose last visit timed out
    StateSet visited{};    ///< states that have ended
    ConditionProgress progress;
    std::uint64_t contact_ticks = 0;  ///< [ticks] of the state's object in contact
    /// between a released part and the default object of the hand that has to move it, by entry of
    /// ScenarioState::hands
    std::array<ContactTimer, kMaxRegrabs> regrabs;
    std::array<ContactTimer, kMaxHelpers> helpers;  ///< between a helping hand's default object and the part
  };
  template <typename Visitor>
  static void visitMemory(Memory& memory, Visitor&& visit);
  /// The rest of it: the timers of `regrabs` after the first.
  template <typename Visitor>
  static void visitOtherRegrabs(Memory& memory, Visitor&& visit);

  void enter(simulation::Environment& environment, std::uint32_t step) noexcept;
  void leave(simulation::Environment& environment, StepPhase phase) noexcept;
  void finish(simulation::Environment& environment, bool by_people) noexcept;
  void setOutcome(std::uint32_t step, StepPhase phase) noexcept;
  void restoreScene(simulation::Environment& environment) noexcept;
  void goTo(simulation::Environment& environment, std::uint32_t step) noexcept;
  void handOver(simulation::Environment& environment, ObjectId object, HandId hand) noexcept;
  void applyEffects(simulation::Environment& environment) noexcept;
  void apply(simulation::Environment& environment, const GameCommand& command) noexcept;
  void place(simulation::Environment& environment, const Placement& placement) noexcept;
  void regrabReleasedPart(simulation::Environment& environment, const SceneView& scene,
                          std::uint32_t ticks) noexcept;
  void grabByHelpers(simulation::Environment& environment, const SceneView& scene,
                     std::uint32_t ticks) noexcept;
  void releaseHelpers(simulation::Environment& environment) noexcept;
  void swapHands(simulation::Environment& environment) noexcept;
  void countOutcomes() noexcept;
  /// After `ticks` [ticks] of this state.
  void updateMeasurements(const SceneView& scene, std::uint32_t ticks) noexcept;
  void collectReadings() noexcept;
  [[nodiscard]] const ScenarioState& state() const { return scenario_->states[memory_.status.step]; }

  std::shared_ptr<const ScenarioFile> scenario_;
  Memory memory_;
};

/// The current state as displays and recordings show it. Not real-time: strings.
[[nodiscard]] StepState describe(const ScenarioFile& scenario, const StepStatus& status);

/// Its progress, sent in tick `now`. Not real-time: strings.
[[nodiscard]] StepProgress progress(const ScenarioFile& scenario, const StepStatus& status, Tick now);

}  // namespace tenon::game_control
