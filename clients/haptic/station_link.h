#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "idl/types/messages/hands.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/timing.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/membership.h"

namespace tenon::haptic {

/// DDS endpoints of a station: its seat in a session, the scene, one inbox and the writers.
///
/// Threads: one (wire). Real-time: no.
class StationLink {
 public:
  using Stop = wire::Membership::Stop;

  /// Joins a session and reads its scene, which is complete with as many objects as the server announces.
  /// Fails when no server is found in time, the server refuses, objects are missing after
  /// `options.timeout` (which, the error says), or `stop` is set.
  static Result<std::unique_ptr<StationLink>> open(const wire::MembershipOptions& options, const Stop& stop);

  [[nodiscard]] wire::Membership& member() { return *member_; }
  [[nodiscard]] const Welcome& welcome() const { return member_->welcome(); }
  [[nodiscard]] const std::vector<SceneObject>& objects() const { return objects_; }
  [[nodiscard]] wire::Inbox& inbox() { return inbox_; }
  /// Waits until the endpoints of server and station have matched, for up to 5 s; call it after all
  /// subscriptions. Calls `meanwhile` every 5 ms.
  [[nodiscard]] Result<void> awaitMatch(const Stop& stop, const std::function<void()>& meanwhile = {});
  [[nodiscard]] Result<void> send(const DeviceInput& input) { return inputs_->write(input); }
  [[nodiscard]] Result<void> send(const HandState& state) { return states_->write(state); }
  [[nodiscard]] Result<void> send(const ClientEvent& event) { return events_->write(event); }
  [[nodiscard]] Result<void> send(const Telemetry& telemetry) { return telemetry_->write(telemetry); }
  [[nodiscard]] Result<void> send(const ClockSync& request) { return clock_->write(request); }
  /// A raise of the emergency stop that this station obeys: repeated for servers and stations that come
  /// later.
  [[nodiscard]] Result<void> send(const EmergencyStop& stop) { return stops_->write(stop); }
  /// It is cleared: not repeated any more.
  [[nodiscard]] Result<void> withdraw(const EmergencyStop& stop) { return stops_->dispose(stop); }

 private:
  StationLink() = default;
  Result<void> openWriters();
  Result<void> readScene(const wire::MembershipOptions& options, const Stop& stop);

  std::unique_ptr<wire::Membership> member_;
  std::vector<SceneObject> objects_;
  std::unique_ptr<wire::Writer<DeviceInput>> inputs_;
  std::unique_ptr<wire::Writer<HandState>> states_;
  std::unique_ptr<wire::Writer<ClientEvent>> events_;
  std::unique_ptr<wire::Writer<Telemetry>> telemetry_;
  std::unique_ptr<wire::Writer<ClockSync>> clock_;
  std::unique_ptr<wire::Writer<EmergencyStop>> stops_;
  wire::Inbox inbox_;
};

}  // namespace tenon::haptic
