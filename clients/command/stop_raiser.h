#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/messages/run.h"
#include "idl/types/result.h"
#include "idl/wire/endpoint.h"

namespace tenon::command {

/// Who has heard a raise of the emergency stop.
struct StopHeard {
  std::size_t programs = 0;         ///< that listen: stations, the server, observers, recorders
  bool by_server = false;           ///< a server has repeated it, and stops its simulation
  std::size_t stations = 0;         ///< that have repeated it, and stop their devices
  std::size_t silent_sessions = 0;  ///< those announced, of the ones it is for, whose servers have not
  bool acknowledged = true;         ///< by all that listen; false: one of them hangs, or its link does

  /// It stands in each session that it is for.
  [[nodiscard]] bool isConfirmed() const { return by_server && silent_sessions == 0; }
};

/// What people are told of it: "accepted", or who has not answered. Fails when no server has, and
/// no station or not all that listen have acknowledged it.
[[nodiscard]] Result<std::string> outcomeOf(const StopHeard& heard, std::uint32_t domain,
                                            const std::string& session);

/// Raises the emergency stop, directly to every device of a session or of all sessions. It needs no seat, no
/// key and no server.
///
/// Threads: one. Real-time: no.
class StopRaiser {
 public:
  /// `session` empty: all sessions of the DDS domain. Fails when DDS does.
  [[nodiscard]] static Result<std::unique_ptr<StopRaiser>> open(std::uint32_t domain,
                                                                const std::string& session,
                                                                const std::string& person);

  /// Writes a raise, then waits for a server to repeat it, at most for `patience`, and until readers have it.
  [[nodiscard]] Result<StopHeard> raise(const std::string& reason, std::chrono::milliseconds patience,
                                        const std::atomic<bool>& stop);

  /// Writes a raise without waiting; returns its number for heard().
  [[nodiscard]] Result<std::uint32_t> write(const std::string& reason);
  /// Takes messages for `timeout`.
  void dispatch(std::chrono::milliseconds timeout) { inbox_.dispatch(timeout); }
  /// Who has heard a raise; none as long as waiting can tell more: until it is confirmed and other programs
  /// had time to be discovered, at most for `patience` from its writing.
  [[nodiscard]] std::optional<StopHeard> heard(std::uint32_t raise, std::chrono::milliseconds patience) const;
  /// Whether all that listen have acknowledged all raises by now.
  [[nodiscard]] bool isAcknowledged() { return stops_->waitForReaders(std::chrono::nanoseconds(0)); }

 private:
  struct Raise {
    std::chrono::steady_clock::time_point written;
    std::vector<wire::Origin> repeaters;
  };

  StopRaiser() = default;
  void repeat(std::uint32_t raise, const wire::Origin& from);
  [[nodiscard]] bool isServer(const wire::Origin& origin) const;
  [[nodiscard]] std::size_t silentSessions(const std::vector<wire::Origin>& repeaters) const;

  struct Server {
    wire::Origin origin;
    bool is_gone = false;
  };

  std::string guid_;
  std::string person_;
  wire::Origin own_;
  std::uint32_t counter_ = 0;
  std::unique_ptr<wire::Partition> lobby_;
  std::unique_ptr<wire::Partition> session_;
  std::unique_ptr<wire::Writer<EmergencyStop>> stops_;
  std::size_t own_readers_ = 0;
  /// Of the sessions it is for, by session and epoch.
  std::map<std::pair<std::string, std::uint32_t>, Server> servers_;
  bool has_more_servers_ = false;          ///< than are known
  std::map<std::uint32_t, Raise> raises_;  ///< the newest ones, by number
  wire::Inbox inbox_;
};

}  // namespace tenon::command
