#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "idl/types/spatial.h"

/// The messages of the protocol as C++ types, in the order of `idl/tenon.idl`, their form on the network.
/// `idl/wire/convert.h` maps between the two without loss of a bit. SI units; frames as in the glossary.
/// Streams have a fixed size and may be filled in a 1 kHz loop; states and events contain strings, which
/// allocate.
namespace tenon {

inline constexpr std::uint32_t kProtocolVersion = 2;

enum class Role : std::uint32_t { kAdmin, kInstructor, kTrainee, kObserver, kRecorder };

// ---------------------------------------------------------------------------------------- session

/// Published by each server in the lobby partition: the session it runs.
struct SessionAnnounce {
  std::string session;  ///< its name, by which clients choose it
  std::string title;    ///< of the scenario
  std::uint32_t protocol_version = kProtocolVersion;
  std::uint32_t server_epoch = 0;  ///< larger at each start of a server
  bool lockstep = false;
  std::uint32_t asset_port = 0;         ///< reserved, 0
  std::string scenario_hash;            ///< of the scenario's text, for recordings
  std::vector<std::string> free_hands;  ///< names of hands that no client controls
};

/// A client's request for a seat in the session, in the lobby partition; repeated until it is answered.
struct Join {
  std::string client_guid;  ///< random, chosen by the client; identifies it until it has a ClientId
  std::string name;         ///< of the person or station, for display
  Role role = Role::kObserver;
  std::vector<std::string> hands;  ///< names of the scenario's hands it wants to control
  std::string token;               ///< of an earlier Welcome, to get the same ClientId again; or empty
  std::uint32_t protocol_version = kProtocolVersion;
};

/// The server's answer to a Join, and later the notice that a client has lost its seat.
struct Welcome {
  std::string client_guid;  ///< of the Join
  bool accepted = false;
  std::string reason;         ///< of the refusal; empty when accepted
  ClientId client;            ///< valid though not accepted: this client has lost its seat
  std::vector<HandId> hands;  ///< in the order of Join::hands; invalid for one the scenario does not have
  std::string token;          ///< secret: whoever has it may take the seat again
  std::uint32_t server_epoch = 0;
  Tick tick = 0;  ///< newest of the server; in lockstep the first input is for the next one
  bool lockstep = false;
};

/// A client that has a seat. Published by the client; disposed, or lost with its writer, when it leaves.
struct Presence {
  ClientId client;
  std::string name;
  Role role = Role::kObserver;
  std::vector<HandId> hands;
  bool alive = true;
};

// ---------------------------------------------------------------------------------------- streams

/// A device pose, mapped to the world by the client.
struct DeviceSample {
  std::uint32_t seq = 0;  ///< counts the client's ticks from 1; in lockstep the server tick it is for
  Pose X_WH;
  Twist V_WH;                 ///< [m/s], [rad/s], in W
  std::uint32_t buttons = 0;  ///< bit 0: the main switch
};

/// Sensed and driven axes of a device: bits 0..2 translation along x, y, z; 3..5 rotation about them.
inline constexpr std::uint32_t kAllDofs = 0x3F;
inline constexpr std::uint32_t kTranslationDofs = 0x07;

/// Pose of one hand's device, from its station to the server in every client tick.
struct DeviceInput {
  HandId hand;
  ClientId client;
  std::uint32_t server_epoch = 0;
  Tick heard_tick = 0;  ///< newest server tick the client had received
  std::uint32_t dof_mask = kAllDofs;
  bool active = false;                  ///< false: the station's safety layer holds this device still
  Vector3 p_WC = Vector3::Zero();       ///< [m] C_w, centre of the client's workspace (paper eq. 1)
  std::array<DeviceSample, 4> samples;  ///< newest first; the older three are repeated in case they were lost
};

struct ObjectState {
  ObjectId object;
  std::uint32_t epoch = 0;  ///< increased with every jump of the pose, which displays must not interpolate
  Pose X_WO;
  Eigen::Matrix<float, 6, 1> V_WO =
      Eigen::Matrix<float, 6, 1>::Zero();  ///< linear [m/s], angular [rad/s], in W
  HandId holder;                           ///< invalid when no hand holds it
  std::uint8_t status = 0;                 ///< ObjectStatus
  bool in_contact = false;
};

enum class ObjectStatus : std::uint8_t {
  kHidden,   ///< not in the scene: neither displayed nor in collisions
  kParked,   ///< kinematic and at rest, collides
  kHeld,     ///< moved by a hand through its coupling, subject to contacts
  kTracked,  ///< kinematic: has the pose of its tracker whatever it touches (forearm, head)
  kFixed,    ///< mounted
  kFree,     ///< dynamic: moves by gravity and contact forces
};

inline constexpr int kStatesPerFrame = 12;

/// Object states at one tick, in numbered parts; in lockstep all objects, else moved and some other ones.
struct WorldFrame {
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  std::uint32_t step_revision = 0;  ///< of the StepState this frame belongs to
  FixedVector<ObjectState, kStatesPerFrame> states;
};

inline constexpr int kManifoldContacts = 16;

/// A contact of the held body B with another body A, as a half-space fixed in A: B is admissible while
/// normal_A · p_AoP_A >= offset for its contact point P.
struct ManifoldContact {
  ObjectId other;
  Vector3f p_BoP_B = Vector3f::Zero();   ///< [m] contact point P, fixed in B
  Vector3f normal_A = Vector3f::Zero();  ///< unit normal, away from A
  float offset = 0.0F;                   ///< [m] of the plane from A's origin, along the normal
  float gap = 0.0F;  ///< [m] at the manifold's tick, signed, measured from the dilated surface
  Vector3f velocity_W = Vector3f::Zero();  ///< [m/s] of the point of A that coincides with P, in W
};

/// The coupling of another hand that holds the same object.
struct HandPull {
  HandId hand;
  Pose X_WG;                          ///< goal pose of the object for that hand
  Vector3 p_BoC_B = Vector3::Zero();  ///< [m] the point of the object that it holds
  double stiffness = 0.0;             ///< [N/m]
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
};

inline constexpr int kOtherPulls = 2;

/// All contacts of the object that one hand holds, with what its station needs to render their force locally.
struct HandManifold {
  HandId hand;
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  std::uint32_t answers_seq = 0;  ///< DeviceSample::seq of the newest sample the server had used
  ObjectId object;                ///< that this hand holds; invalid for none
  std::uint32_t object_epoch = 0;
  Pose X_HO;               ///< of the grasp, constant while it is held
  Pose X_WO;               ///< proxy pose (god object)
  Wrench F_Ho_W;           ///< wrench of the coupling on the hand, about its origin, computed by the server
  double stiffness = 0.0;  ///< [N/m] of the coupling
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
  double validity_radius =
      0.0;  ///< [m] displacement of the object's points within which no unlisted contact can occur
  std::uint32_t step_revision = 0;
  bool frozen = false;  ///< the object is held still: stale input, pause or emergency stop
  FixedVector<HandPull, kOtherPulls> others;  ///< other hands that hold the object, by HandId
  FixedVector<ManifoldContact, kManifoldContacts> contacts;
};

/// What a station displays to one hand, for observers and recordings.
struct HandState {
  HandId hand;
  std::uint32_t seq = 0;  ///< of the client tick, as DeviceSample::seq
  Pose X_WH;
  Vector3 p_WC = Vector3::Zero();         ///< [m] as in DeviceInput
  Pose X_WO_local;                        ///< proxy pose of the local model; not used by the simulation
  Wrench F_Ho_W;                          ///< wrench displayed on the hand, about its origin
  std::uint32_t manifold_age = 0;         ///< [ticks] since its manifold was received
  std::uint32_t safety_flags = 0;         ///< bit per active rule of devices/safety.h
  bool indexing = false;                  ///< the centre of the workspace is moving (paper eq. 1)
  std::array<std::uint8_t, 6> tactors{};  ///< intensities of a vibrotactile bracelet, 0..255
};

/// Contact state of a collision pair.
struct PairContact {
  ObjectId a;           ///< pointshell side
  ObjectId b;           ///< SDF side
  bool enabled = true;  ///< takes part in collisions
  bool colliding = false;
  std::uint32_t contacts = 0;      ///< listed points that touch
  Wrench F_Ao_W;                   ///< wrench of b on a, about a's origin
  Vector3 p_WP = Vector3::Zero();  ///< [m] mean of the contact points
  double depth = 0.0;         ///< [m] penetration depth of the deepest point, without dilation, 0 when apart
  double gap = 0.0;           ///< [m] smallest signed gap to the dilated surface
  double load_percent = 0.0;  ///< [%] computational load (paper eq. 2)
  double peak_force = 0.0;    ///< [N] since the last sample of this topic
  double peak_depth = 0.0;    ///< [m] since the last sample of this topic
};

inline constexpr int kPairsPerSample = 6;

/// Pairs that touched since the last sample and some others round robin, in numbered parts.
struct ContactPairs {
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  Tick tick = 0;
  FixedVector<PairContact, kPairsPerSample> pairs;
};

/// Work and timing of the server. Maxima are over the ticks since the last sample.
struct TickStats {
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  double load_percent = 0.0;         ///< [%] maximum over the active pairs
  double compute_seconds = 0.0;      ///< [s] of this tick
  double compute_seconds_max = 0.0;  ///< [s] maximum
  std::uint64_t late_ticks = 0;      ///< since the start of the server
  std::uint32_t active_pairs = 0;    ///< maximum
  std::uint32_t queried_pairs = 0;   ///< maximum
  std::uint64_t points_visited = 0;  ///< maximum
  double input_age_seconds = 0.0;    ///< [s] of the oldest device sample in use, maximum
  std::uint64_t state_hash = 0;      ///< after this tick
};

/// Virtual fixture that guides a hand.
struct Guidance {
  HandId hand;
  Tick tick = 0;
  bool active = false;
  Pose X_WF;               ///< pose of the fixture
  double stiffness = 0.0;  ///< [N/m]
  double damping = 0.0;    ///< [Ns/m]
};

/// External wrench on an object.
struct ForceContribution {
  std::uint32_t source = 0;  ///< its cell of the force accumulator
  ClientId client;
  ObjectId object;
  Wrench F_Oo_W;
  std::uint32_t lifetime_ticks = 0;  ///< [ticks] after which it is 0 unless repeated
};

/// Pose of an object as an external tracker measured it.
struct ExternalPose {
  ObjectId object;
  ClientId client;
  Pose X_WO;
  std::uint32_t lifetime_ticks = 0;  ///< [ticks] reserved
};

/// Time stamps of a request to the server and of its answer, each of the sender's own monotonic clock.
struct ClockSync {
  ClientId client;
  std::int64_t sent_ns = 0;             ///< [ns] by the client
  std::int64_t server_received_ns = 0;  ///< [ns] by the server
  std::int64_t server_sent_ns = 0;      ///< [ns] by the server; 0: a request
};

/// Timing of a station since its start: percentiles and maximum of the time from a device sample to the use
/// of the manifold that answers it, and lateness of the haptic loop.
struct Telemetry {
  ClientId client;
  double input_to_force_p50 = 0.0;  ///< [s]
  double input_to_force_p99 = 0.0;  ///< [s]
  double input_to_force_max = 0.0;  ///< [s]
  double loop_late_p99 = 0.0;       ///< [s]
  std::uint64_t loop_overruns = 0;
  std::uint64_t samples = 0;
};

// ----------------------------------------------------------------------------------------- states

/// The constant data of an object.
struct SceneObject {
  ObjectId object;
  std::string name;
  std::string title;
  std::string kind;       ///< how a display draws it: part, tool, pointer, assistant, forearm, head, scene
  std::string mesh_hash;  ///< of the display mesh, empty for none
  std::string structure_hash;        ///< of the haptic structures, empty for none
  std::string color;                 ///< `#rrggbb` or `#rrggbbaa`
  Pose X_WO;                         ///< initial pose
  Vector3 size = Vector3::Zero();    ///< [m] of the bounding box in the object's frame
  Vector3 centre = Vector3::Zero();  ///< [m] of the bounding box, in O
};

/// State of an object for late joiners: after each jump, and once in 1000 ticks.
struct ObjectSnapshot {
  Tick tick = 0;
  ObjectState state;
};

struct LocalizedText {
  std::string language;  ///< `en`, `de`, ...
  std::string text;
};

enum class StepPhase : std::uint32_t { kWaiting, kActive, kDone, kTimedOut, kSkipped };

/// The current step of the scenario as displays show it: what the trainee has to do.
struct StepState {
  std::uint32_t revision = 0;  ///< counts changes of this state
  std::uint32_t step = 0;      ///< index of the current step
  std::uint32_t steps = 0;     ///< of the scenario
  std::string name;
  std::vector<LocalizedText> title;
  std::vector<LocalizedText> instruction;
  StepPhase phase = StepPhase::kWaiting;
  std::string part;  ///< title of the part this step belongs to, for grouping on displays; may be empty
  ObjectId object;   ///< to be touched, moved or used; may be invalid
  HandId hand;       ///< that has to do it
  ObjectId touch;    ///< to be touched, when the step is a touch; else invalid
  bool has_target = false;
  Pose X_WG;                             ///< target pose of `object`, displayed as a ghost
  Vector3 approach_W = Vector3::Zero();  ///< unit insertion direction; zero: any
  double approach_distance = 0.0;        ///< [m] length of the insertion path before the target
  double tolerance = 0.0;                ///< [m] of the target position
  double angle_tolerance = 0.0;          ///< [rad] of the target orientation
  double timeout = 0.0;                  ///< [s], 0 for none
  Tick started = 0;
};

/// One condition of a step.
struct ConditionValue {
  std::string text;    ///< as in the scenario: "pose of control_box", "contact pointer-control_box"
  double value = 0.0;  ///< [m], [N], [s] or [-], by the kind of the condition
  double limit = 0.0;  ///< [m], [N], [s] or [-] in the unit of `value`
  bool met = false;
};

/// How far the current step is fulfilled.
struct StepProgress {
  std::uint32_t revision = 0;  ///< of the StepState
  Tick tick = 0;
  double position_error = 0.0;   ///< [m] of the object from its target
  double angle_error = 0.0;      ///< [rad] of the object from its target
  double contact_seconds = 0.0;  ///< [s] of contact of the object in this step
  std::vector<ConditionValue> conditions;
};

enum class RunPhase : std::uint32_t { kWaitingForPeople, kRunning, kPaused, kSucceeded, kFailed, kStopped };

/// Phase of the session.
struct RunState {
  RunPhase phase = RunPhase::kWaitingForPeople;
  Tick tick = 0;                 ///< of this state
  std::string reason;            ///< of the phase, for people
  std::uint64_t final_hash = 0;  ///< state hash at the end of the run; 0 before
  std::uint32_t server_epoch = 0;
};

/// Which hand holds an object.
struct GrabState {
  ObjectId object;
  HandId hand;              ///< invalid: no hand
  std::uint32_t epoch = 0;  ///< of the object
  Pose X_HO;                ///< of the grasp
  Tick tick = 0;
};

struct RecorderStatus {
  std::string file;
  bool recording = false;
  std::uint64_t messages = 0;  ///< written
  std::uint64_t lost = 0;      ///< ticks whose TickInput is missing in the recording
  std::string problem;         ///< why it does not record; or empty
};

/// Latched: stays engaged when its writer leaves.
struct EmergencyStop {
  bool engaged = false;
  std::string who;
  std::string reason;
};

// ----------------------------------------------------------------------------------------- events

enum class CommandKind : std::uint32_t {
  kFulfilled,  ///< meets the condition "fulfilled" (a key in the paper)
  kSignal,     ///< an external signal by name (text)
  kPause,
  kResume,
  kReset,
  kSkipStep,
  kRelease,       ///< `hand`, or if invalid the hand named by text, releases its object
  kSwapHands,     ///< the trainee's two coupled hands exchange their objects
  kSetCollision,  ///< text "a b": names of the pair; value 0: off, 1: on
  kStop,
  kClearEmergencyStop,  ///< needs instructor rights; an EmergencyStop sample does not clear it
};

/// A client's request to the session, acknowledged by a CommandAck with the same id.
struct Command {
  ClientId client;
  std::uint32_t id = 0;  ///< counts the client's commands from 1; the same when repeated
  CommandKind kind = CommandKind::kFulfilled;
  HandId hand;
  std::string text;
  double value = 0.0;  ///< [-] by kind
};

struct CommandAck {
  ClientId client;
  std::uint32_t id = 0;
  bool accepted = false;  ///< it takes effect
  std::string reason;     ///< of a refusal
};

enum class Severity : std::uint32_t { kInfo, kWarning, kError };

/// Log entry of the server.
struct EventLog {
  std::uint64_t seq = 0;  ///< counts from 1 without gaps
  Tick tick = 0;
  Severity severity = Severity::kInfo;
  std::string kind;  ///< "step", "mounted", "taken", "join", "refused", "hand frozen", "emergency stop", ...
  std::string text;
};

/// Log entry of a client.
struct ClientEvent {
  ClientId client;
  std::uint64_t seq = 0;
  std::string kind;
  std::string text;
};

/// Part of the inputs of one tick in their journal form (server/session/tick_io.h).
struct TickInputPart {
  Tick tick = 0;
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint64_t state_hash = 0;  ///< after the tick
  std::vector<std::uint8_t> bytes;
};

/// Part of a checkpoint: the whole changing state of the session after a tick.
struct CheckpointPart {
  Tick tick = 0;
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint64_t state_hash = 0;  ///< after the tick
  std::vector<std::uint8_t> bytes;
};

}  // namespace tenon
