#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "idl/types/result.h"

namespace tenon::session {

/// Writes the newest state of a file on a thread of its own: replacing a file waits for the disk, and the
/// server's wire thread must not.
///
/// A crash of the process may lose what was given in the last milliseconds; what must not be lost waits for
/// isDone(). The destructor writes what waits.
///
/// Threads: one calls keep, isDone and takeError; another one, of this object, writes. Real-time: no.
class FileKeeper {
 public:
  /// Replaces the file by a state that it holds; called on the other thread.
  using Write = std::function<Result<void>()>;

  FileKeeper();
  ~FileKeeper();
  FileKeeper(const FileKeeper&) = delete;
  FileKeeper& operator=(const FileKeeper&) = delete;

  /// Replaces a state that still waits. Its number, for isDone().
  std::uint64_t keep(Write write);
  /// Whether the state of this number, or a later one, is in the file, or could not be written.
  [[nodiscard]] bool isDone(std::uint64_t number);
  /// Why the last state could not be written, once.
  [[nodiscard]] std::optional<std::string> takeError();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  Write waiting_;  ///< empty: nothing waits
  std::optional<std::string> error_;
  std::uint64_t kept_ = 0, done_ = 0;  ///< numbers of the newest states
  bool ends_ = false;
  std::thread thread_;  // last: it uses the others
};

}  // namespace tenon::session
