#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/role.h"

/// Joining a session and leaving it.
namespace tenon {

inline constexpr std::uint32_t kProtocolVersion = 12;

/// Published by each server in the lobby partition: the session it runs.
struct SessionAnnounce {
  std::string session;             ///< its name, by which clients choose it
  std::uint32_t server_epoch = 0;  ///< larger at each start of a server; one life of a server is one instance
  std::string title;               ///< of the scenario
  std::uint32_t protocol_version = kProtocolVersion;
  bool lockstep = false;
  /// The scene is complete with so many samples of SceneObject, SceneHand and SceneStep.
  std::uint32_t objects = 0, hands = 0, steps = 0;
  Tick resumed_after = 0;     ///< last tick of the killed server that this one continues; 0: it began anew
  std::string scenario_hash;  ///< of the scenario's text, for recordings
  std::string host;           ///< name of the machine that the server runs on
  std::uint32_t pid = 0;      ///< of the server's process there
  std::string scene_hash;     ///< asset that lists the display models of all objects (idl/wire/assets.h)
  // what a recording is re-simulated with
  std::string scenario;            ///< name of its folder, or of its file
  double detail = 1.0;             ///< [-] of the generated parts
  std::uint32_t freeze_ticks = 0;  ///< [ticks] age of its input at which a hand freezes
  std::uint32_t park_ticks = 0;    ///< [ticks] and at which what it holds is parked
};

/// A client's request for a seat in the session, in the lobby partition; repeated until it is answered. A
/// server hears only what names its session and its epoch.
///
/// What it has to prove (idl/wire/identity.h) it proves in answer to the challenge of a Welcome, so that no
/// secret is on the bus: that it is the owner of a seat that was given away before, and that it has the key
/// of the session, for a role that needs it.
struct Join {
  std::string client_guid;  ///< random, chosen by the client; identifies it until it has a ClientId
  std::string session;
  std::uint32_t server_epoch = 0;
  std::string name;  ///< of the person or station, for display
  Role role = Role::kObserver;
  std::vector<std::string> hands;  ///< names of the scenario's hands it wants to control
  std::string seat_key;            ///< public key of the seat; of an earlier seat to get its ClientId again
  std::string seat_proof;          ///< of the secret that belongs to seat_key; empty before a challenge
  std::string key_proof;           ///< of the session's key; empty before a challenge
  std::uint32_t protocol_version = kProtocolVersion;
  /// What the devices of `hands` and their links allow, in the order of `hands`; 8 at most, a shorter
  /// list says nothing of the rest. The server takes no stiffer coupling, and the scenario may ask for a
  /// softer one.
  std::vector<HandStiffness> stiffness;
  Tick recorded_until = 0;  ///< of a recorder that comes back: it has the inputs up to this tick
};

/// The server's answer to a Join, and later the notice that a client has lost its seat.
struct Welcome {
  std::string client_guid;  ///< of the Join
  std::string session;
  std::uint32_t server_epoch = 0;
  bool accepted = false;
  std::string reason;             ///< of the refusal; empty when accepted
  std::string challenge;          ///< of a refusal: what the proofs of the next Join have to answer; or empty
  ClientId client;                ///< valid though not accepted: this client has lost its seat
  std::vector<HandId> hands;      ///< in the order of Join::hands; invalid for one the scenario does not have
  std::vector<ObjectId> objects;  ///< of `hands`: that each moves while it holds no other; may be invalid
  Tick tick = 0;                  ///< newest of the server; in lockstep the first input is for the next one
  bool lockstep = false;
  std::uint32_t people = 0;  ///< clients that have a seat, this one included: so many Presences alive
  std::uint32_t permitted_commands = 0;  ///< that the role may send: of bitOf() of commands.h
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
