#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "idl/types/messages/session.h"
#include "idl/wire/endpoint.h"
#include "server/session/server_writers.h"

namespace tenon::session {

/// What a server announces of its session, and the other servers of that name.
///
/// A server that is newer than this one is of no concern while this one lives: clients ignore it. Once this
/// one was stopped for so long that clients took it for dead, the newer one has them, and this one has to
/// end.
///
/// Threads: one (wire). Real-time: no.
class ServerAnnouncement {
 public:
  /// `content` is announced; `writers` must outlive this.
  ServerAnnouncement(SessionAnnounce content, ServerWriters& writers)
      : content_(std::move(content)), writers_(writers) {}

  /// Fails when another server announces a session of this name. On this machine the SessionLock decides;
  /// this is for servers on other machines.
  [[nodiscard]] static Result<void> refuseBesideAnother(wire::Partition& lobby, const std::string& session);

  void announce();
  /// Another server's announcement; true when it is one of this session's name that was not known.
  [[nodiscard]] bool isAnother(const SessionAnnounce& other);
  void forget(const SessionAnnounce& gone);
  /// To be called in each turn of the wire thread: announces from time to time, and notices when this thread
  /// stood still.
  void step();
  /// Why this server has to end; none while it need not.
  [[nodiscard]] const std::optional<std::string>& replaced() const { return replaced_; }

 private:
  using Time = std::chrono::steady_clock::time_point;

  SessionAnnounce content_;
  ServerWriters& writers_;
  std::map<std::uint32_t, SessionAnnounce> others_;  ///< servers of sessions of this name, by epoch
  Time announced_at_;
  std::optional<Time> stepped_, lapsed_;
  std::optional<std::string> replaced_;
};

}  // namespace tenon::session
