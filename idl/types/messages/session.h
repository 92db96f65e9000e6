#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/role.h"

/// Joining a session and leaving it.
namespace tenon {

inline constexpr std::uint32_t kProtocolVersion = 2;

/// Published by each server in the lobby partition: the session it runs.
struct SessionAnnounce {
  std::string session;  ///< its name, by which clients choose it
  std::string title;    ///< of the scenario
  std::uint32_t protocol_version = kProtocolVersion;
  std::uint32_t server_epoch = 0;  ///< larger at each start of a server
  bool lockstep = false;
  std::uint32_t asset_port = 0;         ///< reserved, 0
  std::string scenario_hash;            ///< of the scenario's text, for recordings
  std::vector<std::string> free_hands;  ///< names of hands that no client controls
};

/// A client's request for a seat in the session, in the lobby partition; repeated until it is answered.
struct Join {
  std::string client_guid;  ///< random, chosen by the client; identifies it until it has a ClientId
  std::string name;         ///< of the person or station, for display
  Role role = Role::kObserver;
  std::vector<std::string> hands;  ///< names of the scenario's hands it wants to control
  std::string token;               ///< of an earlier Welcome, to get the same ClientId again; or empty
  std::uint32_t protocol_version = kProtocolVersion;
};

/// The server's answer to a Join, and later the notice that a client has lost its seat.
struct Welcome {
  std::string client_guid;  ///< of the Join
  bool accepted = false;
  std::string reason;         ///< of the refusal; empty when accepted
  ClientId client;            ///< valid though not accepted: this client has lost its seat
  std::vector<HandId> hands;  ///< in the order of Join::hands; invalid for one the scenario does not have
  std::string token;          ///< secret: whoever has it may take the seat again
  std::uint32_t server_epoch = 0;
  Tick tick = 0;  ///< newest of the server; in lockstep the first input is for the next one
  bool lockstep = false;
};

/// A client that has a seat. Published by the client; disposed, or lost with its writer, when it leaves.
struct Presence {
  ClientId client;
  std::string name;
  Role role = Role::kObserver;
  std::vector<HandId> hands;
  bool alive = true;
};

}  // namespace tenon
