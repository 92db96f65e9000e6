#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/messages/role.h"
#include "idl/types/messages/session.h"
#include "idl/types/result.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/identity.h"

namespace tenon::wire {

/// Why a server ends the presence of a program whose seat another one has taken by its key.
inline constexpr const char* kSeatTaken = "another program has taken this seat with its key";

/// Which session a program joins, and how.
struct MembershipOptions {
  std::string session;              ///< its name; empty: the first one announced
  std::uint32_t domain = 0;         ///< DDS domain
  std::string person = "somebody";  ///< name of the participant, for display
  Role role = Role::kObserver;
  std::vector<std::string> hands;        ///< to control
  std::vector<HandStiffness> stiffness;  ///< Join::stiffness
  std::optional<SeatKey> seat;           ///< of an earlier seat, to rejoin it with its hands; none: a new one
  std::filesystem::path key_file;  ///< of the session's key, for roles that need it; empty: defaultKeyFile()
  std::optional<SharedKey> key;    ///< the session's key itself, instead of that of a file
  bool lockstep = false;           ///< refuse a session in real time
  bool passive = false;  ///< best-effort streams also in lockstep, so that it never blocks the session
  std::chrono::seconds timeout{10};  ///< [s] for finding a server, and for its answer
  /// Of a recorder: Join::recorded_until, for the server that it is about to join. Empty: nothing.
  std::function<Tick(const SessionAnnounce&)> recorded_until = {};
};

/// A client's seat in a session: finds the server in the lobby, joins, publishes Presence and disposes it at
/// the end. When the connection was lost on either side, it can rejoin the same seat.
///
/// From find() on it belongs to one server: what others write in its name is not delivered by readers of
/// lobby() and session() (Partition::hearOnly). Of several servers of one name it is the one that started
/// first.
///
/// Finding and joining are separate steps, because a recorder subscribes to the session before it joins.
///
/// Threads: one (wire). Real-time: no.
class Membership {
 public:
  using Stop = std::atomic<bool>;

  /// Fails when no session is announced in time, `stop` is set, or the protocol versions differ. Calls
  /// `meanwhile` every 5 ms.
  static Result<std::unique_ptr<Membership>> find(const MembershipOptions& options, const Stop& stop,
                                                  const std::function<void()>& meanwhile = {});
  /// Disposes the presence, so that the server need not wait for its lease to expire.
  ~Membership();
  Membership(const Membership&) = delete;
  Membership& operator=(const Membership&) = delete;

  /// Repeats the request for a seat until the server answers; calls `meanwhile` every 5 ms. Fails with the
  /// server's reason when it refuses, and when no answer comes in time.
  Result<void> join(const Stop& stop, const std::function<void()>& meanwhile = {});

  /// From now on dispatching `inbox` updates lost() and serverIsGone(); `inbox` must not be dispatched after
  /// the destruction of this. Who is removed from the session does not announce a presence any more.
  Result<void> watch(Inbox& inbox);
  /// The watched inbox has heard the server's announcement: only then can it hear that it is gone.
  [[nodiscard]] bool isWatching() const { return watched_epoch_ == announce_.server_epoch; }
  /// The server has ended or is unreachable, as lost() has found.
  [[nodiscard]] bool serverIsGone() const { return server_gone_; }
  /// Why the seat is lost; none while it is held. To be called between dispatches of the watched inbox: a
  /// server that it does not hear at all within two leases of its announcement ended before it was watched.
  [[nodiscard]] const std::optional<std::string>& lost();
  /// The seat is lost to another program, which had its key.
  [[nodiscard]] bool isDisplaced() const { return is_displaced_; }
  /// Finds the session again and requests the same seat, also when the server that was found is killed
  /// meanwhile and another one continues its session. Fails at once when another program has the seat now.
  Result<void> rejoin(const Stop& stop, const std::function<void()>& meanwhile = {});

  /// Ends the presence, of a client that stays without a seat.
  void leave();

  [[nodiscard]] const SessionAnnounce& announce() const { return announce_; }
  [[nodiscard]] const std::string& sessionName() const { return announce_.session; }
  [[nodiscard]] const Welcome& welcome() const { return welcome_; }
  /// Whether a message was written by the server whose Welcome was received.
  [[nodiscard]] bool isServer(const Origin& origin) const { return origin.known() && origin == server_; }
  /// The secret of the seat: whoever has it may take the seat again.
  [[nodiscard]] const SeatKey& seat() const { return *options_.seat; }
  [[nodiscard]] Partition& lobby() { return *lobby_; }
  [[nodiscard]] Partition& session() { return *session_; }
  /// For what the server sends to this client alone.
  [[nodiscard]] Partition& own() { return *own_; }
  /// Of the hands of the Welcome, from join() on: their contacts.
  [[nodiscard]] std::vector<Partition>& hands() { return hands_; }
  /// To read session() and the partitions of all hands, for recorders and gateways.
  [[nodiscard]] Partition& everything() { return *everything_; }

 private:
  explicit Membership(const MembershipOptions& options) : options_(options) {}
  Result<SessionAnnounce> awaitAnnounce(const Stop& stop, const std::function<void()>& meanwhile);
  /// join(). With `ended`, gives up and sets that when the server has ended, or another one has taken its
  /// place while it did not answer.
  Result<void> requestSeat(const Stop& stop, const std::function<void()>& meanwhile, bool* ended);
  Result<void> rejoinNext(const SessionAnnounce& before, const Stop& stop,
                          const std::function<void()>& meanwhile, bool& ended);
  Result<void> takeSeat();
  void loseServer();
  void openHands();
  void hearServer();
  /// Answers the challenge of a Welcome; `problem`: why there is no proof of the session's key.
  void prove(const std::string& challenge, Join& join, std::string& problem) const;

  MembershipOptions options_;
  /// Join::client_guid. Each request for a seat has another one, so that what the server says of an earlier
  /// presence, however late, is not taken for this one's.
  std::string guid_;
  std::shared_ptr<Participant> participant_;
  std::unique_ptr<Partition> lobby_;
  std::unique_ptr<Partition> session_;
  std::unique_ptr<Partition> own_;
  std::unique_ptr<Partition> everything_;
  std::vector<Partition> hands_;
  std::unique_ptr<Writer<Presence>> presence_writer_;
  SessionAnnounce announce_;
  Welcome welcome_;
  Presence presence_;
  Origin server_;
  std::optional<std::string> lost_;
  bool server_gone_ = false;
  bool is_displaced_ = false;  // kSeatTaken
  bool watches_ = false;
  std::uint32_t watched_epoch_ = 0;  // of the newest announcement that the watched inbox has heard
  std::optional<std::chrono::steady_clock::time_point> unheard_since_;  // the server of announce_
};

}  // namespace tenon::wire
