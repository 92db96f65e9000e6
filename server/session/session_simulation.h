#pragma once

#include <memory>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/state_machine.h"
#include "server/session/tick_io.h"
#include "server/simulation/environment.h"

namespace tenon::session {

/// Reaction to the age of a hand's newest device sample.
struct LinkLimits {
  Tick freeze = kFreezeTicks;  ///< [ticks] above this age the hand's object is held still
  Tick park = kParkTicks;      ///< [ticks] at this age the hand counts as absent and its object is parked

  bool operator==(const LinkLimits&) const = default;
};

struct SessionSimulationOptions {
  simulation::EnvironmentOptions environment;
  LinkLimits limits;  ///< of a hand whose link asks for no others (ChangeKind::kSetLimits)
  /// Hands that must be present before the first state starts. Empty: it starts in the first tick.
  std::vector<HandId> needed_hands;
};

/// The deterministic core of a session: scene, state machine, and the hands with the age of their input.
/// State and TickInput alone determine the next state, so a journal re-simulates to equal hashes.
///
/// Threads: one caller. Real-time: tick, fill.
class SessionSimulation {
 public:
  SessionSimulation(std::shared_ptr<const game_control::ScenarioFile> scenario,
                    std::shared_ptr<const simulation::Scene> scene, const SessionSimulationOptions& options);

  /// One tick (1 ms): applies changes and device samples, freezes or parks hands by the age of their input,
  /// steps the state machine, then the environment. In a pause the state machine steps for commands alone.
  /// An emergency stop drops the commands that wait and those of its tick. Ids out of range in `input` are
  /// ignored.
  void tick(const TickInput& input) noexcept;

  /// An output sized for this scene.
  [[nodiscard]] TickOutput makeOutput() const;
  /// `output` must come from makeOutput().
  void fill(TickOutput& output) const noexcept;

  [[nodiscard]] Tick now() const { return environment_.tick(); }
  [[nodiscard]] RunPhase phase() const { return phase_; }
  [[nodiscard]] bool emergencyStop() const { return emergency_stop_; }
  /// Whether a client controls the hand.
  [[nodiscard]] bool isAttached(HandId hand) const { return ages_[hand.value].attached; }
  /// Succeeded, failed or stopped.
  [[nodiscard]] bool over() const { return phase_ >= RunPhase::kSucceeded; }
  /// Of environment, state machine, input ages, phase, emergency stop and waiting commands.
  [[nodiscard]] std::uint64_t hash() const noexcept;
  [[nodiscard]] const simulation::Environment& environment() const { return environment_; }
  [[nodiscard]] const game_control::StepStatus& step() const { return machine_.status(); }
  [[nodiscard]] const game_control::ScenarioFile& scenario() const { return *scenario_; }

  /// Environment::shareScheduling.
  [[nodiscard]] std::string shareScheduling() { return environment_.shareScheduling(); }

  /// Appends a checkpoint, the whole changing state, to `bytes`.
  void save(std::vector<std::uint8_t>& bytes) const;
  /// Takes a checkpoint of the same scenario back; ticks from then on are bit-equal to those after save().
  /// When it fails (truncated, of another scenario, a number not finite) the state is undefined until a later
  /// restore succeeds.
  [[nodiscard]] Result<void> restore(std::span<const std::uint8_t> bytes);
  /// Upper bound of the size of any checkpoint of this session [bytes].
  [[nodiscard]] std::size_t maxSavedBytes() const;

 private:
  /// The input of a hand.
  struct HandAge {
    bool attached = false;  ///< a client controls the hand
    bool active = false;    ///< HandReading::active of the newest sample
    Tick age = 0;           ///< [ticks] since the newest sample
    std::uint32_t seq = 0;  ///< HandReading::seq of the newest sample
    LinkLimits limits;
  };

  /// A pose from elsewhere that replaces the readings of the tracked hand that moves the object.
  struct ExternalTrack {
    Pose X_WO;
    Tick until = 0;  ///< the last tick in which it counts
  };

  void apply(const Change& change) noexcept;
  void placeObject(const Change& change) noexcept;
  /// The present hand by whose tracker the object is moved; invalid: none.
  [[nodiscard]] HandId trackedHandOf(ObjectId object) const noexcept;
  void followExternalTracks() noexcept;
  [[nodiscard]] bool isTrackedElsewhere(std::size_t hand) const noexcept {
    return tracks_[hand].until >= environment_.tick() + 1;
  }
  void findCollisionMatrix() noexcept;
  void fillPairs(TickOutput& output) const noexcept;
  void applyReadings(const TickInput& input) noexcept;
  void setLimits(const Change& change) noexcept;
  void applyAgeLimits() noexcept;
  void startWhenHandsPresent() noexcept;
  /// No hand moves an object: emergency stop or pause.
  [[nodiscard]] bool isSuspended() const { return emergency_stop_ || phase_ == RunPhase::kPaused; }
  /// Likewise, whether or not steps go on.
  [[nodiscard]] bool isStill() const { return isSuspended() || forces_frozen_; }
  /// In a pause steps do not run by themselves, and commands change the scene at once.
  [[nodiscard]] bool stepsGoOn() const {
    const bool is_changed = phase_ == RunPhase::kPaused && (!commands_.empty() || machine_.betweenStates());
    return !emergency_stop_ && (phase_ == RunPhase::kRunning || is_changed);
  }
  void take(HandId hand, ObjectId object) noexcept;
  void attach(HandId hand, const HandStiffness& stiffness) noexcept;
  void detach(HandId hand) noexcept;

  std::shared_ptr<const game_control::ScenarioFile> scenario_;
  simulation::Environment environment_;
  game_control::StateMachine machine_;
  LinkLimits limits_;
  std::vector<HandId> needed_hands_;
  std::vector<HandAge> ages_;
  std::vector<ExternalTrack> tracks_;    ///< index = HandId
  std::vector<std::uint8_t> collides_;   ///< CollisionMatrix::bits of all parts
  std::uint32_t collides_revision_ = 0;  ///< Environment::pairRevision() that they are of
  void dropFirstCommands(std::size_t count) noexcept;
  void dropCommands() noexcept;

  /// Commands for the next steps of the state machine: those that wait for one before them, and those of this
  /// tick; none in an emergency stop.
  FixedVector<game_control::GameCommand, kMostWaitingCommands> commands_;
  std::uint64_t commands_dropped_ = 0;  ///< CommandCounts::dropped; no state: nothing depends on it
  RunPhase phase_ = RunPhase::kWaitingForPeople;
  bool emergency_stop_ = false;
  bool forces_frozen_ = false;  ///< hands are held still, steps go on
};

}  // namespace tenon::session
