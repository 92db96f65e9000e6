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
#include "idl/wire/endpoint.h"
#include "tests/idl/wire/peer.h"

namespace tenon::test {

/// A client whose samples are sent by the test; it keeps what it receives.
///
/// Threads: one.
class ScriptedClient {
 public:
  ScriptedClient(std::string session, wire::LinkProfile profile)
      : bus_(participant(ownDomain(), profile)),
        lobby_(bus_, wire::kLobby, wire::LinkProfile::kLan),
        session_(bus_, wire::sessionPartition(std::move(session))),
        joins_(wire::Writer<Join>::open(lobby_, wire::kJoin).value()),
        inputs_(wire::Writer<DeviceInput>::open(session_, wire::kDeviceInput).value()),
        commands_(wire::Writer<Command>::open(session_, wire::kCommand).value()),
        stops_(wire::Writer<EmergencyStop>::open(session_, wire::kEmergencyStop).value()),
        presence_(wire::Writer<Presence>::open(session_, wire::kPresence).value()) {
    subscribe(lobby_, wire::kSessionAnnounce,
              [this](const SessionAnnounce& announced) { announce = announced; });
    subscribe(lobby_, wire::kWelcome, [this](const Welcome& answer) {
      if (answer.client_guid == guid_) welcome = answer;
    });
    subscribe(session_, wire::kHandManifold, [this](const HandManifold& manifold) {
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

  /// False when no answer came within a minute.
  [[nodiscard]] bool join(const std::string& guid, Role role, const std::vector<std::string>& hands,
                          const std::string& token = {}) {
    guid_ = guid;
    const auto matched = [this] {
      return joins_.matchedReaders() > 0 && stops_.matchedReaders() > 0 && inputs_.matchedReaders() > 0 &&
             commands_.matchedReaders() > 0 && announce.server_epoch != 0;
    };
    if (!receivesUntil(matched)) return false;
    (void)joins_.write({.client_guid = guid, .name = guid, .role = role, .hands = hands, .token = token});
    if (!receivesUntil([this] { return welcome.client_guid == guid_; })) return false;
    if (welcome.accepted) (void)presence_.write({welcome.client, guid, role, welcome.hands, true});
    return true;
  }
  /// DeviceInput of `hand`, by default of the first hand it controls.
  void sendPose(std::uint32_t seq, const Pose& X_WH, HandId hand = {}) {
    DeviceInput input{.hand = hand.valid() ? hand : controlledHand(),
                      .client = welcome.client,
                      .server_epoch = welcome.server_epoch,
                      .active = true};
    input.samples[0] = {.seq = seq, .X_WH = X_WH};
    (void)inputs_.write(input);
  }
  void emergencyStop(bool engaged) { (void)stops_.write({engaged, guid_, "a test"}); }
  /// Disposes the presence of the client that `welcome` names.
  void sendDeparture() {
    (void)presence_.write({.client = welcome.client, .name = guid_});
    (void)presence_.dispose({.client = welcome.client});
  }
  void command(CommandKind kind) { (void)commands_.write({welcome.client, ++commands_sent_, kind}); }

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

 private:
  template <class M, class Handler>
  void subscribe(wire::Partition& partition, const wire::Topic<M>& topic, Handler handler) {
    if (auto added = inbox_.on<M>(partition, topic, handler); !added)
      throw std::runtime_error(added.error().what);
  }

  std::shared_ptr<wire::Participant> bus_;
  wire::Partition lobby_;
  wire::Partition session_;
  wire::Writer<Join> joins_;
  wire::Writer<DeviceInput> inputs_;
  wire::Writer<Command> commands_;
  wire::Writer<EmergencyStop> stops_;
  wire::Writer<Presence> presence_;
  wire::Inbox inbox_;
  std::string guid_;
  std::uint32_t commands_sent_ = 0;
};

}  // namespace tenon::test
