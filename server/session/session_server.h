#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/identity.h"
#include "server/session/scene_loader.h"
#include "server/session/session_simulation.h"

namespace tenon::session {

struct SessionOptions {
  std::string name = "default";  ///< of the session, by which clients find it
  std::uint32_t domain = 0;      ///< DDS domain
  bool lockstep = false;
  /// Names of hands, and roles (`recorder`, `observer`), that must be present before the first tick. Empty:
  /// all hands of traineeHands.
  std::vector<std::string> wait_for;
  std::filesystem::path journal;  ///< empty: no journal file
  bool resume = false;            ///< take up the session of `journal`, whose server was killed
  /// Of the session, for admins and instructors; none: nobody can be one.
  std::optional<wire::SharedKey> key;
  bool open =
      false;  ///< on a network beyond loopback (wire::chosenNetwork) the other roles need no key either
  std::filesystem::path stop_file;  ///< keeps an emergency stop over a crash; empty: nothing does
  std::string scene_hash;           ///< of storeAssets; empty: displays have no models, stations no scene
  double detail = 1.0;              ///< [-] LoadOptions::detail, noted in the journal
  bool publish_journal = true;      ///< publish TickInput and Checkpoint for recorders
  /// [s] In real time, the governor keeps the computing time of a tick below this by changing the work
  /// budget; 0: never. The default leaves 0.3 ms of a tick to the operating system and other threads.
  double tick_goal = 0.7e-3;
  /// `needed_hands` is set by SessionServer::open.
  SessionSimulationOptions simulation;
  /// Receives lines for the server's terminal, from the wire and the journal thread; may be empty.
  std::function<void(const std::string&)> print;
  /// Number of signals to end that have come; one more while the journal's disk is awaited ends that wait.
  /// None: nothing ends it.
  const std::atomic<std::uint32_t>* signals = nullptr;
};

/// Outcome of a session.
struct SessionReport {
  RunState run;
  std::uint64_t late_ticks = 0;  ///< started a period or more after they were due
  std::uint64_t refused_inputs = 0;
  /// ticks whose output was not sent: the queue to the wire thread was full
  std::uint64_t dropped_outputs = 0;
  std::uint64_t slow_writes = 0;         ///< to the bus, that took longer than 5 ms: a reader was behind
  std::uint64_t failed_writes = 0;       ///< samples that were not sent
  double longest_write = 0.0;            ///< [s]
  std::uint64_t lost_journal_ticks = 0;  ///< missing in the journal: its disk was too slow
  std::string journal_problem;           ///< why the journal ended before the session; or empty
  /// The disk hangs with the rest of the journal and is not awaited: the process ends without destroying the
  /// server, whose destructor would wait.
  bool left_journal = false;
  std::string replaced_by;  ///< why it had to end: another server has taken its place; or empty
};

/// The server of one training session: announces it over DDS, accepts clients, runs ticks in real time or in
/// lockstep, and publishes the results.
///
/// Threads: open, run and the destructor from one thread. run() uses it as the wire thread; in real time it
/// starts a tick thread (SCHED_FIFO where granted; its workers likewise) and a journal thread, which share
/// SpscQueues with it. `stop` may be set from any thread. Real-time: no (its tick thread is).
class SessionServer {
 public:
  /// Opens all DDS endpoints and the journal. Fails when one cannot be opened, when a session of this name is
  /// served already, when `wait_for` names what is neither a hand of the scenario nor a role, or when the
  /// journal that is to be resumed cannot (readResumePoint); then nothing in it is changed.
  [[nodiscard]] static Result<std::unique_ptr<SessionServer>> open(const LoadedScene& loaded,
                                                                   SessionOptions options);
  virtual ~SessionServer() = default;

  /// Waits for `wait_for`, then runs until the run is over or `stop` is set. Once only. A resumed session
  /// waits for the clients that controlled hands, for 1.5 s at most; the object of a hand that is not back is
  /// parked. Fails when another server has taken the place of this one while it was stopped; when the journal
  /// cannot be written, the log says that and the session continues without it.
  [[nodiscard]] virtual Result<SessionReport> run(const std::atomic<bool>& stop) = 0;
};

}  // namespace tenon::session
