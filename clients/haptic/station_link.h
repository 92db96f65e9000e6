#pragma once

#include <memory>
#include <vector>

#include "idl/types/messages.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/membership.h"

namespace tenon {

/// A station's seat in a session, with the scene it was told of and what it hears and says there with.
///
/// Threads: one (wire). Real-time: no.
class StationLink {
 public:
  using Stop = Membership::Stop;

  /// Joins. Fails with a sentence when no server is found in time, or it refuses, or `stop` is set.
  static Result<std::unique_ptr<StationLink>> open(const MembershipWishes& wishes, const Stop& stop);

  [[nodiscard]] Membership& member() { return *member_; }
  [[nodiscard]] const Welcome& welcome() const { return member_->welcome(); }
  [[nodiscard]] const std::vector<SceneObject>& objects() const { return objects_; }
  [[nodiscard]] Inbox& inbox() { return inbox_; }
  /// Waits until the server hears this client; call it when all topics are subscribed.
  [[nodiscard]] Result<void> settle(const Stop& stop);
  [[nodiscard]] Result<void> send(const DeviceInput& input) { return inputs_->write(input); }
  [[nodiscard]] Result<void> send(const HandState& state) { return states_->write(state); }
  [[nodiscard]] Result<void> send(const ClientEvent& event) { return events_->write(event); }
  [[nodiscard]] Result<void> send(const Telemetry& telemetry) { return telemetry_->write(telemetry); }

 private:
  StationLink() = default;
  Result<void> openWriters();
  Result<void> readScene(const MembershipWishes& wishes);

  std::unique_ptr<Membership> member_;
  std::vector<SceneObject> objects_;
  std::unique_ptr<Writer<DeviceInput>> inputs_;
  std::unique_ptr<Writer<HandState>> states_;
  std::unique_ptr<Writer<ClientEvent>> events_;
  std::unique_ptr<Writer<Telemetry>> telemetry_;
  Inbox inbox_;
};

}  // namespace tenon
