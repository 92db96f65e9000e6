#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/messages.h"
#include "idl/types/result.h"
#include "idl/wire/endpoint.h"

namespace tenon {

/// What a program wants of a session.
struct MembershipWishes {
  std::string session;  ///< empty: the first one announced
  std::uint32_t domain = 0;
  std::string person = "somebody";
  Role role = Role::kObserver;
  std::vector<std::string> hands;
  std::string token;                  ///< of an earlier seat: to get it and its hands back
  bool lockstep = false;              ///< refuse a session that runs by the clock
  bool only_watches = false;          ///< takes streams as they come, so that it holds nobody up in lockstep
  std::chrono::seconds patience{10};  ///< for a server to be found and to answer
};

/// A program's seat in a session: finds the server in the lobby, asks to be let in, says that it is here and,
/// at the end, good-bye. When the server has lost it, or it the server, it comes back to the same seat.
///
/// Finding and joining are two steps, because a recorder listens to the session before it asks for its seat.
///
/// Threads: one (wire). Real-time: no.
class Membership {
 public:
  using Stop = std::atomic<bool>;

  /// Fails with a sentence when no server is found in time, or `stop` is set.
  static Result<std::unique_ptr<Membership>> find(const MembershipWishes& wishes, const Stop& stop);
  /// Says good-bye, so that nobody has to find out by waiting.
  ~Membership();
  Membership(const Membership&) = delete;
  Membership& operator=(const Membership&) = delete;

  /// Asks for the seat until the server answers; calls `meanwhile` between looks. Fails with the server's
  /// reason when it refuses.
  Result<void> join(const Stop& stop, const std::function<void()>& meanwhile = {});

  /// From now on dispatching `inbox`, which the Membership outlives, shows here when the seat is lost.
  Result<void> watch(Inbox& inbox);
  [[nodiscard]] bool serverIsGone() const { return server_gone_; }
  /// Why there is no seat any more; none while there is one.
  [[nodiscard]] const std::optional<std::string>& lost() const { return lost_; }
  /// Finds the session again and asks for the same seat.
  Result<void> comeBack(const Stop& stop, const std::function<void()>& meanwhile = {});

  [[nodiscard]] const SessionAnnounce& announce() const { return announce_; }
  [[nodiscard]] const std::string& sessionName() const { return announce_.session; }
  [[nodiscard]] const Welcome& welcome() const { return welcome_; }
  /// Whether a message was written by the server that let this program in.
  [[nodiscard]] bool isServer(const Origin& origin) const { return origin.known() && origin == server_; }
  [[nodiscard]] Partition& lobby() { return *lobby_; }
  [[nodiscard]] Partition& session() { return *session_; }

 private:
  explicit Membership(const MembershipWishes& wishes) : wishes_(wishes) {}
  Result<SessionAnnounce> await(const Stop& stop, const std::function<void()>& meanwhile);
  Result<void> takeSeat();

  MembershipWishes wishes_;
  std::string guid_;
  std::unique_ptr<Partition> lobby_;
  std::unique_ptr<Partition> session_;
  std::unique_ptr<Writer<Presence>> presence_writer_;
  SessionAnnounce announce_;
  Welcome welcome_;
  Presence presence_;
  Origin server_;
  std::optional<std::string> lost_;
  bool server_gone_ = false;
};

}  // namespace tenon
