#include "idl/wire/codec.h"

namespace tenon::wire {

std::string_view idlText() {
  // a copy of idl/tenon.idl; a test compares the two
  return R"idl(// The protocol of Tenon, version 2: the messages its programs exchange over DDS, and that recordings contain.
//
// Every type is @final and encoded as XCDR1. No sample is longer than 1,300 bytes: longer content is sent in
// numbered parts. SI units, angles in radians; the fields are explained in idl/types/messages.h. X_AB is the pose
// of frame B in A; W the world, O an object, H a hand. Ids are indices into the scene, 0xFFFFFFFF is invalid. Keys
// are uint32, or text where there is no number yet (a session, a client before its Welcome). Topics, their types and
// QoS classes: idl/wire/topics.h.

module tenon {

@final @nested struct Pose { double p[3]; double q[4]; };  // q: unit quaternion x, y, z, w
@final @nested struct Twist { double linear[3]; double angular[3]; };
@final @nested struct Wrench { double force[3]; double torque[3]; };

// ---- session

enum Role { ROLE_ADMIN, ROLE_INSTRUCTOR, ROLE_TRAINEE, ROLE_OBSERVER, ROLE_RECORDER };
@final @nested struct HandName { string<31> text; };

@final struct SessionAnnounce {
  @key string session; string<127> title; uint32 protocol_version; uint32 server_epoch; boolean lockstep;
  uint32 asset_port; string<31> scenario_hash; sequence<HandName, 16> free_hands;
};
@final struct Join {
  @key string client_guid; string<63> name; Role role; sequence<HandName, 16> hands; string<63> token;
  uint32 protocol_version;
};
@final struct Welcome {
  @key string client_guid; boolean accepted; string<255> reason; uint32 client_id; sequence<uint32, 16> hands;
  string<63> token; uint32 server_epoch; uint64 tick; boolean lockstep;
};
@final struct Presence {
  @key uint32 client_id; string<63> name; Role role; sequence<uint32, 16> hands; boolean alive;
};

// ---- streams

@final @nested struct DeviceSample { uint32 seq; Pose X_WH; Twist V_WH; uint32 buttons; };
@final struct DeviceInput {
  @key uint32 hand_id; uint32 client_id; uint32 server_epoch; uint64 heard_tick; uint32 dof_mask;
  boolean active; double p_WC[3]; DeviceSample samples[4];  // newest first
};

// status: 0 hidden, 1 parked, 2 held, 3 tracked, 4 fixed, 5 free
@final @nested struct ObjectState {
  uint32 object_id; uint32 epoch; Pose X_WO; float V_WO[6]; uint32 holder; octet status; boolean in_contact;
};
@final struct WorldFrame {
  @key uint32 part; uint32 parts; uint32 server_epoch; uint64 tick; uint32 step_revision;
  sequence<ObjectState, 12> states;
};
@final @nested struct ManifoldContact {
  uint32 other; float p_BoP_B[3]; float normal_A[3]; float plane_offset; float gap; float velocity_W[3];
};
@final @nested struct HandPull {
  uint32 hand_id; Pose X_WG; double p_BoC_B[3]; double stiffness; double rotational_stiffness;
};
@final struct HandManifold {
  @key uint32 hand_id; uint32 server_epoch; uint64 tick; uint32 answers_seq; uint32 object_id;
  uint32 object_epoch; Pose X_HO; Pose X_WO; Wrench F_Ho_W; double stiffness; double rotational_stiffness;
  double validity_radius; uint32 step_revision; boolean frozen; sequence<HandPull, 2> others;
  sequence<ManifoldContact, 16> contacts;
};
@final struct HandState {
  @key uint32 hand_id; uint32 seq; Pose X_WH; double p_WC[3]; Pose X_WO_local; Wrench F_Ho_W;
  uint32 manifold_age; uint32 safety_flags; boolean indexing; octet tactors[6];
};
@final @nested struct PairContact {
  uint32 a; uint32 b; boolean enabled; boolean colliding; uint32 contacts; Wrench F_Ao_W; double p_WP[3];
  double depth; double gap; double load_percent; double peak_force; double peak_depth;
};
@final struct ContactPairs { @key uint32 part; uint32 parts; uint64 tick; sequence<PairContact, 6> pairs; };
@final struct TickStats {
  uint32 server_epoch; uint64 tick; double load_percent; double compute_seconds; double compute_seconds_max;
  uint64 late_ticks; uint32 active_pairs; uint32 queried_pairs; uint64 points_visited;
  double input_age_seconds; uint64 state_hash;
};
@final struct Guidance {
  @key uint32 hand_id; uint64 tick; boolean active; Pose X_WF; double stiffness; double damping;
};
@final struct ForceContribution {
  @key uint32 source; uint32 client_id; uint32 object_id; Wrench F_Oo_W; uint32 lifetime_ticks;
};
@final struct ExternalPose { @key uint32 object_id; uint32 client_id; Pose X_WO; uint32 lifetime_ticks; };
@final struct ClockSync {
  @key uint32 client_id; int64 sent_ns; int64 server_received_ns; int64 server_sent_ns;
};
@final struct Telemetry {
  @key uint32 client_id; double input_to_force_p50; double input_to_force_p99; double input_to_force_max;
  double loop_late_p99; uint64 loop_overruns; uint64 samples;
};

// ---- states

@final struct SceneObject {
  @key uint32 object_id; string<63> name; string<127> title; string<31> kind; string<71> mesh_hash;
  string<71> structure_hash; string<15> color; Pose X_WO; double size[3]; double centre[3];
};
@final struct ObjectSnapshot { @key uint32 object_id; uint64 tick; ObjectState state; };

enum StepPhase { STEP_WAITING, STEP_ACTIVE, STEP_DONE, STEP_TIMED_OUT, STEP_SKIPPED };
@final @nested struct LocalizedTitle { string<7> language; string<71> text; };
@final @nested struct LocalizedInstruction { string<7> language; string<223> text; };
@final struct StepState {
  uint32 revision; uint32 step; uint32 steps; string<47> name; sequence<LocalizedTitle, 3> title;
  sequence<LocalizedInstruction, 3> instruction; StepPhase phase; string<47> part; uint32 object_id;
  uint32 hand_id; uint32 touch_id; boolean has_target; Pose X_WG; double approach_W[3];
  double approach_distance; double tolerance; double angle_tolerance; double timeout; uint64 started;
};
@final @nested struct ConditionValue { string<79> text; double value; double limit; boolean met; };
@final struct StepProgress {
  uint32 revision; uint64 tick; double position_error; double angle_error; double contact_seconds;
  sequence<ConditionValue, 10> conditions;
};

enum RunPhase { RUN_WAITING_FOR_PEOPLE, RUN_RUNNING, RUN_PAUSED, RUN_SUCCEEDED, RUN_FAILED, RUN_STOPPED };
@final struct RunState {
  RunPhase phase; uint64 tick; string<511> reason; uint64 final_hash; uint32 server_epoch;
};
@final struct GrabState { @key uint32 object_id; uint32 hand_id; uint32 epoch; Pose X_HO; uint64 tick; };
@final struct RecorderStatus {
  string<511> file; boolean recording; uint64 messages; uint64 lost; string<511> problem;
};
@final struct EmergencyStop { boolean engaged; string<63> who; string<255> reason; };

// ---- events

enum CommandKind {
  COMMAND_FULFILLED, COMMAND_SIGNAL, COMMAND_PAUSE, COMMAND_RESUME, COMMAND_RESET, COMMAND_SKIP_STEP,
  COMMAND_RELEASE, COMMAND_SWAP_HANDS, COMMAND_SET_COLLISION, COMMAND_STOP, COMMAND_CLEAR_EMERGENCY_STOP
};
@final struct Command {
  @key uint32 client_id; uint32 id; CommandKind kind; uint32 hand_id; string<255> text; double value;
};
@final struct CommandAck { @key uint32 client_id; uint32 id; boolean accepted; string<255> reason; };

enum Severity { SEVERITY_INFO, SEVERITY_WARNING, SEVERITY_ERROR };
@final struct EventLog { uint64 seq; uint64 tick; Severity severity; string<31> kind; string<1023> text; };
@final struct ClientEvent { @key uint32 client_id; uint64 seq; string<31> kind; string<1023> text; };

@final struct TickInputPart {
  @key uint32 part; uint64 tick; uint32 parts; uint64 state_hash; sequence<octet, 1100> bytes;
};
@final struct CheckpointPart {
  @key uint32 part; uint64 tick; uint32 parts; uint64 state_hash; sequence<octet, 1100> bytes;
};

};
)idl";
}

}  // namespace tenon::wire
