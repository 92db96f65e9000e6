#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "idl/types/messages.h"

/// All topics: name, message type and quality of service. A new one needs its struct in idl/tenon.idl, its
/// message in idl/types/messages.h, its fields in idl/wire/convert.cpp, one line here and in forEachTopic,
/// and, for a new type, one in TENON_WIRE_MESSAGES.
namespace tenon::wire {

/// How samples of a topic are delivered; idl/wire/profiles.cpp maps it to DDS policies. In lockstep, streams
/// are reliable too.
enum class QosClass {
  kStream,  ///< best effort, keep last 1
  kState,   ///< reliable, keep last 1 per key; late joiners get it (transient local)
  kEvent,   ///< reliable, keep all
};

using Milliseconds = std::chrono::milliseconds;
inline constexpr Milliseconds kNever{0};  ///< the policy is not set

/// DDS policies of a topic that its QoS class does not determine. Readers request the weakest deadline,
/// liveliness and lifespan, so that these never prevent a match. On a lockstep link, which may be slower than
/// real time, deadline, lease by topic and lifespan are not offered.
struct TopicParameters {
  Milliseconds deadline = kNever;  ///< [ms] DEADLINE: longest time between two samples
  Milliseconds lease =
      kNever;  ///< [ms] LIVELINESS lease: without sign of life for so long, the writer's instances end
  bool lease_by_topic =
      false;  ///< MANUAL_BY_TOPIC: only writing this topic renews the lease, so a hung thread is detected
  Milliseconds lifespan = kNever;  ///< [ms] LIFESPAN: older samples are not delivered
  std::uint32_t late_joiner_depth =
      0;  ///< samples per key that a late joiner gets (transient local); 0: none
  bool latched =
      false;  ///< instances outlive their writer; of several writers the latest source timestamp counts
};

/// A topic of messages M.
template <class M>
struct Topic {
  std::string_view name;
  QosClass qos_class = QosClass::kStream;
  TopicParameters parameters;
};

inline constexpr TopicParameters kServerStream{.lease = Milliseconds{1000}};
inline constexpr TopicParameters kLatestPerKey{.late_joiner_depth = 1};
inline constexpr TopicParameters kLog{.late_joiner_depth = 1000};

// ---- session
inline constexpr Topic<SessionAnnounce> kSessionAnnounce{
    "SessionAnnounce", QosClass::kState, {.lease = Milliseconds{2000}, .late_joiner_depth = 1}};
inline constexpr Topic<Join> kJoin{"Join", QosClass::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<Welcome> kWelcome{"Welcome", QosClass::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<Presence> kPresence{
    "Presence", QosClass::kState, {.lease = Milliseconds{2000}, .late_joiner_depth = 1}};

// ---- streams
inline constexpr Topic<DeviceInput> kDeviceInput{
    "DeviceInput",
    QosClass::kStream,
    {.deadline = Milliseconds{10}, .lease = Milliseconds{50}, .lease_by_topic = true}};
inline constexpr Topic<WorldFrame> kWorldFrame1k{"WorldFrame_1k", QosClass::kStream, kServerStream};
inline constexpr Topic<WorldFrame> kWorldFrame100{"WorldFrame_100", QosClass::kStream, kServerStream};
inline constexpr Topic<WorldFrame> kWorldFrame30{"WorldFrame_30", QosClass::kStream, kServerStream};
inline constexpr Topic<HandManifold> kHandManifold{
    "HandManifold", QosClass::kStream, {.deadline = Milliseconds{100}, .lease = Milliseconds{1000}}};
inline constexpr Topic<HandState> kHandState100{
    "HandState_100", QosClass::kStream, {.lease = Milliseconds{1000}}};
inline constexpr Topic<ContactPairs> kContactPairs100{"ContactPairs_100", QosClass::kStream, kServerStream};
inline constexpr Topic<TickStats> kTickStats100{"TickStats_100", QosClass::kStream, kServerStream};
inline constexpr Topic<Guidance> kGuidance{"Guidance", QosClass::kStream, kServerStream};
inline constexpr Topic<ForceContribution> kForceContribution{"ForceContribution", QosClass::kStream, {}};
inline constexpr Topic<ExternalPose> kExternalPose{"ExternalPose", QosClass::kStream, {}};
inline constexpr Topic<ClockSync> kClockSync{"ClockSync", QosClass::kStream, {}};
inline constexpr Topic<Telemetry> kTelemetry{"Telemetry", QosClass::kStream, {}};

// ---- states
inline constexpr Topic<ObjectSnapshot> kObjectSnapshot{"ObjectSnapshot", QosClass::kState, kLatestPerKey};
inline constexpr Topic<SceneObject> kSceneObject{"SceneObject", QosClass::kState, kLatestPerKey};
inline constexpr Topic<StepState> kStepState{"StepState", QosClass::kState, kLatestPerKey};
inline constexpr Topic<StepProgress> kStepProgress{"StepProgress", QosClass::kState, kLatestPerKey};
inline constexpr Topic<RunState> kRunState{"RunState", QosClass::kState, kLatestPerKey};
inline constexpr Topic<GrabState> kGrabState{"GrabState", QosClass::kState, kLatestPerKey};
inline constexpr Topic<RecorderStatus> kRecorderStatus{"RecorderStatus", QosClass::kState, kLatestPerKey};
inline constexpr Topic<EmergencyStop> kEmergencyStop{
    "EmergencyStop", QosClass::kState, {.late_joiner_depth = 1, .latched = true}};

// ---- events
inline constexpr Topic<Command> kCommand{"Command", QosClass::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<CommandAck> kCommandAck{
    "CommandAck", QosClass::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<EventLog> kEventLog{"EventLog", QosClass::kEvent, kLog};
inline constexpr Topic<ClientEvent> kClientEvent{"ClientEvent", QosClass::kEvent, kLog};
inline constexpr Topic<TickInputPart> kTickInput{"TickInput", QosClass::kEvent, {}};
inline constexpr Topic<CheckpointPart> kCheckpoint{"Checkpoint", QosClass::kEvent, {}};

/// Calls visit(topic) for every topic, in a fixed order.
template <class Visit>
void forEachTopic(Visit&& visit) {
  visit(kSessionAnnounce);
  visit(kJoin);
  visit(kWelcome);
  visit(kPresence);
  visit(kDeviceInput);
  visit(kWorldFrame1k);
  visit(kWorldFrame100);
  visit(kWorldFrame30);
  visit(kHandManifold);
  visit(kHandState100);
  visit(kContactPairs100);
  visit(kTickStats100);
  visit(kGuidance);
  visit(kForceContribution);
  visit(kExternalPose);
  visit(kClockSync);
  visit(kTelemetry);
  visit(kObjectSnapshot);
  visit(kSceneObject);
  visit(kStepState);
  visit(kStepProgress);
  visit(kRunState);
  visit(kGrabState);
  visit(kRecorderStatus);
  visit(kEmergencyStop);
  visit(kCommand);
  visit(kCommandAck);
  visit(kEventLog);
  visit(kClientEvent);
  visit(kTickInput);
  visit(kCheckpoint);
}

/// Every message type once: `#define X(M) ...` then `TENON_WIRE_MESSAGES(X)`.
// clang-format off
#define TENON_WIRE_MESSAGES(X) \
  X(SessionAnnounce) X(Join) X(Welcome) X(Presence) X(DeviceInput) X(WorldFrame) X(HandManifold) \
  X(HandState) X(ContactPairs) X(TickStats) X(Guidance) X(ForceContribution) X(ExternalPose) \
  X(ClockSync) X(Telemetry) X(ObjectSnapshot) X(SceneObject) X(StepState) X(StepProgress) \
  X(RunState) X(GrabState) X(RecorderStatus) X(EmergencyStop) X(Command) X(CommandAck) X(EventLog) \
  X(ClientEvent) X(TickInputPart) X(CheckpointPart)
// clang-format on

}  // namespace tenon::wire
