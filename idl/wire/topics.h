#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "idl/types/messages.h"

/// Every topic of Tenon: its name and what it promises. A new one is a struct in idl/tenon.idl, its message
/// in idl/types/messages.h, its fields in idl/wire/convert.h and one line here and in TENON_WIRE_MESSAGES.
namespace tenon {

enum class Promise {
  kStream,  ///< best effort, the newest wins
  kState,   ///< reliable, late joiners get the last of each key
  kEvent,   ///< reliable, each one counts
};

using Milliseconds = std::chrono::milliseconds;
inline constexpr Milliseconds kNever{0};

/// What a promise leaves open. Writers offer these by link profile; readers request the loosest value of
/// each, so a reader never fails to match because of them. On a lockstep link time does not pass by the
/// clock: deadline, lease by topic and lifespan are not offered there.
struct TopicParameters {
  Milliseconds deadline = kNever;  ///< longest silence of a stream's writer
  Milliseconds lease = kNever;     ///< a writer silent for longer is gone, and with it its keys
  bool lease_by_topic = false;     ///< only writing this very topic renews the lease: shows a hung thread
  Milliseconds lifespan = kNever;  ///< older samples are not delivered any more
  std::uint32_t late_joiner_depth = 0;  ///< samples of each key that a late joiner gets; 0: none
  bool latched = false;  ///< stays as it is when a writer goes; of several writers the latest by time counts
};

template <class M>
struct Topic {
  std::string_view name;
  Promise promise = Promise::kStream;
  TopicParameters parameters;
};

inline constexpr TopicParameters kServerStream{.lease = Milliseconds{1000}};
inline constexpr TopicParameters kLastOfEach{.late_joiner_depth = 1};
inline constexpr TopicParameters kLog{.late_joiner_depth = 1000};

// ---- session
inline constexpr Topic<SessionAnnounce> kSessionAnnounce{
    "SessionAnnounce", Promise::kState, {.lease = Milliseconds{2000}, .late_joiner_depth = 1}};
inline constexpr Topic<Join> kJoin{"Join", Promise::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<Welcome> kWelcome{"Welcome", Promise::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<Presence> kPresence{
    "Presence", Promise::kState, {.lease = Milliseconds{2000}, .late_joiner_depth = 1}};

// ---- streams
inline constexpr Topic<DeviceInput> kDeviceInput{
    "DeviceInput",
    Promise::kStream,
    {.deadline = Milliseconds{10}, .lease = Milliseconds{50}, .lease_by_topic = true}};
inline constexpr Topic<WorldFrame> kWorldFrame1k{"WorldFrame_1k", Promise::kStream, kServerStream};
inline constexpr Topic<WorldFrame> kWorldFrame100{"WorldFrame_100", Promise::kStream, kServerStream};
inline constexpr Topic<WorldFrame> kWorldFrame30{"WorldFrame_30", Promise::kStream, kServerStream};
inline constexpr Topic<HandManifold> kHandManifold{
    "HandManifold", Promise::kStream, {.deadline = Milliseconds{100}, .lease = Milliseconds{1000}}};
inline constexpr Topic<HandState> kHandState100{
    "HandState_100", Promise::kStream, {.lease = Milliseconds{1000}}};
inline constexpr Topic<ContactPairs> kContactPairs100{"ContactPairs_100", Promise::kStream, kServerStream};
inline constexpr Topic<TickStats> kTickStats100{"TickStats_100", Promise::kStream, kServerStream};
inline constexpr Topic<Guidance> kGuidance{"Guidance", Promise::kStream, kServerStream};
inline constexpr Topic<ForceContribution> kForceContribution{"ForceContribution", Promise::kStream, {}};
inline constexpr Topic<ExternalPose> kExternalPose{"ExternalPose", Promise::kStream, {}};
inline constexpr Topic<ClockSync> kClockSync{"ClockSync", Promise::kStream, {}};
inline constexpr Topic<Telemetry> kTelemetry{"Telemetry", Promise::kStream, {}};

// ---- states
inline constexpr Topic<ObjectSnapshot> kObjectSnapshot{"ObjectSnapshot", Promise::kState, kLastOfEach};
inline constexpr Topic<SceneObject> kSceneObject{"SceneObject", Promise::kState, kLastOfEach};
inline constexpr Topic<StepState> kStepState{"StepState", Promise::kState, kLastOfEach};
inline constexpr Topic<StepProgress> kStepProgress{"StepProgress", Promise::kState, kLastOfEach};
inline constexpr Topic<RunState> kRunState{"RunState", Promise::kState, kLastOfEach};
inline constexpr Topic<GrabState> kGrabState{"GrabState", Promise::kState, kLastOfEach};
inline constexpr Topic<RecorderStatus> kRecorderStatus{"RecorderStatus", Promise::kState, kLastOfEach};
inline constexpr Topic<EmergencyStop> kEmergencyStop{
    "EmergencyStop", Promise::kState, {.late_joiner_depth = 1, .latched = true}};

// ---- events
inline constexpr Topic<Command> kCommand{"Command", Promise::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<CommandAck> kCommandAck{
    "CommandAck", Promise::kEvent, {.lifespan = Milliseconds{5000}}};
inline constexpr Topic<EventLog> kEventLog{"EventLog", Promise::kEvent, kLog};
inline constexpr Topic<ClientEvent> kClientEvent{"ClientEvent", Promise::kEvent, kLog};
inline constexpr Topic<TickInputPart> kTickInput{"TickInput", Promise::kEvent, {}};
inline constexpr Topic<CheckpointPart> kCheckpoint{"Checkpoint", Promise::kEvent, {}};

/// Calls visit(topic) for every topic: recorders and replays take them all.
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

}  // namespace tenon
