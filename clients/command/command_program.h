#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/parser.h"
#include "clients/command/stop_raiser.h"
#include "idl/types/messages/run.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon::command {

/// For people: by whom the newest raise was, of how many that stand.
[[nodiscard]] std::string describe(const NewestRaise& newest);

/// Joins a session and sends commands to its server. The emergency stop is no command: StopRaiser.
///
/// Threads: one. Real-time: no.
class CommandClient {
 public:
  using Stop = wire::Membership::Stop;

  /// Fails with a sentence when no session is found, joining is refused, or the server does not read
  /// commands. `meanwhile` is called every 20 ms at least, whatever this waits for, also later; it may be
  /// empty.
  [[nodiscard]] static Result<std::unique_ptr<CommandClient>> open(wire::MembershipOptions options,
                                                                   const Stop& stop,
                                                                   std::function<void()> meanwhile = {});

  /// Sends a command that is no emergency stop and waits for the answer, at most 5 s. Fails with the server's
  /// reason, or when there is no answer. When the server is killed meanwhile, the one that resumes the
  /// session is asked once more if it does no harm to do twice what is asked for.
  [[nodiscard]] Result<void> send(const ParsedCommand& command, const Stop& stop);
  /// Why the server has refused the last command; kNone when it has not.
  [[nodiscard]] Refusal refusal() const { return ack_ ? ack_->refusal : Refusal::kNone; }
  /// Whether its role may send the command, as the server has said.
  [[nodiscard]] bool permits(CommandKind kind) const {
    return (member_->welcome().permitted_commands & bitOf(kind)) != 0;
  }
  /// Takes messages for `timeout`.
  void dispatch(std::chrono::milliseconds timeout) {
    inbox_.dispatch(timeout);
    tellNewest();
    if (lost()) member_->leave();  // nobody comes back to this seat
  }
  [[nodiscard]] bool isOver() const { return run_ && tenon::isOver(run_->phase); }
  /// Why the server takes no more commands; none while it does.
  [[nodiscard]] const std::optional<std::string>& lost() const { return member_->lost(); }
  /// It is lost because its server has ended: rejoin() finds the one that resumes the session.
  [[nodiscard]] bool serverIsGone() const { return member_->serverIsGone(); }
  /// Membership::rejoin.
  [[nodiscard]] Result<void> rejoin(const Stop& stop);
  [[nodiscard]] const std::string& sessionName() const { return member_->sessionName(); }
  /// NewestRaise::number of the emergency stop, of which `report_raise` was told.
  [[nodiscard]] std::uint32_t toldRaise() const { return told_; }

  /// Called with one line per change of step or run; may be empty.
  std::function<void(const std::string&)> report;
  /// Called with a line about the newest raise that stands, when it is another one; may be empty.
  std::function<void(const std::string&)> report_raise;

 private:
  CommandClient(wire::MembershipOptions options, std::function<void()> meanwhile)
      : options_(std::move(options)), meanwhile_(std::move(meanwhile)) {}
  Result<void> connect(const Stop& stop);
  Result<void> awaitReader(const Stop& stop);
  bool dispatchUntil(const Stop& stop, std::chrono::steady_clock::duration timeout,
                     const std::function<bool()>& done);
  Result<void> sendOnce(const ParsedCommand& command, const Stop& stop);
  void receive(const RunState& run);
  void receive(const NewestRaise& newest);
  void tellNewest();

  wire::MembershipOptions options_;
  std::function<void()> meanwhile_;
  std::unique_ptr<wire::Membership> member_;
  std::unique_ptr<wire::Writer<Command>> commands_;
  std::uint32_t sent_ = 0;  ///< commands, also the id of the newest
  std::optional<CommandAck> ack_;
  std::string step_;  ///< name of the active one
  std::optional<RunState> run_;
  std::optional<NewestRaise> newest_;
  std::uint32_t told_ = 0;  ///< number of the newest raise that was told
  std::chrono::steady_clock::time_point next_telling_{};
  wire::Inbox inbox_;
};

/// Raises the emergency stop, as long as StopRaiser::raise does, and prints who has obeyed it. Returns the
/// exit code: 0 when the server of each announced session has, or, where none is announced, a station has and
/// all that listen have acknowledged it, else 1.
[[nodiscard]] int emergencyOnce(const wire::MembershipOptions& options, const ParsedCommand& command,
                                const RaisePatience& patience, const std::atomic<bool>& stop);
/// Sends the command of a command line and prints the answer. Returns the exit code: 0 when it was accepted,
/// else 1.
[[nodiscard]] int commandOnce(CommandClient& client, const std::vector<std::string>& arguments,
                              const std::atomic<bool>& stop);
/// Joins the session and sends the command of each key pressed, until `q`, the end of the input or of the
/// session. What ends or restarts a run is sent when the next key is `y`. The emergency stop is raised at
/// once, whatever else is waited for; it alone is left to who cannot join, for whom `why_not` is a known
/// reason, or has lost the server, until another one resumes the session. Returns the exit code: 1 when it
/// has not joined, else 0.
[[nodiscard]] int commandByKeys(const wire::MembershipOptions& options,
                                const std::vector<std::string>& signals, const Result<void>& why_not,
                                const std::atomic<bool>& stop);

}  // namespace tenon::command
