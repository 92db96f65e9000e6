#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/parser.h"
#include "idl/types/messages/run.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon::command {

/// Joins a session and sends commands to its server.
///
/// Threads: one. Real-time: no.
class CommandClient {
 public:
  using Stop = wire::Membership::Stop;

  /// Fails with a sentence when no session is found, joining is refused, or the server does not read
  /// commands.
  [[nodiscard]] static Result<std::unique_ptr<CommandClient>> open(wire::MembershipOptions options,
                                                                   const Stop& stop);

  /// Sends a command and waits for the answer, at most 5 s. Fails with the server's reason, or when there is
  /// no answer.
  [[nodiscard]] Result<void> send(const ParsedCommand& command, const Stop& stop);
  /// Takes messages for `timeout`; false when the session is over or the server is lost.
  bool dispatch(std::chrono::milliseconds timeout);

  /// Called with one line per change of step or run; may be empty.
  std::function<void(const std::string&)> report;

 private:
  explicit CommandClient(wire::MembershipOptions options) : options_(std::move(options)) {}
  Result<void> connect(const Stop& stop);
  Result<void> sendEmergencyStop(const ParsedCommand& command, const Stop& stop);
  void receive(const RunState& run);

  wire::MembershipOptions options_;
  std::unique_ptr<wire::Membership> member_;
  std::unique_ptr<wire::Writer<Command>> commands_;
  std::unique_ptr<wire::Writer<EmergencyStop>> stops_;
  std::uint32_t sent_ = 0;  ///< commands, also the id of the newest
  std::optional<CommandAck> ack_;
  bool stopped_ = false;  ///< an emergency stop is engaged, confirmed by the server
  std::string step_;      ///< name of the active one
  RunState run_;
  wire::Inbox inbox_;
};

/// Sends the command of a command line and prints the answer. Returns the exit code: 0 when it was accepted,
/// else 1.
[[nodiscard]] int commandOnce(CommandClient& client, const std::vector<std::string>& arguments,
                              const std::atomic<bool>& stop);
/// Sends the command of each key pressed, until `q`, the end of the input or of the session. Returns the exit
/// code: 0.
[[nodiscard]] int commandByKeys(CommandClient& client, const std::vector<std::string>& signals,
                                const std::atomic<bool>& stop);

}  // namespace tenon::command
