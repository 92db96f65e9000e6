#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/stop_truth.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/identity.h"
#include "tests/idl/wire/peer.h"

namespace tenon::test {

/// The key of the sessions of tests.
inline const wire::SharedKey kTestKey{{1, 2, 3}};

/// A client whose samples are sent by the test; it keeps what it receives. Its raises of the emergency stop
/// have its guid and count from 1.
///
/// Threads: one.
class ScriptedClient {
 public:
  ScriptedClient(const std::string& session, wire::LinkProfile profile)
      : bus_(participant(ownDomain(), profile)),
        lobby_(bus_, wire::kLobby, wire::LinkProfile::kLan),
        session_(bus_, wire::sessionPartition(session)),
        everything_(bus_, wire::sessionPartition(session), profile, wire::handPartitions(session)),
        joins_(wire::Writer<Join>::open(lobby_, wire::kJoin).value()),
        inputs_(wire::Writer<DeviceInput>::open(session_, wire::kDeviceInput).value()),
        commands_(wire::Writer<Command>::open(session_, wire::kCommand).value()),
        stops_(wire::Writer<EmergencyStop>::open(session_, wire::kEmergencyStop).value()),
        presence_(wire::Writer<Presence>::open(session_, wire::kPresence).value()) {
    subscribe(lobby_, wire::kSessionAnnounce,
              [this](const SessionAnnounce& announced) { announce = announced; });
    subscribe(lobby_, wire::kWelcome, [this](const Welcome& answer) {
      if (answer.client_guid == "elsewhere") ++answers_to_others;
      if (answer.client_guid != guid_) return;
      welcome = answer;
      if (!answer.challenge.empty() && join_.seat_proof.empty()) prove(answer.challenge);
    });
    subscribe(session_, wire::kEmergencyStop, [this](const EmergencyStop& stop) { stops.raise(stop); });
    subscribe(session_, wire::kEmergencyClear,
              [this](const EmergencyClear& cleared) { stops.clear(cleared); });
    subscribe(session_, wire::kNewestRaise, [this](const NewestRaise& raise) { newest_raise = raise; });
    subscribe(everything_, wire::kHandManifold, [this](const HandManifold& manifold) {
      if (manifold.hand == controlledHand()) newest = manifold, ++manifolds;
    });
    subscribe(session_, wire::kCommandAck, [this](const CommandAck& answer) {
      if (answer.client == welcome.client) ack = answer;
    });
    subscribe(session_, wire::kRunState, [this](const RunState& state) { run = state; });
    subscribe(session_, wire::kEventLog, [this](const EventLog& event) { events.push_back(event); });
  }

  [[nodiscard]] bool receivesUntil(const std::function<bool()>& done) { return dispatchUntil(inbox_, done); }
  void dispatch(std::chrono::milliseconds timeout) { inbox_.dispatch(timeout); }

  /// False when no answer came within a minute. Proves that it has `seat` and `key`.
  [[nodiscard]] bool join(const std::string& guid, Role role, const std::vector<std::string>& hands,
                          const wire::SeatKey& seat = wire::SeatKey::random(),
                          const wire::SharedKey& key = kTestKey) {
    guid_ = guid;
    const auto matched = [this] {
      return joins_.matchedReaders() > 0 && stops_.matchedReaders() > 0 && inputs_.matchedReaders() > 0 &&
             commands_.matchedReaders() > 0 && announce.server_epoch != 0;
    };
    if (!receivesUntil(matched)) return false;
    seat_ = seat;
    key_ = key;
    join_ = {.client_guid = guid,
             .session = announce.session,
             .server_epoch = announce.server_epoch,
             .name = guid,
             .role = role,
             .hands = hands,
             .seat_key = claimed_.empty() ? seat.publicKey() : claimed_};
    (void)joins_.write(join_);
    if (!receivesUntil([this] { return welcome.client_guid == guid_ && welcome.challenge.empty(); }))
      return false;
    if (welcome.accepted && says_presence)
      (void)presence_.write({welcome.client, guid, role, welcome.hands, true});
    return true;
  }
  /// Claims a seat by its public key, with a proof by another secret.
  [[nodiscard]] bool joinWithSeatOf(const std::string& guid, const std::string& public_key,
                                    const std::vector<std::string>& hands) {
    claimed_ = public_key;
    const bool answered = join(guid, Role::kTrainee, hands);
    claimed_.clear();
    return answered;
  }
  void ask(const Join& join) { (void)joins_.write(join); }
  /// As a program does that has not heard the answer.
  void repeatJoin() { (void)joins_.write(join_); }
  /// DeviceInput of `hand`, by default of the first hand it controls.
  void sendPose(std::uint32_t seq, const Pose& X_WH, HandId hand = {}) {
    DeviceInput input{.hand = hand.valid() ? hand : controlledHand(),
                      .client = welcome.client,
                      .server_epoch = welcome.server_epoch,
                      .active = true};
    input.sample = {.seq = seq, .X_WH = X_WH};
    (void)inputs_.write(input);
  }
  void emergencyStop() { (void)stops_.write({guid_, ++raises_, guid_, "a test"}); }
  /// Disposes the presence of the client that `welcome` names.
  void sendDeparture() {
    (void)presence_.write({.client = welcome.client, .name = guid_});
    (void)presence_.dispose({.client = welcome.client});
  }
  void command(CommandKind kind) { (void)commands_.write({welcome.client, ++commands_sent_, kind}); }
  /// As one who was told of raises up to this number; its id is counted with those of command().
  void clearStop(std::uint32_t raise) {
    Command clear{welcome.client, ++commands_sent_, CommandKind::kClearEmergencyStop};
    clear.value = raise;
    (void)commands_.write(clear);
  }

  [[nodiscard]] HandId controlledHand() const { return welcome.hands.empty() ? HandId{} : welcome.hands[0]; }
  [[nodiscard]] bool received(const std::string& kind, const std::string& part_of_text) const {
    for (const EventLog& event : events)
      if (event.kind == kind && event.text.find(part_of_text) != std::string::npos) return true;
    return false;
  }

  SessionAnnounce announce;
  Welcome welcome;
  HandManifold newest;
  int manifolds = 0;
  CommandAck ack;
  RunState run;
  std::vector<EventLog> events;
  StopTruth stops;
  NewestRaise newest_raise;
  bool says_presence = true;  ///< once it has a seat
  int answers_to_others = 0;  ///< to the client_guid "elsewhere"

 private:
  void prove(const std::string& challenge) {
    const wire::ProofSubject subject{.challenge = challenge,
                                     .session = join_.session,
                                     .server_epoch = join_.server_epoch,
                                     .client_guid = join_.client_guid,
                                     .role = join_.role,
                                     .client = bus_->origin()};
    join_.seat_proof = seat_.proofOf(subject);
    join_.key_proof = key_.proofOf(subject);
    (void)joins_.write(join_);
  }
  template <class M, class Handler>
  void subscribe(wire::Partition& partition, const wire::Topic<M>& topic, Handler handler) {
    if (auto added = inbox_.on<M>(partition, topic, handler); !added)
      throw std::runtime_error(added.error().what);
  }

  std::shared_ptr<wire::Participant> bus_;
  wire::Partition lobby_;
  wire::Partition session_;
  wire::Partition everything_;  ///< to read contacts of all hands, too
  wire::Writer<Join> joins_;
  wire::Writer<DeviceInput> inputs_;
  wire::Writer<Command> commands_;
  wire::Writer<EmergencyStop> stops_;
  wire::Writer<Presence> presence_;
  wire::Inbox inbox_;
  std::string guid_;
  Join join_;
  std::string claimed_;
  wire::SeatKey seat_;
  wire::SharedKey key_;
  std::uint32_t commands_sent_ = 0;
  std::uint32_t raises_ = 0;
};

}  // namespace tenon::test
