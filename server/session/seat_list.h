#pragma once

#include <filesystem>
#include <string>
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
  std::string key;   ///< public half of the seat's key: no secret
  std::string name;  ///< of the client, for display
};

/// The file beside a journal with the seats of its session. They are not in the journal, which is handed on.
[[nodiscard]] std::filesystem::path seatFileOf(const std::filesystem::path& journal);
/// Replaces the file; a crash of the process leaves either the old or the new one.
[[nodiscard]] Result<void> writeSeats(const std::filesystem::path& file, const std::vector<KeptSeat>& seats);
/// Fails when the file cannot be read or is damaged: then clients get new seats.
[[nodiscard]] Result<std::vector<KeptSeat>> readSeats(const std::filesystem::path& file);

}  // namespace tenon::session
