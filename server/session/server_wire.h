#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "idl/wire/endpoint.h"
#include "server/game_control/scenario.h"
#include "server/session/broadcast.h"
#include "server/session/front_desk.h"
#include "server/session/intake.h"
#include "server/session/journal.h"
#include "server/session/scene_loader.h"

namespace tenon {

struct WireOptions {
  std::string session;
  std::uint32_t domain = 0;
  bool lockstep = false;
  bool publish_journal = true;
  std::uint32_t server_epoch = 0;
};

/// The server's mouth and ears: every endpoint of a session, bound to the front desk and the intake.
///
/// Threads: one (wire). Real-time: no.
class ServerWire {
 public:
  [[nodiscard]] static Result<std::unique_ptr<ServerWire>> open(const WireOptions& options,
                                                                const LoadedScene& loaded, FrontDesk& desk,
                                                                Intake& intake, Broadcast& broadcast);

  /// Hears what there is, waiting for it up to `timeout`; what the desk decided goes into the intake.
  void listen(std::chrono::nanoseconds timeout);
  void wake() noexcept { inbox_.wake(); }
  void announce();
  void send(const Outgoing& outgoing);
  /// The frames and manifolds of the last tick once more, for a client that lost them.
  void sendAgain();
  void send(const EventLog& event);
  void send(const RunState& run);
  void send(const JournalEntry& entry);

  /// Takes a client out of the session; `why` is what the log says about it.
  void dismiss(ClientId client, const std::string& why);
  /// The newest seq heard of a hand; 0: none yet.
  [[nodiscard]] std::uint32_t newestSeq(HandId hand) const { return newest_seq_[hand.value]; }
  /// True once after a client repeated an input that was answered already: its answer was lost.
  [[nodiscard]] bool takeRepeatWish() { return std::exchange(repeat_wish_, false); }
  [[nodiscard]] std::uint64_t refusedInputs() const { return refused_inputs_; }
  void follow(const TickOutput& output);

  std::function<void(const std::string&)> say;

 private:
  ServerWire(const WireOptions& options, std::shared_ptr<Participant> participant, FrontDesk& desk,
             Intake& intake, Broadcast& broadcast);

  template <class M>
  struct Out;
  struct Writers;

  Result<void> openWriters();
  Result<void> openReaders();
  void sendScene(const LoadedScene& loaded);
  void hear(const Join& join, const Origin& from);
  void hear(const DeviceInput& input, const Origin& from);
  void hear(const Command& command, const Origin& from);
  void hear(const ClockSync& sync);
  void hear(const EmergencyStop& stop, const Origin& from);
  void heardGone(const Presence& presence, const Origin& from);
  [[nodiscard]] bool isGenuine(ClientId client, const Origin& from, const std::string& what);
  void tellLost(ClientId client, const std::string& why);
  void endEmergencyStop(ClientId client, const std::string& reason);
  void refuse(const std::string& why);
  void passChanges();
  void note(Severity severity, const std::string& kind, const std::string& text);

  WireOptions options_;
  std::shared_ptr<Participant> participant_;
  Partition lobby_;
  Partition session_;
  Inbox inbox_;
  std::shared_ptr<Writers> writers_;
  FrontDesk& desk_;
  Intake& intake_;
  Broadcast& broadcast_;
  std::string title_;
  std::string scenario_hash_;
  std::vector<std::uint32_t> newest_seq_;
  std::set<std::string> said_;  ///< refusals told once, not a thousand times a second
  std::map<ClientId, std::chrono::steady_clock::time_point> told_lost_;
  std::uint64_t refused_inputs_ = 0;
  bool repeat_wish_ = false;
  bool stopped_ = false;
  Tick now_ = 0;
  const Outgoing* last_ = nullptr;
};

}  // namespace tenon
