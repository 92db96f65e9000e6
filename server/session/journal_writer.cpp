#include "server/session/journal_writer.h"

#include <chrono>
#include <utility>

#include "idl/threads/scheduling.h"

namespace tenon::session {
namespace {

// Below those of ticks and wire. Without one the file lacks ticks, which continue at high load. Its thread
// sleeps nearly always. Copies have the default scheduling: a recorder may wait.
constexpr int kFilePriority = 40;
// what a server that is killed loses at most
constexpr auto kPass = std::chrono::milliseconds(20);
constexpr auto kLastCopies = std::chrono::seconds(5);  // after the last tick, for a slow recorder

}  // namespace

JournalWriter::JournalWriter(std::optional<Journal> journal, Publish publish)
    : journal_(std::move(journal)), publish_(std::move(publish)) {}

void JournalWriter::reserve(std::size_t checkpoint_bytes) {
  while (std::vector<std::uint8_t>* buffer = buffers_.beginPush()) {
    buffer->reserve(checkpoint_bytes);
    buffers_.commitPush();
  }
}

/// Swaps a reserved buffer into `entry`; false when the file is seconds behind and holds all buffers.
bool JournalWriter::acquireBuffer(JournalEntry& entry) noexcept {
  std::vector<std::uint8_t>* const buffer = buffers_.front();
  if (buffer == nullptr) return false;
  entry.checkpoint.swap(*buffer);
  buffers_.pop();
  return true;
}

void JournalWriter::add(const TickInput& input, std::uint64_t hash,
                        const SessionSimulation& simulation) noexcept {
  JournalEntry* const entry = entries_.beginPush();
  if (entry == nullptr) return;
  entry->input = input;
  entry->hash = hash;
  // the first tick of a life too, so that none depends on what was lost before
  if ((hasCheckpoint(input.tick) || !has_checkpoint_) && acquireBuffer(*entry)) {
    entry->checkpoint.clear();
    simulation.save(entry->checkpoint);
    has_checkpoint_ = true;
  }
  entries_.commitPush();
}

void JournalWriter::keepProblem(const Result<void>& done) {
  if (done) return;
  const std::lock_guard lock(mutex_);
  if (!problem_) problem_ = done.error().what;
}

std::optional<std::string> JournalWriter::problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}

/// Writes up to kBatch entries, which are in batch_ then; their number.
std::size_t JournalWriter::writeBatch() {
  const auto writes = [this] { return journal_ && !problem(); };
  std::size_t count = 0;
  for (; count < kBatch; ++count) {
    JournalEntry* const entry = entries_.front();
    if (entry == nullptr) break;
    if (writes()) keepProblem(journal_->write(*entry));
    if (publish_) batch_[count] = *entry;
    if (!entry->checkpoint.empty()) {
      buffers_.beginPush()->swap(entry->checkpoint);
      buffers_.commitPush();
      entry->checkpoint.clear();
    }
    entries_.pop();
  }
  if (writes()) keepProblem(journal_->keep());
  return count;
}

/// True: there may be more.
bool JournalWriter::writePending() {
  const std::size_t count = writeBatch();
  for (std::size_t i = 0; publish_ && i < count; ++i) {
    if (JournalEntry* const copy = copies_.beginPush()) {
      *copy = std::move(batch_[i]);
      copies_.commitPush();
    }
  }
  return count == kBatch;
}

bool JournalWriter::isWrittenWithin(std::chrono::steady_clock::duration patience) {
  if (!file_thread_.joinable()) file_thread_ = std::thread([this] { writeWhenAsked(); });
  const auto until = std::chrono::steady_clock::now() + patience;
  while (true) {
    std::unique_lock lock(turn_mutex_);
    if (entries_.size() > 0 && !asked_) {
      asked_ = true;
      turn_.notify_all();
    }
    if (!turn_.wait_until(lock, until, [this] { return !asked_; })) return false;
    const std::size_t count = std::exchange(written_now_, 0);
    for (std::size_t i = 0; publish_ && i < count; ++i) publish_(batch_[i]);
    if (entries_.size() == 0) return true;
  }
}

void JournalWriter::writeWhenAsked() {
  threads::nameThisThread("journal");
  std::unique_lock lock(turn_mutex_);
  while (true) {
    turn_.wait(lock, [this] { return asked_ || ending_; });
    if (!asked_) break;
    lock.unlock();
    const std::size_t count = writeBatch();
    lock.lock();
    written_now_ = count;
    asked_ = false;
    turn_.notify_all();
  }
  lock.unlock();
  closeFile();
}

void JournalWriter::start() {
  file_thread_ = std::thread([this] { writeFile(); });
  if (publish_) copy_thread_ = std::thread([this] { giveCopies(); });
}

void JournalWriter::writeFile() {
  threads::nameThisThread("journal");
  // where it is not granted, the ticks' is neither, which people are told
  static_cast<void>(threads::raiseThisThread(kFilePriority));
  while (true) {
    const bool last_pass = ending_;  // no further entries will come
    if (writePending()) continue;
    if (last_pass) break;
    std::this_thread::sleep_for(kPass);
  }
  closeFile();
}

void JournalWriter::closeFile() {
  written_ = true;
  if (outcome_ && journal_ && !problem()) keepProblem(journal_->close(*outcome_));
  ended_ = true;
}

void JournalWriter::giveCopies() {
  std::optional<std::chrono::steady_clock::time_point> until;
  while (true) {
    const bool last_pass = written_;
    for (JournalEntry* entry = copies_.front(); entry != nullptr; entry = copies_.front()) {
      publish_(*entry);
      // else each slot would keep the memory of a checkpoint
      std::vector<std::uint8_t>().swap(entry->checkpoint);
      copies_.pop();
      if (!written_) continue;
      if (!until) until = std::chrono::steady_clock::now() + kLastCopies;
      if (std::chrono::steady_clock::now() > *until) return;
    }
    if (last_pass) return;
    std::this_thread::sleep_for(kPass);
  }
}

void JournalWriter::end(const RunState& run) {
  outcome_ = run;
  beEnding();
  if (!file_thread_.joinable()) file_thread_ = std::thread([this] { writeFile(); });
}

void JournalWriter::beEnding() {
  const std::lock_guard lock(turn_mutex_);
  ending_ = true;
  turn_.notify_all();
}

bool JournalWriter::isEndedWithin(std::chrono::steady_clock::duration patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!ended_ && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(kPass);
  return ended_;
}

void JournalWriter::leaveFile() {
  written_ = true;
  if (copy_thread_.joinable()) copy_thread_.join();
}

void JournalWriter::stop() {
  beEnding();
  if (file_thread_.joinable()) file_thread_.join();
  written_ = true;
  if (copy_thread_.joinable()) copy_thread_.join();
}

}  // namespace tenon::session
