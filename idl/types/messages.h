#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "idl/types/spatial.h"

/// What the programs say to each other, as C++ sees it. `idl/tenon.idl` is the same page as the network sees
/// it and `idl/wire/convert.h` maps one to the other without loss: a program cannot tell by the bits whether
/// a message crossed a network. Streams are of fixed size and may be written from a 1 kHz loop; states and
/// events hold strings and may not.
namespace tenon {

inline constexpr std::uint32_t kProtocolVersion = 2;

enum class Role : std::uint32_t { kAdmin, kInstructor, kTrainee, kObserver, kRecorder };

// ---------------------------------------------------------------------------------------- session

/// What runs here; one per session, in the lobby partition.
struct SessionAnnounce {
  std::string session;
  std::string title;
  std::uint32_t protocol_version = kProtocolVersion;
  std::uint32_t server_epoch = 0;
  bool lockstep = false;
  std::uint32_t asset_port = 0;
  std::string scenario_hash;  ///< of the scenario's text: a recording says what it was made with
  std::vector<std::string> free_hands;
};

struct Join {
  std::string client_guid;  ///< a random name the client chose; the key until it has an id
  std::string name;         ///< the person's or station's name
  Role role = Role::kObserver;
  std::vector<std::string> hands;  ///< names of the scenario's hands it wants to move
  std::string token;               ///< of an earlier Welcome: to come back as the same client
  std::uint32_t protocol_version = kProtocolVersion;
};

struct Welcome {
  std::string client_guid;
  bool accepted = false;
  std::string reason;         ///< why not; empty when accepted
  ClientId client;            ///< not accepted and yet valid: the seat that this client had is taken away
  std::vector<HandId> hands;  ///< in the order asked for; invalid for one that the scenario does not have
  std::string token;
  std::uint32_t server_epoch = 0;
  Tick tick = 0;  ///< of the server; in lockstep the first input answers this one plus one
  bool lockstep = false;
};

struct Presence {
  ClientId client;
  std::string name;
  Role role = Role::kObserver;
  std::vector<HandId> hands;
  bool alive = true;
};

// ---------------------------------------------------------------------------------------- streams

/// One reading of a device, mapped to the world by the client.
struct DeviceSample {
  std::uint32_t seq = 0;  ///< counts the client's ticks; in lockstep the server tick it is for
  Pose X_WH;              ///< the hand's frame
  Twist V_WH;
  std::uint32_t buttons = 0;  ///< bit 0: the main switch
};

/// What a device feels and moves: bits 0..2 translation along x, y, z; 3..5 rotation about them.
inline constexpr std::uint32_t kAllDofs = 0x3F;
inline constexpr std::uint32_t kTranslationDofs = 0x07;

struct DeviceInput {
  HandId hand;
  ClientId client;
  std::uint32_t server_epoch = 0;
  Tick heard_tick = 0;  ///< newest server tick the client had heard: its age follows
  std::uint32_t dof_mask = kAllDofs;
  bool active = false;                  ///< false: the station's safety layer holds this device still
  Vector3 p_WC = Vector3::Zero();       ///< C_w, the centre of the client's workspace (paper eq. 1)
  std::array<DeviceSample, 4> samples;  ///< newest first; the older three repeat, against loss
};

struct ObjectState {
  ObjectId object;
  std::uint32_t epoch = 0;  ///< raised at every declared jump
  Pose X_WO;
  Eigen::Matrix<float, 6, 1> V_WO = Eigen::Matrix<float, 6, 1>::Zero();  ///< linear, angular
  HandId holder;                                                         ///< none when nobody holds it
  std::uint8_t status = 0;                                               ///< ObjectStatus
  bool in_contact = false;
};

enum class ObjectStatus : std::uint8_t {
  kHidden,   ///< not in the scene yet: neither seen nor felt
  kParked,   ///< stands still where it is, may be touched
  kHeld,     ///< follows a hand through its coupling
  kTracked,  ///< follows a tracker as it is, feels nothing (forearm, head)
  kFixed,    ///< mounted
  kFree,     ///< has a mass: falls, flies and is pushed
};

inline constexpr int kStatesPerFrame = 12;

/// Packed states of objects; all parts of one tick together are the scene.
struct WorldFrame {
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  std::uint32_t step_revision = 0;  ///< of the StepState this frame belongs to
  FixedVector<ObjectState, kStatesPerFrame> states;
};

inline constexpr int kManifoldContacts = 16;

/// One contact of the held body B with another body A, as a half-space fixed in A:
/// admissible while normal_A · (point of B, seen in A) >= offset.
struct ManifoldContact {
  ObjectId other;
  Vector3f p_BoP_B = Vector3f::Zero();     ///< the point, fixed in the held body
  Vector3f normal_A = Vector3f::Zero();    ///< unit, away from A
  float offset = 0.0F;                     ///< [m] of the plane from A's origin
  float gap = 0.0F;                        ///< [m] at the tick of the manifold, signed, dilation included
  Vector3f velocity_W = Vector3f::Zero();  ///< of A's material at the point
};

/// How another hand pulls at the object that this one holds.
struct HandPull {
  HandId hand;
  Pose X_WG;                          ///< where it wants the object to be
  Vector3 p_BoC_B = Vector3::Zero();  ///< the point of the object that it holds
  double stiffness = 0.0;             ///< [N/m]
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
};

inline constexpr int kOtherPulls = 2;

struct HandManifold {
  HandId hand;
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  std::uint32_t answers_seq = 0;  ///< the newest input the server had used
  ObjectId object;                ///< what this hand moves
  std::uint32_t object_epoch = 0;
  Pose X_HO;      ///< where the object is in the hand, since it was taken
  Pose X_WO;      ///< the proxy (god object)
  Wrench F_Ho_W;  ///< the coupling's wrench on the hand, about the hand's origin, as the server computed it
  double stiffness = 0.0;             ///< [N/m] of the coupling
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
  double validity_radius = 0.0;  ///< [m] the object may move this far before unlisted contacts can matter
  std::uint32_t step_revision = 0;
  bool frozen = false;  ///< the server holds the object still: stale input, pause or emergency stop
  FixedVector<HandPull, kOtherPulls> others;  ///< who else holds the object, in order of hands
  FixedVector<ManifoldContact, kManifoldContacts> contacts;
};

struct HandState {
  HandId hand;
  std::uint32_t seq = 0;
  Pose X_WH;
  Vector3 p_WC = Vector3::Zero();
  Pose X_WO_local;                        ///< the local proxy: what the person felt (telemetry only)
  Wrench F_Ho_W;                          ///< displayed on the hand
  std::uint32_t manifold_age = 0;         ///< [ticks]
  std::uint32_t safety_flags = 0;         ///< bit per rule of devices/safety.h that is acting
  bool indexing = false;                  ///< the workspace is moving
  std::array<std::uint8_t, 6> tactors{};  ///< intensities of an arm band, 0..255
};

struct PairContact {
  ObjectId a;  ///< the body whose points were tested
  ObjectId b;  ///< the body whose field was asked
  bool enabled = true;
  bool colliding = false;
  std::uint32_t contacts = 0;
  Wrench F_Ao_W;                   ///< of b on a, about a's origin
  Vector3 p_WP = Vector3::Zero();  ///< where the force acts, as a mean of the contact points
  double depth = 0.0;              ///< [m] of the deepest point in the undilated field, 0 when apart
  double gap = 0.0;                ///< [m] smallest signed gap, dilation included
  double load_percent = 0.0;       ///< paper eq. 2
  double peak_force = 0.0;         ///< [N] since the last sample of this topic
  double peak_depth = 0.0;         ///< [m] likewise
};

inline constexpr int kPairsPerSample = 6;

struct ContactPairs {
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  Tick tick = 0;
  FixedVector<PairContact, kPairsPerSample> pairs;
};

struct TickStats {
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  double load_percent = 0.0;         ///< largest of the active pairs since the last sample
  double compute_seconds = 0.0;      ///< of the last tick
  double compute_seconds_max = 0.0;  ///< since the last sample
  std::uint64_t late_ticks = 0;      ///< since the start
  std::uint32_t active_pairs = 0;
  std::uint32_t queried_pairs = 0;
  std::uint64_t points_visited = 0;
  double input_age_seconds = 0.0;  ///< oldest input in use
  std::uint64_t state_hash = 0;
};

struct Guidance {
  HandId hand;
  Tick tick = 0;
  bool active = false;
  Pose X_WF;  ///< the fixture's pose
  double stiffness = 0.0;
  double damping = 0.0;
};

struct ForceContribution {
  std::uint32_t source = 0;
  ClientId client;
  ObjectId object;
  Wrench F_Oo_W;
  std::uint32_t lifetime_ticks = 0;
};

struct ExternalPose {
  ObjectId object;
  ClientId client;
  Pose X_WO;
  std::uint32_t lifetime_ticks = 0;
};

struct ClockSync {
  ClientId client;
  std::int64_t sent_ns = 0;
  std::int64_t server_received_ns = 0;
  std::int64_t server_sent_ns = 0;
};

struct Telemetry {
  ClientId client;
  double input_to_force_p50 = 0.0;
  double input_to_force_p99 = 0.0;
  double input_to_force_max = 0.0;
  double loop_late_p99 = 0.0;
  std::uint64_t loop_overruns = 0;
  std::uint64_t samples = 0;
};

// ----------------------------------------------------------------------------------------- states

struct SceneObject {
  ObjectId object;
  std::string name;
  std::string title;
  std::string kind;  ///< what a display draws it as: part, tool, pointer, assistant, forearm, head, scene
  std::string mesh_hash;       ///< of the display mesh, empty for none
  std::string structure_hash;  ///< of the haptic structures, empty for none
  std::string color;           ///< `#rrggbb` or `#rrggbbaa`
  Pose X_WO;
  Vector3 size = Vector3::Zero();  ///< of the bounding box in the object's frame
  Vector3 centre = Vector3::Zero();
};

struct ObjectSnapshot {
  Tick tick = 0;
  ObjectState state;
};

struct LocalizedText {
  std::string language;  ///< `en`, `de`, ...
  std::string text;
};

enum class StepPhase : std::uint32_t { kWaiting, kActive, kDone, kTimedOut, kSkipped };

/// What the trainee has to do now, as a person is told it.
struct StepState {
  std::uint32_t revision = 0;  ///< counts changes of this state
  std::uint32_t step = 0;
  std::uint32_t steps = 0;
  std::string name;
  std::vector<LocalizedText> title;
  std::vector<LocalizedText> instruction;
  StepPhase phase = StepPhase::kWaiting;
  std::string part;  ///< title of the part this step belongs to, for grouping on displays; may be empty
  ObjectId object;   ///< to be touched, moved or used; may be none
  HandId hand;       ///< that is meant to do it
  ObjectId touch;    ///< the object to touch, when the step asks for a touch
  bool has_target = false;
  Pose X_WG;                             ///< ghost: where `object` shall be
  Vector3 approach_W = Vector3::Zero();  ///< unit: the direction in which it goes in; zero for any
  double approach_distance = 0.0;  ///< [m] before the target, along it, where that direction starts to matter
  double tolerance = 0.0;          ///< [m]
  double angle_tolerance = 0.0;    ///< [rad]
  double timeout = 0.0;            ///< [s], 0 for none
  Tick started = 0;
};

struct ConditionValue {
  std::string text;  ///< as in the scenario: "pose of control_box", "contact pointer-control_box"
  double value = 0.0;
  double limit = 0.0;
  bool met = false;
};

struct StepProgress {
  std::uint32_t revision = 0;
  Tick tick = 0;
  double position_error = 0.0;
  double angle_error = 0.0;
  double contact_seconds = 0.0;  ///< that `object` has been in contact in this step
  std::vector<ConditionValue> conditions;
};

enum class RunPhase : std::uint32_t { kWaitingForPeople, kRunning, kPaused, kSucceeded, kFailed, kStopped };

struct RunState {
  RunPhase phase = RunPhase::kWaitingForPeople;
  Tick tick = 0;
  std::string reason;
  std::uint64_t final_hash = 0;
  std::uint32_t server_epoch = 0;
};

struct GrabState {
  ObjectId object;
  HandId hand;  ///< none: nobody holds it
  std::uint32_t epoch = 0;
  Pose X_HO;
  Tick tick = 0;
};

struct RecorderStatus {
  std::string file;
  bool recording = false;
  std::uint64_t messages = 0;
  std::uint64_t lost = 0;
  std::string problem;
};

struct EmergencyStop {
  bool engaged = false;
  std::string who;
  std::string reason;
};

// ----------------------------------------------------------------------------------------- events

enum class CommandKind : std::uint32_t {
  kFulfilled,  ///< the keyboard's "fulfilled" of the paper
  kSignal,     ///< an external signal by name (text)
  kPause,
  kResume,
  kReset,
  kSkipStep,
  kRelease,       ///< let go of what `hand` holds; without a hand, of the one that text names
  kSwapHands,     ///< the trainee's two coupled hands change roles
  kSetCollision,  ///< text "a b", value 0 or 1
  kStop,
  kClearEmergencyStop,  ///< the only way out of an emergency stop: who says it must be allowed to
};

struct Command {
  ClientId client;
  std::uint32_t id = 0;
  CommandKind kind = CommandKind::kFulfilled;
  HandId hand;
  std::string text;
  double value = 0.0;
};

struct CommandAck {
  ClientId client;
  std::uint32_t id = 0;
  bool accepted = false;
  std::string reason;
};

enum class Severity : std::uint32_t { kInfo, kWarning, kError };

struct EventLog {
  std::uint64_t seq = 0;
  Tick tick = 0;
  Severity severity = Severity::kInfo;
  std::string kind;  ///< step, grab, mount, fault, join, leave, safety, stop, ...
  std::string text;
};

struct ClientEvent {
  ClientId client;
  std::uint64_t seq = 0;
  std::string kind;
  std::string text;
};

/// Exactly what a tick consumed, as the journal wrote it, with the hash of the state it left.
struct TickInputPart {
  Tick tick = 0;
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint64_t state_hash = 0;
  std::vector<std::uint8_t> bytes;
};

/// The whole moving state at the end of a tick.
struct CheckpointPart {
  Tick tick = 0;
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint64_t state_hash = 0;
  std::vector<std::uint8_t> bytes;
};

}  // namespace tenon
