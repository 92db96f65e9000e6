#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/messages/objects.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "tests/idl/wire/peer.h"

namespace tenon::test {

/// The scene's side of a server: announces a session "test" of `size`, gives everybody a seat with the same
/// `hands`, receives no inputs, and sends of its scene what it is told to.
///
/// Threads: one.
class FakeSession {
 public:
  FakeSession(std::uint32_t domain, SessionAnnounce size, std::vector<HandId> hands = {})
      : bus_(participant(domain)),
        lobby_(bus_, wire::kLobby),
        session_(bus_, wire::sessionPartition("test")),
        announces_(wire::Writer<SessionAnnounce>::open(lobby_, wire::kSessionAnnounce).value()),
        welcomes_(wire::Writer<Welcome>::open(lobby_, wire::kWelcome).value()),
        objects_(wire::Writer<SceneObject>::open(session_, wire::kSceneObject).value()),
        hands_(wire::Writer<SceneHand>::open(session_, wire::kSceneHand).value()),
        steps_(wire::Writer<StepState>::open(session_, wire::kStepState).value()) {
    size.session = "test";
    size.server_epoch = 7;
    EXPECT_TRUE(announces_.write(size));
    EXPECT_TRUE(inbox_.on<Join>(lobby_, wire::kJoin, [this, hands = std::move(hands)](const Join& join) {
      (void)welcomes_.write({.client_guid = join.client_guid,
                             .session = join.session,
                             .server_epoch = 7,
                             .accepted = true,
                             .client = ClientId{1},
                             .hands = hands,
                             .people = 1});
      joined_ = true;
    }));
  }
  void sendObject(std::uint32_t id) {
    EXPECT_TRUE(objects_.write({.object = ObjectId{id}, .name = "object " + std::to_string(id)}));
  }
  void sendHand(std::uint32_t id) {
    EXPECT_TRUE(hands_.write({.hand = HandId{id}, .name = "hand " + std::to_string(id)}));
  }
  void sendStep() { EXPECT_TRUE(steps_.write({.revision = 1})); }
  void serve(std::chrono::milliseconds time) {
    const auto until = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < until) inbox_.dispatch(std::chrono::milliseconds(5));
  }
  /// Serves until `done`; false after a minute.
  bool serveUntil(const std::function<bool()>& done) { return dispatchUntil(inbox_, done); }
  [[nodiscard]] bool joined() const { return joined_; }
  /// To write in the name of the server.
  [[nodiscard]] const std::shared_ptr<wire::Participant>& bus() const { return bus_; }
  [[nodiscard]] wire::Partition& session() { return session_; }

 private:
  std::shared_ptr<wire::Participant> bus_;
  wire::Partition lobby_, session_;
  wire::Writer<SessionAnnounce> announces_;
  wire::Writer<Welcome> welcomes_;
  wire::Writer<SceneObject> objects_;
  wire::Writer<SceneHand> hands_;
  wire::Writer<StepState> steps_;
  wire::Inbox inbox_;
  bool joined_ = false;
};

}  // namespace tenon::test
