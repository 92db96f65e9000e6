#pragma once

#include <cstdint>
#include <string>

#include "idl/types/ids.h"

/// Log entries of the server and of clients.
namespace tenon {

enum class Severity : std::uint32_t { kInfo, kWarning, kError };

/// Log entry of the server.
struct EventLog {
  std::uint64_t seq = 0;  ///< counts from 1 without gaps
  Tick tick = 0;
  Severity severity = Severity::kInfo;
  std::string kind;  ///< "step", "mounted", "taken", "join", "refused", "hand frozen", "emergency stop", ...
  std::string text;
};

/// Log entry of a client.
struct ClientEvent {
  ClientId client;
  std::uint64_t seq = 0;
  std::string kind;
  std::string text;
};

}  // namespace tenon
