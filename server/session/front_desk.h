#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "idl/types/messages.h"
#include "idl/wire/endpoint.h"
#include "server/game_control/scenario.h"
#include "server/session/tick_io.h"

namespace tenon {

/// Who is here, what each may do, who moves which hand. Knows neither network nor time: it is told what
/// arrived and says what follows, as Changes for the next tick and as answers to the sender.
///
/// Threads: one (wire).
class FrontDesk {
 public:
  FrontDesk(const ScenarioFile& scenario, std::uint32_t server_epoch, bool lockstep, std::uint64_t seed);

  /// The seat is bound to the program that `from` names.
  [[nodiscard]] Welcome join(const Join& join, Tick now, const Origin& from = {});
  /// Whether this program is the one that took the client's seat.
  [[nodiscard]] bool isFrom(ClientId client, const Origin& origin) const;
  /// What is accepted will be done; what cannot be done now is refused.
  [[nodiscard]] CommandAck command(const Command& command);
  /// The answer to a command that is asked again because its answer got lost; null: it is a new one.
  [[nodiscard]] const CommandAck* answerTo(const Command& command) const;
  /// What the run had come to after the last tick.
  void follow(RunPhase phase, bool emergency_stop);
  void leave(ClientId client);
  void emergencyStop(const EmergencyStop& stop);

  /// Takes a reading over into the next tick if this client may move this hand and the numbers make sense.
  /// Otherwise says why not, as a sentence for the event log.
  [[nodiscard]] Result<HandReading> reading(const DeviceInput& input) const;
  [[nodiscard]] Result<Change> contribution(const ForceContribution& force) const;
  [[nodiscard]] Result<Change> externalPose(const ExternalPose& pose) const;

  /// What has been decided since the last call, at most as many as a tick can take over.
  void takeChanges(FixedVector<Change, kMaxChanges>& out);

  [[nodiscard]] const std::vector<Presence>& people() const { return people_; }
  [[nodiscard]] const Presence* person(ClientId client) const;
  /// The random name a client asked with.
  [[nodiscard]] const std::string& guidOf(ClientId client) const { return seats_[client.value - 1].guid; }
  [[nodiscard]] ClientId moverOf(HandId hand) const { return movers_[hand.value]; }
  [[nodiscard]] bool someoneMovesAHand() const;
  [[nodiscard]] bool stopIsAsked() const { return stop_asked_; }
  [[nodiscard]] bool roleIsHere(Role role) const;
  [[nodiscard]] std::vector<std::string> freeHands() const;

 private:
  struct Seat {
    std::string guid;
    std::string token;
    Welcome welcome;
    Origin origin;
    CommandAck answer;  ///< to the last command; id 0: none yet
  };

  [[nodiscard]] std::string refusal(const Join& join) const;
  void seat(const Join& join, Welcome& welcome, const Origin& from);
  [[nodiscard]] CommandAck decide(const Command& command, Role role);
  [[nodiscard]] std::string untimely(CommandKind kind) const;
  /// The run's phase once all that was accepted is done.
  [[nodiscard]] RunPhase comingPhase() const { return decided_.value_or(phase_); }
  [[nodiscard]] Result<Change> changeFor(const Command& command, Role role) const;
  [[nodiscard]] Result<Change> teachersChange(const Command& command) const;
  [[nodiscard]] Result<Change> releaseOf(const Command& command, Role role) const;
  [[nodiscard]] int pairNamed(std::string_view a, std::string_view b) const;
  [[nodiscard]] bool movesBothHands(ClientId client) const;
  [[nodiscard]] bool isMover(ClientId client, HandId hand) const;

  const ScenarioFile& scenario_;
  std::uint32_t server_epoch_;
  bool lockstep_;
  std::mt19937_64 random_;
  std::vector<Presence> people_;  ///< in order of joining; those who left stay with alive = false
  std::vector<Seat> seats_;       ///< as people_
  std::vector<ClientId> movers_;  ///< index = HandId
  std::vector<Change> changes_;
  RunPhase phase_ = RunPhase::kWaitingForPeople;
  std::optional<RunPhase> decided_;  ///< by a pause or resume that no tick has done yet
  bool halted_ = false;              ///< an emergency stop is engaged
  bool stop_asked_ = false;          ///< the run is to end
  std::size_t held_back_ = 0;        ///< commands that wait until the session goes on
};

}  // namespace tenon
