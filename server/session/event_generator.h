#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/messages/log.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/steps.h"
#include "server/game_control/scenario.h"
#include "server/session/tick_io.h"
#include "server/simulation/scene.h"

namespace tenon::session {

/// What changed from one tick to the next, as state and event messages.
struct TickEvents {
  std::optional<StepState> step;
  std::optional<RunState> run;
  std::vector<GrabState> grabs;
  std::vector<CollisionMatrix> matrix;    ///< all parts, or none
  std::vector<ObjectSnapshot> snapshots;  ///< of changed objects, and of every object once in 1000 ticks
  std::vector<EventLog> log;
};

/// The SceneObject message of an object of the scene.
[[nodiscard]] SceneObject describe(ObjectId id, const simulation::ObjectSpec& spec);

/// Compares the output of each tick with that of the tick before and generates the states and log entries of
/// what changed.
///
/// Threads: one (wire).
class EventGenerator {
 public:
  EventGenerator(std::shared_ptr<const game_control::ScenarioFile> scenario, std::uint32_t server_epoch);

  /// The first output is that of a tick after `tick`, of a session that another server began: the numbers of
  /// its log entries are greater than those before.
  void resume(Tick tick);
  /// The changes since the output of the last call; for the first call, the whole state.
  [[nodiscard]] TickEvents generate(const TickOutput& output);
  /// Of a session that waits for its first tick, which no output describes.
  [[nodiscard]] RunState runBefore(bool is_stopped, const std::vector<std::string>& missing) const;
  /// A log entry of something outside the simulation (a join, a refused input), stamped with the last tick
  /// and the next number of the log.
  [[nodiscard]] EventLog makeEvent(Severity severity, std::string kind, std::string text);
  /// Why the run has the phase of the last output: RunState::reason.
  [[nodiscard]] const std::string& runReason() const { return run_reason_; }

 private:
  /// Why a step that timed out was not done; empty when it is not known.
  [[nodiscard]] std::string blockerOf(const TickOutput& output) const;
  void addStep(const TickOutput& output, TickEvents& events);
  void addMatrix(const TickOutput& output, TickEvents& events) const;
  void addObjects(const TickOutput& output, TickEvents& events);
  void addHands(const TickOutput& output, TickEvents& events);
  void addRun(const TickOutput& output, TickEvents& events);

  std::shared_ptr<const game_control::ScenarioFile> scenario_;
  std::uint32_t server_epoch_;
  std::optional<TickOutput> previous_;
  std::string run_reason_;
  Tick tick_ = 0;
  std::uint64_t event_count_ = 0;
};

/// Packs objects into WorldFrames: first those whose pose or velocity is another than when they were packed
/// last, so that zero velocity is sent once when an object stops; then one of the others, round robin, so
/// that every receiver is up to date after as many frames as there are objects, whatever was lost.
class FramePacker {
 public:
  explicit FramePacker(std::uint32_t server_epoch) : server_epoch_(server_epoch) {}
  /// Replaces `frames`. `all`: every object, whether it moved or not.
  void pack(const TickOutput& output, bool all, std::vector<WorldFrame>& frames);

 private:
  [[nodiscard]] static bool contains(const std::vector<WorldFrame>& frames, ObjectId object);

  std::uint32_t server_epoch_;
  std::vector<std::uint32_t> epochs_;                ///< index = ObjectId: as packed last
  std::vector<Pose> poses_;                          ///< index = ObjectId: X_WO as packed last
  std::vector<decltype(ObjectState::V_WO)> twists_;  ///< likewise V_WO
  std::uint32_t refreshed_ = 0;                      ///< index of the object refreshed last
};

}  // namespace tenon::session
