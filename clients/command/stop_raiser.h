#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
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
  /// No server of its sessions is announced, a station has obeyed it, and all that listen have it.
  [[nodiscard]] bool isObeyedWithoutServer() const {
    return silent_sessions == 0 && !by_server && stations > 0 && acknowledged;
  }
};

/// How long a raise is repeated that is not confirmed.
struct RaisePatience {
  using Milliseconds = std::chrono::milliseconds;

  Milliseconds to_find{10'000};        ///< as long as no program is discovered that it is for
  std::optional<Milliseconds> in_all;  ///< none: until it is confirmed, or `stop`
  /// To discover servers beside the stations that have obeyed; then people are told what is known.
  Milliseconds until_told{3000};
  Milliseconds between_tellings{10'000};
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

  /// Writes a raise and stays until it is confirmed by the server of each announced session, or, where none
  /// is announced, obeyed by stations: DDS repeats it to who does not acknowledge it, and gives it to who is
  /// discovered late, as long as this program runs. `tell` is told who has heard it meanwhile.
  [[nodiscard]] Result<StopHeard> raise(const std::string& reason, const RaisePatience& patience,
                                        const std::atomic<bool>& stop,
                                        const std::function<void(const StopHeard&)>& tell);

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
  void withdraw(std::uint32_t raise);
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
