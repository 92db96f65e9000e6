#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/external.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/timing.h"
#include "idl/wire/endpoint.h"
#include "server/game_control/scenario.h"
#include "server/session/accepted_commands.h"
#include "server/session/command_gate.h"
#include "server/session/command_translator.h"
#include "server/session/mentoring.h"
#include "server/session/refused.h"
#include "server/session/rights.h"
#include "server/session/seat_list.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// What a Join has proven (wire::SeatKey, wire::SharedKey).
struct JoinProofs {
  bool seat = false;  ///< that the client has the secret of its seat_key
  bool key = false;   ///< that it has the key of the session
};

/// The clients of a session: their seats (client id, key of the seat, DDS participant), roles, the hands they
/// control and what each of them may do, by the table of rights.h.
///
/// It has neither network nor clock: received messages go in; Changes for the next tick and answers to the
/// sender come out.
///
/// Threads: one (wire).
class SessionRegistry {
 public:
  /// Commands beyond this many changes that no tick has taken are refused, but for pause, resume, stop and
  /// the clear of an emergency stop; those to the state machine also beyond kMostWaitingCommands.
  static constexpr std::size_t kMostWaitingChanges = 16 * kMaxChanges;

  /// `scenario` must outlive this.
  SessionRegistry(const game_control::ScenarioFile& scenario, std::uint32_t server_epoch, bool lockstep);

  /// Takes the place of the registry of a killed server, before anybody joins: seats are as they were, with
  /// nobody on them, and no client controls a hand.
  void resume(const std::vector<KeptSeat>& seats);
  [[nodiscard]] std::vector<KeptSeat> seatsToKeep() const;

  /// Whether roles that need no key by the table need it nevertheless.
  void requireKey(bool of_all) { key_of_all_ = of_all; }

  /// Gives a seat to the client and binds it to the participant `from`, or refuses with a reason; who has the
  /// seat or a hand keeps it in that case. A repeated request (same client_guid and participant) gets the
  /// first answer again; a known seat_key gets its former client id.
  [[nodiscard]] Welcome join(const Join& join, const JoinProofs& proofs, Tick now,
                             const wire::Origin& from = {});
  /// Whether this request needs a proof: its role needs the key, or its seat was given away before.
  [[nodiscard]] bool mustProve(const Join& join) const;
  /// Whether this client has a seat by an earlier request of the same client_guid.
  [[nodiscard]] bool isSeated(const std::string& client_guid) const;
  /// Whether a seat was given to this key.
  [[nodiscard]] bool knowsSeat(const std::string& seat_key) const { return indexOf(seat_key).has_value(); }
  /// The client_guid of the program that has the seat of this key; none: nobody is there.
  [[nodiscard]] std::optional<std::string> holderOf(const std::string& seat_key) const;
  /// Whether the seat of `client` was given to the participant `origin`.
  [[nodiscard]] bool ownsSeat(ClientId client, const wire::Origin& origin) const;
  /// Checks the command against role, hand and run phase. An accepted one becomes a Change and takes effect;
  /// one that cannot take effect now is refused with a reason. `newest`: of the emergency stop.
  [[nodiscard]] CommandAck handleCommand(const Command& command, const NewestRaise& newest = {});
  /// The acknowledgement of a command that is received again because its ack was lost; null for a new one.
  [[nodiscard]] const CommandAck* previousAck(const Command& command) const;
  /// What a station has measured of its link. Of unknown clients it is ignored.
  void receive(const Telemetry& telemetry) {
    if (telemetry.clock_known && findClient(telemetry.client) != nullptr)
      mentoring_.setRoundTrip(telemetry.client, telemetry.round_trip + telemetry.trip_jitter);
  }
  /// Mentoring::step.
  [[nodiscard]] std::vector<Guidance> guidance(const TickOutput& output, std::vector<std::string>& ended) {
    return mentoring_.step(output, controllers_, ended);
  }
  /// Who was removed by commands since the last call, and is still there.
  [[nodiscard]] std::vector<ClientId> takeKicked();
  /// Phase after the last tick.
  void updatePhase(RunPhase phase) { gate_.update(phase); }
  /// Current step after the last tick, from 0; none between two.
  void updateStep(std::optional<std::uint32_t> step) { step_ = step; }
  /// TickOutput::commands of a tick; after updatePhase().
  void updateCommands(const CommandCounts& counts) { accepted_.update(counts, isOver(phase())); }
  /// Accepted commands that are not carried out, as sentences, since the last call.
  [[nodiscard]] std::vector<std::string> takeDroppedCommands() { return accepted_.takeDropped(); }
  /// Frees the client's hands. Its seat stays and can be taken again with its key. Unknown ids are ignored.
  void leave(ClientId client);
  /// A raise stands; of several the first one stops the simulation.
  void engageEmergencyStop();
  [[nodiscard]] bool isStopEngaged() const { return gate_.isStopEngaged(); }
  /// The last raise that stood was cleared: the simulation leaves the stop, paused.
  void clearEmergencyStop();

  /// The newest sample of `input` as tick input. Fails, with a sentence for the event log, when the client
  /// does not control this hand, the server epoch is another one, or the numbers are implausible
  /// (checkedReading).
  [[nodiscard]] Result<HandReading> validateDeviceInput(const DeviceInput& input) const;
  using KeptBack = std::function<std::uint32_t(HandId)>;  ///< [ticks] InputBuffer::keptBack()
  /// The station of `client` asks for these limits of all its hands, within those of HandLimits, and says the
  /// `round_trip` [s] of its link. With what the server keeps back of a hand that feels forces (empty:
  /// nothing) it is told to the simulation, rounded up to steps of kTripStep, at once when it grows, when it
  /// falls by two steps. False: it has no hands, or they are so already.
  bool setLimits(ClientId client, const HandLimits& limits, double round_trip = 0.0,
                 const KeptBack& kept_back = {});
  /// In force with the next tick.
  [[nodiscard]] const HandLimits& limitsOf(HandId hand) const { return limits_[hand.value]; }
  /// [s] likewise; 0 up to kTripStep. Who comes back to a seat has that of before, until it is measured anew.
  [[nodiscard]] double roundTripOf(HandId hand) const { return round_trips_[hand.value]; }
  static constexpr double kTripStep = 0.0025;  ///< [s] a shorter round trip counts as none
  /// Fails for observers and recorders, and as checkedForce() does.
  [[nodiscard]] Result<Change> validateForceContribution(const ForceContribution& force) const;
  /// Fails without Right::kPlaceObjects, and as checkedPose() does.
  [[nodiscard]] Result<Change> validateExternalPose(const ExternalPose& pose) const;

  /// Moves the pending changes to `out`, oldest first, as many as it has room for; the rest stays pending.
  void takeChanges(FixedVector<Change, kMaxChanges>& out);

  /// Index + 1 = ClientId. Clients that left stay with alive = false, the last kMaxSeats of them.
  [[nodiscard]] const std::vector<Presence>& clients() const { return clients_; }
  /// Null for an unknown id.
  [[nodiscard]] const Presence* findClient(ClientId client) const;
  /// The client_guid of the latest join; `client` must be known.
  [[nodiscard]] const std::string& guidOf(ClientId client) const { return seats_[client.value - 1].guid; }
  /// The client that controls this hand; invalid when no client does.
  [[nodiscard]] ClientId controllerOf(HandId hand) const { return controllers_[hand.value]; }
  [[nodiscard]] bool anyHandControlled() const;
  [[nodiscard]] bool stopRequested() const { return gate_.endRequested(); }
  /// As updatePhase() said last.
  [[nodiscard]] RunPhase phase() const { return gate_.phase(); }
  [[nodiscard]] bool isRolePresent(Role role) const { return present(role) > 0; }

 private:
  struct Seat {
    std::string guid;
    std::string key;  ///< public key
    Welcome welcome;
    wire::Origin origin;
    CommandAck last_ack;      ///< id 0: none yet
    std::uint64_t left = 0;   ///< counts departures
    bool is_closed = false;   ///< its person was removed
    double round_trip = 0.0;  ///< [s] from input to answer, the longest that was told to the simulation
  };

  /// Seats in all, of those that are present and of those that left: then that of who left first is given
  /// away.
  static constexpr std::size_t kMaxSeats = 1024;

  void pushLimits(HandId hand);
  [[nodiscard]] std::size_t present(Role role) const;
  [[nodiscard]] std::optional<std::size_t> indexOf(const std::string& seat_key) const;
  [[nodiscard]] std::string joinRefusal(const Join& join, const JoinProofs& proofs) const;
  [[nodiscard]] std::string handRefusal(const Join& join, std::optional<std::size_t> former) const;
  [[nodiscard]] HandStiffness stiffnessOf(const Join& join, std::size_t index) const;
  [[nodiscard]] std::size_t newSeat();
  void assignSeat(const Join& join, Welcome& welcome, const wire::Origin& from);
  [[nodiscard]] CommandAck decide(const Command& command, Role role, const NewestRaise& newest);
  [[nodiscard]] static tl::expected<void, Refused> checkNote(const Command& command);
  [[nodiscard]] tl::expected<void, Refused> kick(const Command& command, Role role);
  [[nodiscard]] tl::expected<ClientId, Refused> findPerson(const std::string& text) const;
  [[nodiscard]] bool isController(ClientId client, HandId hand) const;

  const game_control::ScenarioFile& scenario_;
  CommandTranslator translator_;
  std::uint32_t server_epoch_;
  bool lockstep_;
  bool key_of_all_ = false;
  std::uint64_t departures_ = 0;
  std::vector<Presence> clients_;
  std::vector<Seat> seats_;            ///< index as clients_
  std::vector<ClientId> controllers_;  ///< index = HandId
  std::vector<HandLimits> limits_;     ///< likewise
  std::vector<double> round_trips_;    ///< [s] likewise
  std::vector<Change> changes_;        ///< pending
  Mentoring mentoring_;
  CommandGate gate_;
  std::vector<ClientId> kicked_;
  AcceptedCommands accepted_;  ///< to the state machine
  std::optional<std::uint32_t> step_;
};

}  // namespace tenon::session
