#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/external.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/wire/endpoint.h"
#include "server/game_control/scenario.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// The clients of a session: their seats (client id, token, DDS participant), roles, the hands they control
/// and what each of them may do.
///
/// It has neither network nor clock: received messages go in; Changes for the next tick and answers to the
/// sender come out. "Instructor rights" are those of the roles instructor and admin.
///
/// Threads: one (wire).
class SessionRegistry {
 public:
  /// `seed` of the tokens: must not be guessable when clients are not trusted. `scenario` must outlive this.
  SessionRegistry(const game_control::ScenarioFile& scenario, std::uint32_t server_epoch, bool lockstep,
                  std::uint64_t seed);

  /// Gives a seat to the client and binds it to the participant `from`, or refuses with a reason. A repeated
  /// request (same client_guid) gets the first answer again; a known token gets its former client id.
  [[nodiscard]] Welcome join(const Join& join, Tick now, const wire::Origin& from = {});
  /// Whether the seat of `client` was given to the participant `origin`.
  [[nodiscard]] bool ownsSeat(ClientId client, const wire::Origin& origin) const;
  /// Checks the command against role, hand and run phase. An accepted one becomes a Change and takes effect;
  /// one that cannot take effect now is refused with a reason.
  [[nodiscard]] CommandAck handleCommand(const Command& command);
  /// The acknowledgement of a command that is received again because its ack was lost; null for a new one.
  [[nodiscard]] const CommandAck* previousAck(const Command& command) const;
  /// Phase and emergency stop after the last tick.
  void updatePhase(RunPhase phase, bool emergency_stop);
  /// Frees the client's hands. Its seat stays and can be taken again with the token. Unknown ids are ignored.
  void leave(ClientId client);
  void setEmergencyStop(const EmergencyStop& stop);

  /// The newest sample of `input` as tick input. Fails, with a sentence for the event log, when the client
  /// does not control this hand, the server epoch is another one, or the numbers are implausible (not finite,
  /// beyond 1 km, 50 m/s or 50 rad/s, no unit quaternion).
  [[nodiscard]] Result<HandReading> validateDeviceInput(const DeviceInput& input) const;
  /// Fails for observers and recorders, unknown objects, and wrenches that are not finite. Those that are too
  /// large or last too long are passed on as they are: ForceBuffer::contribute clamps them.
  [[nodiscard]] Result<Change> validateForceContribution(const ForceContribution& force) const;
  /// Fails without instructor rights, for unknown objects and implausible poses.
  [[nodiscard]] Result<Change> validateExternalPose(const ExternalPose& pose) const;

  /// Moves the pending changes to `out`, oldest first, as many as it has room for; the rest stays pending.
  void takeChanges(FixedVector<Change, kMaxChanges>& out);

  /// Index + 1 = ClientId. Clients that left stay with alive = false.
  [[nodiscard]] const std::vector<Presence>& clients() const { return clients_; }
  /// Null for an unknown id.
  [[nodiscard]] const Presence* findClient(ClientId client) const;
  /// The client_guid of the latest join; `client` must be known.
  [[nodiscard]] const std::string& guidOf(ClientId client) const { return seats_[client.value - 1].guid; }
  /// The client that controls this hand; invalid when no client does.
  [[nodiscard]] ClientId controllerOf(HandId hand) const { return controllers_[hand.value]; }
  [[nodiscard]] bool anyHandControlled() const;
  [[nodiscard]] bool stopRequested() const { return stop_requested_; }
  [[nodiscard]] bool isRolePresent(Role role) const;
  /// Names of the hands that no client controls.
  [[nodiscard]] std::vector<std::string> freeHands() const;

 private:
  struct Seat {
    std::string guid;
    std::string token;
    Welcome welcome;
    wire::Origin origin;
    CommandAck last_ack;  ///< id 0: none yet
  };

  [[nodiscard]] std::string joinRefusal(const Join& join) const;
  void assignSeat(const Join& join, Welcome& welcome, const wire::Origin& from);
  [[nodiscard]] CommandAck decide(const Command& command, Role role);
  [[nodiscard]] std::string refusalByPhase(CommandKind kind) const;
  /// The run phase after all accepted changes have been applied.
  [[nodiscard]] RunPhase expectedPhase() const { return pending_phase_.value_or(phase_); }
  [[nodiscard]] Result<Change> changeFromCommand(const Command& command, Role role) const;
  [[nodiscard]] Result<Change> instructorChange(const Command& command) const;
  [[nodiscard]] Result<Change> releaseChange(const Command& command, Role role) const;
  [[nodiscard]] int findPair(std::string_view a, std::string_view b) const;
  [[nodiscard]] bool controlsBothHands(ClientId client) const;
  [[nodiscard]] bool isController(ClientId client, HandId hand) const;

  const game_control::ScenarioFile& scenario_;
  std::uint32_t server_epoch_;
  bool lockstep_;
  std::mt19937_64 random_;
  std::vector<Presence> clients_;
  std::vector<Seat> seats_;            ///< index as clients_
  std::vector<ClientId> controllers_;  ///< index = HandId
  std::vector<Change> changes_;        ///< pending
  RunPhase phase_ = RunPhase::kWaitingForPeople;
  std::optional<RunPhase> pending_phase_;  ///< of an accepted pause or resume that no tick has applied yet
  bool emergency_stop_ = false;            ///< engaged
  bool stop_requested_ = false;
  std::size_t deferred_commands_ = 0;  ///< accepted game commands that take effect when the session continues
};

}  // namespace tenon::session
