#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/messages.h"
#include "idl/wire/endpoint.h"

namespace tenon {

struct LinkWishes {
  std::string session;  ///< empty: the first one announced
  std::uint32_t domain = 0;
  std::string person = "somebody";
  Role role = Role::kObserver;
  std::vector<std::string> hands;
  std::chrono::seconds patience{10};  ///< for a server to be found and to answer
};

/// A client's place in a session: finds the server in the lobby, joins, and holds what it hears and says
/// there with.
///
/// Threads: one (wire). Real-time: no.
class SessionLink {
 public:
  /// Fails with a sentence when no server is found in time, or it refuses, or `stop` is set.
  static Result<std::unique_ptr<SessionLink>> join(const LinkWishes& wishes, const std::atomic<bool>& stop);
  ~SessionLink();

  [[nodiscard]] const Welcome& welcome() const { return welcome_; }
  [[nodiscard]] const std::vector<SceneObject>& objects() const { return objects_; }
  [[nodiscard]] Partition& session() { return *session_; }
  [[nodiscard]] Partition& lobby() { return *lobby_; }
  [[nodiscard]] const std::string& sessionName() const { return announce_.session; }
  [[nodiscard]] Inbox& inbox() { return inbox_; }
  /// Waits until the server hears this client; call it when all topics are subscribed.
  [[nodiscard]] Result<void> settle(const std::atomic<bool>& stop);
  [[nodiscard]] Result<void> send(const DeviceInput& input) { return inputs_->write(input); }
  [[nodiscard]] Result<void> send(const HandState& state) { return states_->write(state); }
  [[nodiscard]] Result<void> send(const ClientEvent& event) { return events_->write(event); }
  [[nodiscard]] Result<void> send(const Telemetry& telemetry) { return telemetry_->write(telemetry); }

 private:
  SessionLink() = default;
  Result<void> findSession(const LinkWishes& wishes, const std::atomic<bool>& stop);
  Result<void> ask(const LinkWishes& wishes, const std::atomic<bool>& stop);
  Result<void> openSession(const LinkWishes& wishes);

  std::shared_ptr<Participant> participant_;
  std::unique_ptr<Partition> lobby_;
  std::unique_ptr<Partition> session_;
  SessionAnnounce announce_;
  Welcome welcome_;
  Presence presence_;
  std::vector<SceneObject> objects_;
  std::unique_ptr<Writer<Presence>> presence_writer_;
  std::unique_ptr<Writer<DeviceInput>> inputs_;
  std::unique_ptr<Writer<HandState>> states_;
  std::unique_ptr<Writer<ClientEvent>> events_;
  std::unique_ptr<Writer<Telemetry>> telemetry_;
  Inbox inbox_;
};

}  // namespace tenon
