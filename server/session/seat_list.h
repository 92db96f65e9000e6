#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/role.h"
#include "idl/types/result.h"
#include "server/session/file_keeper.h"

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

/// Writes the newest list of seats to its file, on another thread. Seats that a crash of the process loses
/// are of clients that get new ones.
///
/// Threads: as FileKeeper.
class SeatKeeper {
 public:
  explicit SeatKeeper(std::filesystem::path file) : file_(std::move(file)) {}

  /// FileKeeper::keep.
  std::uint64_t keep(std::vector<KeptSeat> seats) {
    return keeper_.keep([file = file_, seats = std::move(seats)] { return writeSeats(file, seats); });
  }
  [[nodiscard]] bool isDone(std::uint64_t number) { return keeper_.isDone(number); }
  [[nodiscard]] std::optional<std::string> takeError() { return keeper_.takeError(); }

 private:
  std::filesystem::path file_;
  FileKeeper keeper_;
};

}  // namespace tenon::session
