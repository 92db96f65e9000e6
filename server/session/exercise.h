#pragma once

#include <memory>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/state_machine.h"
#include "server/session/tick_io.h"
#include "server/simulation/environment.h"

namespace tenon {

/// From which age of a hand's newest input the server does something about it.
struct LinkLimits {
  Tick freeze = 50;  ///< [ticks] the object is held still where it is
  Tick park = 1000;  ///< [ticks] the hand counts as gone and its object is parked
};

struct ExerciseOptions {
  EnvironmentOptions environment;
  LinkLimits limits;
  /// Hands that must be there before the first state starts. Empty: starts at once.
  std::vector<HandId> needed_hands;
};

/// The deterministic heart of a session: the scene, the state machine, the hands and their ages. What it does
/// in a tick follows from its state and the TickInput alone, so a journal re-runs to the same hashes.
///
/// Threads: one caller. Real-time: tick, fill.
class Exercise {
 public:
  Exercise(std::shared_ptr<const ScenarioFile> scenario, std::shared_ptr<const Scene> scene,
           const ExerciseOptions& options);

  /// One millisecond: take what came in, apply the decisions of the last tick, move, judge.
  void tick(const TickInput& input) noexcept;

  /// An output with room for this scene.
  [[nodiscard]] TickOutput makeOutput() const;
  void fill(TickOutput& output) const noexcept;

  [[nodiscard]] Tick now() const { return environment_.tick(); }
  [[nodiscard]] RunPhase phase() const { return phase_; }
  [[nodiscard]] bool over() const { return phase_ >= RunPhase::kSucceeded; }
  [[nodiscard]] std::uint64_t hash() const noexcept;
  [[nodiscard]] const Environment& environment() const { return environment_; }
  [[nodiscard]] const StepStatus& step() const { return machine_.status(); }
  [[nodiscard]] const ScenarioFile& scenario() const { return *scenario_; }

  /// Appends the whole moving state; `restore` takes it back and then goes on to the same bits.
  void save(std::vector<std::uint8_t>& bytes) const;
  [[nodiscard]] Result<void> restore(std::span<const std::uint8_t> bytes);
  /// No state of this session saves more bytes than these.
  [[nodiscard]] std::size_t mostSavedBytes() const;

 private:
  struct HandAge {
    bool attached = false;
    bool active = false;
    Tick age = 0;
    std::uint32_t seq = 0;
  };

  void apply(const Change& change) noexcept;
  void fillPairs(TickOutput& output) const noexcept;
  void read(const TickInput& input) noexcept;
  void judgeAges() noexcept;
  void beginWhenAllAreHere() noexcept;
  [[nodiscard]] bool standsStill() const { return emergency_stop_ || phase_ == RunPhase::kPaused; }
  void attach(HandId hand) noexcept;
  void detach(HandId hand) noexcept;

  std::shared_ptr<const ScenarioFile> scenario_;
  Environment environment_;
  StateMachine machine_;
  LinkLimits limits_;
  std::vector<HandId> needed_hands_;
  std::vector<HandAge> ages_;
  /// To be obeyed by the next step of the state machine: those that waited while all stood still, and a
  /// tick's own.
  FixedVector<GameCommand, 2 * kMaxChanges> game_;
  RunPhase phase_ = RunPhase::kWaitingForPeople;
  bool emergency_stop_ = false;
};

}  // namespace tenon
