#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/messages.h"
#include "server/game_control/scenario.h"
#include "server/session/tick_io.h"
#include "server/simulation/scene.h"

namespace tenon {

/// What is new since the tick before, as states and events for people and late joiners.
struct News {
  std::optional<StepState> step;
  std::optional<RunState> run;
  std::vector<GrabState> grabs;
  std::vector<ObjectSnapshot> snapshots;
  std::vector<EventLog> events;
};

/// An object as displays and clients are told of it.
[[nodiscard]] SceneObject describe(ObjectId id, const ObjectSpec& spec);

/// Compares each tick's output with the one before and says in words what happened.
///
/// Threads: one (wire).
class Chronicle {
 public:
  Chronicle(std::shared_ptr<const ScenarioFile> scenario, std::uint32_t server_epoch);

  /// The news of this tick; everything, for the first.
  [[nodiscard]] News read(const TickOutput& output);
  /// Something that did not come from a tick: a join, a refused input, a late thread.
  [[nodiscard]] EventLog event(Severity severity, std::string kind, std::string text);

 private:
  void readStep(const TickOutput& output, News& news);
  void readObjects(const TickOutput& output, News& news);
  void readHands(const TickOutput& output, News& news);
  void readRun(const TickOutput& output, News& news);

  std::shared_ptr<const ScenarioFile> scenario_;
  std::uint32_t server_epoch_;
  std::optional<TickOutput> before_;
  Tick tick_ = 0;
  std::uint64_t events_ = 0;
};

/// Packs the objects of a tick into frames: those that moved first, then a few others in turn, so that
/// everybody has everything after a while at any loss; all of them when `all`.
class FramePacker {
 public:
  explicit FramePacker(std::uint32_t server_epoch) : server_epoch_(server_epoch) {}
  void pack(const TickOutput& output, bool all, std::vector<WorldFrame>& frames);

 private:
  [[nodiscard]] static bool isListed(const std::vector<WorldFrame>& frames, ObjectId object);

  std::uint32_t server_epoch_;
  std::vector<std::uint32_t> epochs_;
  std::vector<Pose> poses_;
  std::uint32_t turn_ = 0;
};

}  // namespace tenon
