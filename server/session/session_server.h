#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/result.h"
#include "server/session/exercise.h"
#include "server/session/scene_loader.h"

namespace tenon {

struct SessionOptions {
  std::string name = "default";  ///< of the session: clients ask for it
  std::uint32_t domain = 0;
  bool lockstep = false;
  /// Who must be there before the first step: names of hands and roles (`recorder`, `observer`). Empty: all
  /// hands of the trainee that the first state needs.
  std::vector<std::string> wait_for;
  std::filesystem::path journal;  ///< empty: no journal
  double detail = 1.0;            ///< noted in the journal
  bool publish_journal = true;    ///< TickInput and Checkpoint on the bus too
  /// [s] By the clock, ticks are kept under this by changing their budget; 0: never. A third of the
  /// millisecond is the operating system's.
  double tick_goal = 0.7e-3;
  ExerciseOptions exercise;
  /// What a person who looks at the server's terminal should know.
  std::function<void(const std::string&)> say;
};

/// How a session ended.
struct SessionReport {
  RunState run;
  std::uint64_t late_ticks = 0;
  std::uint64_t refused_inputs = 0;
  std::uint64_t dropped_outputs = 0;  ///< ticks whose output the wire thread had no room for
};

/// One training session on the bus: announces itself, lets people in, runs ticks by the clock or in lockstep,
/// tells everybody what happened, until the run is over or `stop` is set.
///
/// Threads: run() is the wire thread; in real time it has a tick and a journal thread beside it (DESIGN
/// section 3).
class SessionServer {
 public:
  [[nodiscard]] static Result<std::unique_ptr<SessionServer>> open(const LoadedScene& loaded,
                                                                   SessionOptions options);
  virtual ~SessionServer() = default;

  [[nodiscard]] virtual Result<SessionReport> run(const std::atomic<bool>& stop) = 0;
};

/// The hands that a scenario's people must bring by default: every coupled or tracked hand of the trainee.
[[nodiscard]] std::vector<HandId> traineeHands(const ScenarioFile& scenario);

}  // namespace tenon
