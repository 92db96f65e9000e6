#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "idl/wire/endpoint.h"
#include "tests/idl/wire/peer.h"

namespace tenon::test {

/// A client that says what the test tells it, and keeps what it hears.
///
/// Threads: one.
class ScriptedClient {
 public:
  ScriptedClient(std::string session, LinkProfile profile)
      : bus_(participant(ownDomain(), profile)),
        lobby_(bus_, kLobby, LinkProfile::kLan),
        room_(bus_, sessionPartition(std::move(session))),
        joins_(Writer<Join>::open(lobby_, kJoin).value()),
        inputs_(Writer<DeviceInput>::open(room_, kDeviceInput).value()),
        commands_(Writer<Command>::open(room_, kCommand).value()),
        stops_(Writer<EmergencyStop>::open(room_, kEmergencyStop).value()),
        presence_(Writer<Presence>::open(room_, kPresence).value()) {
    keep(lobby_, kSessionAnnounce, [this](const SessionAnnounce& announced) { announce = announced; });
    keep(lobby_, kWelcome, [this](const Welcome& answer) {
      if (answer.client_guid == guid_) welcome = answer;
    });
    keep(room_, kHandManifold, [this](const HandManifold& manifold) {
      if (manifold.hand == moved()) newest = manifold, ++manifolds;
    });
    keep(room_, kCommandAck, [this](const CommandAck& answer) {
      if (answer.client == welcome.client) ack = answer;
    });
    keep(room_, kRunState, [this](const RunState& state) { run = state; });
    keep(room_, kEventLog, [this](const EventLog& event) { events.push_back(event); });
  }

  [[nodiscard]] bool hears(const std::function<bool()>& done) { return dispatchUntil(inbox_, done); }
  void listen(std::chrono::milliseconds timeout) { inbox_.dispatch(timeout); }

  /// False when no answer came.
  [[nodiscard]] bool join(const std::string& guid, Role role, const std::vector<std::string>& hands,
                          const std::string& token = {}) {
    guid_ = guid;
    const auto linked = [this] {
      return joins_.matchedReaders() > 0 && stops_.matchedReaders() > 0 && inputs_.matchedReaders() > 0 &&
             commands_.matchedReaders() > 0 && announce.server_epoch != 0;
    };
    if (!hears(linked)) return false;
    (void)joins_.write({.client_guid = guid, .name = guid, .role = role, .hands = hands, .token = token});
    if (!hears([this] { return welcome.client_guid == guid_; })) return false;
    if (welcome.accepted) (void)presence_.write({welcome.client, guid, role, welcome.hands, true});
    return true;
  }
  /// As its own hand, unless the test says otherwise.
  void sendPose(std::uint32_t seq, const Pose& X_WH, HandId hand = {}) {
    DeviceInput input{.hand = hand.valid() ? hand : moved(),
                      .client = welcome.client,
                      .server_epoch = welcome.server_epoch,
                      .active = true};
    input.samples[0] = {.seq = seq, .X_WH = X_WH};
    (void)inputs_.write(input);
  }
  void emergencyStop(bool engaged) { (void)stops_.write({engaged, guid_, "a test"}); }
  /// In the name of whom `welcome` is of.
  void sayGoodBye() {
    (void)presence_.write({.client = welcome.client, .name = guid_});
    (void)presence_.dispose({.client = welcome.client});
  }
  void command(CommandKind kind) { (void)commands_.write({welcome.client, ++commands_sent_, kind}); }

  [[nodiscard]] HandId moved() const { return welcome.hands.empty() ? HandId{} : welcome.hands[0]; }
  [[nodiscard]] bool heard(const std::string& kind, const std::string& part_of_text) const {
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
  void keep(Partition& partition, const Topic<M>& topic, Handler handler) {
    if (auto heard = inbox_.on<M>(partition, topic, handler); !heard)
      throw std::runtime_error(heard.error().what);
  }

  std::shared_ptr<Participant> bus_;
  Partition lobby_;
  Partition room_;
  Writer<Join> joins_;
  Writer<DeviceInput> inputs_;
  Writer<Command> commands_;
  Writer<EmergencyStop> stops_;
  Writer<Presence> presence_;
  Inbox inbox_;
  std::string guid_;
  std::uint32_t commands_sent_ = 0;
};

}  // namespace tenon::test
