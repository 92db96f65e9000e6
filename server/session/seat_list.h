#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/role.h"
#include "idl/types/result.h"

namespace tenon::session {

/// A seat as it outlives the server: enough to give the client who proves that it has the key of the seat its
/// former id.
struct KeptSeat {
  ClientId client;
  Role role = Role::kObserver;
  std::string key;         ///< public half of the seat's key: no secret
  std::string name;        ///< of the client, for display
  bool is_closed = false;  ///< its person was removed
};

/// The file beside a journal with the seats of its session. They are not in the journal, which is handed on.
[[nodiscard]] std::filesystem::path seatFileOf(const std::filesystem::path& journal);
/// Replaces the file; a crash of the process leaves either the old or the new one.
[[nodiscard]] Result<void> writeSeats(const std::filesystem::path& file, const std::vector<KeptSeat>& seats);
/// Fails when the file cannot be read or is damaged: then clients get new seats.
[[nodiscard]] Result<std::vector<KeptSeat>> readSeats(const std::filesystem::path& file);

/// Writes the newest list of seats to its file on a thread of its own: replacing a file waits for the disk,
/// and the server's wire thread must not.
///
/// A crash of the process may lose the seats of the last milliseconds, whose clients get new ones; what must
/// not be lost waits for isDone(). The destructor writes what waits.
///
/// Threads: one calls keep, isDone and takeError; another one, of this object, writes.
class SeatKeeper {
 public:
  explicit SeatKeeper(std::filesystem::path file);
  ~SeatKeeper();
  SeatKeeper(const SeatKeeper&) = delete;
  SeatKeeper& operator=(const SeatKeeper&) = delete;

  /// Replaces a list that still waits. Its number, for isDone().
  std::uint64_t keep(std::vector<KeptSeat> seats);
  /// Whether the list of this number, or a later one, is in the file, or could not be written.
  [[nodiscard]] bool isDone(std::uint64_t number);
  /// Why the last list could not be written, once.
  [[nodiscard]] std::optional<std::string> takeError();

 private:
  void run();

  std::filesystem::path file_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<std::vector<KeptSeat>> waiting_;
  std::optional<std::string> error_;
  std::uint64_t kept_ = 0, done_ = 0;  ///< numbers of the newest lists
  bool ends_ = false;
  std::thread thread_;  // last: it uses the others
};

}  // namespace tenon::session
