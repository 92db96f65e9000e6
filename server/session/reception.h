#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/session.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/identity.h"
#include "server/session/journal_copies.h"
#include "server/session/seat_list.h"
#include "server/session/server_writers.h"
#include "server/session/session_registry.h"

namespace tenon::session {

/// Lets clients in and out: challenges and answers requests to join, closes the seats of those who leave, are
/// lost or are removed, and tells them.
///
/// Joins, and leaves of clients without hands, wait in queues and are handled one after the other, so that a
/// crowd that comes or goes does not delay frames.
///
/// Threads: one (wire). Real-time: no.
class Reception {
 public:
  struct Session {
    std::string name;
    std::uint32_t server_epoch = 0;
    std::optional<wire::SharedKey> key;  ///< none: nobody can be admin or instructor
  };
  /// What it tells the wire thread; all are set before the first call.
  struct Callbacks {
    std::function<void(Severity, const std::string& kind, const std::string& text)> log;
    /// A client has got a seat; its hands begin anew.
    std::function<void(const Welcome&)> seated;
    /// A client has left; its hands are detached.
    std::function<void(ClientId)> left;
    /// A command that removed people may be answered.
    std::function<void(const Command&, const CommandAck&, const std::string& who)> answer;
  };

  /// `seats`, `copies`: null without; all references must outlive this.
  Reception(Session session, SessionRegistry& registry, ServerWriters& writers, SeatKeeper* seats,
            JournalCopies* copies)
      : session_(std::move(session)),
        registry_(registry),
        writers_(writers),
        seats_(seats),
        copies_(copies) {}

  Callbacks callbacks;

  /// Queues a request; the program repeats one that finds no room.
  void receive(const Join& join, const wire::Origin& from);
  /// The presence of `client` was heard: from now on its end is noticed.
  void handlePresent(ClientId client) { unheard_.erase(client); }
  /// The presence of `client` has ended.
  void handleGone(ClientId client);
  /// Removes a client from the session, notifies it, and logs "Ada (trainee) <why>".
  void dismiss(ClientId client, const std::string& why);
  /// To a program that still sends although its seat is lost, so that it can rejoin; at most once a second.
  void notifySeatLost(ClientId client, const std::string& why);
  /// Dismisses whom an accepted command has removed; false when it has removed nobody. Answered once the seat
  /// is closed in the file too: who was told that somebody is removed does not meet that person again when
  /// the server is killed and resumed.
  bool dismissKicked(const Command& command, const CommandAck& ack, const std::string& who);
  /// Whether this command waits to be answered.
  [[nodiscard]] bool holds(const Command& command) const;

  /// One turn of the wire thread.
  void step();
  void setTick(Tick newest) { now_ = newest; }
  static constexpr std::chrono::milliseconds kBetweenTurns{5};
  /// Something waits for the next turn, in kBetweenTurns.
  [[nodiscard]] bool waits() const { return !joins_.empty() || !leaves_.empty() || !kicks_.empty(); }

 private:
  void admit(const Join& join, const wire::Origin& from);
  void dismissUnheard();
  void finishKicks();
  void dismissStuckRecorders();

  Session session_;
  SessionRegistry& registry_;
  ServerWriters& writers_;
  SeatKeeper* seats_;
  JournalCopies* copies_;
  wire::SharedKey challenges_ = wire::SharedKey::random();  ///< what challenges are made of
  std::deque<std::pair<Join, wire::Origin>> joins_;         ///< waiting
  /// With a seat, and without a presence since; by when it must be heard.
  std::map<ClientId, std::chrono::steady_clock::time_point> unheard_;
  std::deque<ClientId> leaves_;  ///< waiting
  struct Kick {
    Command command;
    CommandAck ack;
    std::string who;
    std::uint64_t seats_kept = 0;  ///< SeatKeeper::keep
  };
  std::deque<Kick> kicks_;                                                        ///< waiting
  std::map<ClientId, std::chrono::steady_clock::time_point> seat_lost_notified_;  ///< last time
  std::chrono::steady_clock::time_point next_change_;
  Tick now_ = 0;
};

}  // namespace tenon::session
