#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/messages/run.h"
#include "idl/types/result.h"
#include "idl/wire/endpoint.h"

namespace tenon::command {

/// Who has heard a raise of the emergency stop.
struct StopHeard {
  std::size_t programs = 0;  ///< that listen: stations, the server, observers, recorders
  bool by_server = false;    ///< a server has repeated it, and stops its simulation
  bool acknowledged = true;  ///< by all that listen; false: one of them hangs, or its link does
};

/// What people are told of it: "accepted", or that no server has answered. Fails when nobody has heard it,
/// and when neither a server has answered nor all that listen have acknowledged it.
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
                                                                std::string person);

  /// Writes a raise, then waits for a server to repeat it, at most for `patience`, and until readers have it.
  [[nodiscard]] Result<StopHeard> raise(const std::string& reason, std::chrono::milliseconds patience,
                                        const std::atomic<bool>& stop);

  /// Writes a raise without waiting; returns its number for heard().
  [[nodiscard]] Result<std::uint32_t> write(const std::string& reason);
  /// Takes messages for `timeout`.
  void dispatch(std::chrono::milliseconds timeout) { inbox_.dispatch(timeout); }
  /// Who has heard a raise; none as long as waiting can tell more: until a server has repeated it and other
  /// programs had time to be discovered, at most for `patience` from its writing.
  [[nodiscard]] std::optional<StopHeard> heard(std::uint32_t raise, std::chrono::milliseconds patience) const;

 private:
  struct Raise {
    std::chrono::steady_clock::time_point written;
    std::vector<wire::Origin> repeaters;
  };

  StopRaiser() = default;
  [[nodiscard]] bool isServer(const wire::Origin& origin) const;

  std::string guid_;
  std::string person_;
  std::uint32_t counter_ = 0;
  std::unique_ptr<wire::Partition> lobby_;
  std::unique_ptr<wire::Partition> session_;
  std::unique_ptr<wire::Writer<EmergencyStop>> stops_;
  std::size_t own_readers_ = 0;
  std::vector<wire::Origin> servers_;      ///< by their announcements
  std::map<std::uint32_t, Raise> raises_;  ///< the newest ones, by number
  wire::Inbox inbox_;
};

}  // namespace tenon::command
