#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "idl/threads/spsc_queue.h"
#include "server/session/journal.h"

namespace tenon::session {

/// Takes what each tick consumed from the tick to the journal's file, and then copies of it to recorders.
///
/// The file comes first: an entry is with the operating system before its copy is given away, and no reader
/// of the copies delays it. What does not fit into a queue is dropped and counted: an entry, when the disk is
/// seconds behind, so that the file has a gap; a copy, when a recorder is, so that its recording has one.
/// When the file cannot be written any more it ends there, and copies continue.
///
/// Threads: add from one (tick); start, isWrittenWithin, end and stop from another; writes, with the end of
/// the file, and copies have threads of their own up to stop. The numbers from any. Real-time: add.
class JournalWriter {
 public:
  using Publish = std::function<void(const JournalEntry&)>;

  /// `journal`: none, where only copies are wanted. `publish` gives a copy to recorders, may be empty.
  JournalWriter(std::optional<Journal> journal, Publish publish);
  ~JournalWriter() { stop(); }
  JournalWriter(const JournalWriter&) = delete;
  JournalWriter& operator=(const JournalWriter&) = delete;

  /// Before the first add: checkpoints have up to so many bytes.
  void reserve(std::size_t checkpoint_bytes);
  /// The state after `input` is that of `simulation`, with this hash.
  void add(const TickInput& input, std::uint64_t hash, const SessionSimulation& simulation) noexcept;
  void start();
  /// Takes no further entries. After the rest the outcome of the run is written, and the file closed.
  void end(const RunState& run);
  /// Whether the file is closed within `patience`, or ended before (problem).
  [[nodiscard]] bool isEndedWithin(std::chrono::steady_clock::duration patience);
  /// Returns when all entries are written and their copies given away, or the reader is hopelessly behind;
  /// without end() the file stays as that of a killed server.
  void stop();
  /// In place of stop, when the disk hangs: ends the copies. Then only the end of the process ends what waits
  /// for the disk; the destructor waits for it.
  void leaveFile();
  /// Without start (lockstep): true once what was added is in the file, whose thread it has too, and its
  /// copies are given away, here. False: the disk has not taken it within `patience`, to be called again.
  [[nodiscard]] bool isWrittenWithin(std::chrono::steady_clock::duration patience);

  /// Why the file has ended before the session, or is not whole; none while it is written.
  [[nodiscard]] std::optional<std::string> problem() const;
  [[nodiscard]] std::uint64_t lostEntries() const { return entries_.dropped(); }
  /// Not yet written.
  [[nodiscard]] std::uint64_t waitingEntries() const { return entries_.size(); }
  [[nodiscard]] std::uint64_t lostCopies() const { return copies_.dropped(); }

 private:
  bool acquireBuffer(JournalEntry& entry) noexcept;
  std::size_t writeBatch();
  bool writePending();
  void writeFile();
  void writeWhenAsked();
  void closeFile();
  void beEnding();
  void giveCopies();
  void keepProblem(const Result<void>& done);

  std::optional<Journal> journal_;
  Publish publish_;
  /// [ticks] for which the disk or a busy machine may be behind
  static constexpr std::size_t kBacklog = 4096;
  /// [ticks] between two writes to disk, at most: memory that is touched for the first time costs more than
  /// an entry, so a backlog is worked off in memory that is there
  static constexpr std::size_t kBatch = 64;
  threads::SpscQueue<JournalEntry> entries_{kBacklog};
  threads::SpscQueue<JournalEntry> copies_{kBacklog};
  /// empty checkpoint buffers, back to the tick
  threads::SpscQueue<std::vector<std::uint8_t>> buffers_{2};
  std::vector<JournalEntry> batch_{kBatch};
  bool has_checkpoint_ = false;      ///< one was added
  std::optional<RunState> outcome_;  ///< before ending_
  std::atomic<bool> ending_ = false, written_ = false, ended_ = false;
  std::thread file_thread_, copy_thread_;
  // lockstep
  std::mutex turn_mutex_;  ///< of asked_
  std::condition_variable turn_;
  bool asked_ = false;           ///< the file's thread is to write, or writes
  std::size_t written_now_ = 0;  ///< entries of batch_, while not asked
  mutable std::mutex mutex_;     ///< of problem_
  std::optional<std::string> problem_;
};

}  // namespace tenon::session
