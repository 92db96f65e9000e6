// The messages of idl/tenon.idl that the page reads, as the decoder gives them: 64-bit numbers are bigint, enumerations numbers.

export type Vector = ArrayLike<number>;
export interface Pose { p: Vector; q: Vector }
export interface Wrench { force: Vector; torque: Vector }

export const NONE = 0xffffffff;
/** Of a participant. */
export enum Role { Admin, Instructor, Trainee, Observer, Recorder }

export interface SceneObject {
  object_id: number; name: string; title: string; kind: string; structure_hash: string; color: string; X_WO: Pose; size: Vector; centre: Vector;
  /** Recordings of before have none. */
  titles?: Localized[];
}
export enum Status { Hidden, Parked, Held, Tracked, Fixed, Free }
export interface ObjectState {
  object_id: number; epoch: number; X_WO: Pose; V_WO: Vector; holder: number; status: Status; in_contact: boolean;
}
export interface WorldFrame { part: number; parts: number; tick: bigint; step_revision: number; states: ObjectState[] }
export interface ObjectSnapshot { object_id: number; tick: bigint; state: ObjectState }
export interface HandState { hand_id: number; seq: number; X_WH: Pose; p_WC: Vector; tactors: ArrayLike<number>; F_Ho_W: Wrench; manifold_age: number; safety_flags: number; indexing: boolean; guidance_force: number }
export interface PairContact {
  a: number; b: number; enabled: boolean; colliding: boolean; contacts: number; F_Ao_W: Wrench; p_WP: Vector; depth: number; gap: number;
  load_percent: number; peak_force: number; peak_depth: number;
}
export interface ContactPairs { part: number; parts: number; tick: bigint; pairs: PairContact[] }
export interface TickStats {
  tick: bigint; load_percent: number; compute_seconds: number; compute_seconds_max: number; late_ticks: bigint; input_age_seconds: number;
  slow_writes: bigint; unsent_samples: bigint;
}
export interface Localized { language: string; text: string }
export enum StepPhase { Waiting, Active, Done, TimedOut, Skipped }
export interface StepState {
  revision: number; step: number; steps: number; name: string; title: Localized[]; instruction: Localized[]; phase: StepPhase; part: string;
  object_id: number; hand_id: number; touch_id: number; has_target: boolean; X_WG: Pose; approach_W: Vector; approach_distance: number;
  tolerance: number; angle_tolerance: number; timeout: number; started: bigint;
}
export interface StepProgress {
  revision: number; tick: bigint; position_error: number; angle_error: number; contact_seconds: number;
  nodes: number;
  /** The condition tree, parents before their children; `group`: 0 a condition, 1 all, 2 any of the deeper ones that follow. */
  conditions: { text: string; value: number; limit: number; group: number; met: boolean; depth: number }[];
}
export interface SceneStep { step: number; steps: number; name: string; title: Localized[]; part: string }
/** Of the scenario, in all of its languages; the announcement has that of one. */
export interface SceneTitle { titles: Localized[] }
/** An external signal that conditions of the scenario wait for. */
export interface SceneSignal { signal: number; name: string }
export interface SceneHand { hand_id: number; name: string; role: Role; object_id: number; freeze_ticks: number; park_ticks: number; guidance_alone: boolean }
export enum RunPhase { Waiting, Running, Paused, Succeeded, Failed, Stopped }
export interface RunState { phase: RunPhase; tick: bigint; reason: string; forces_frozen?: boolean; emergency_stop?: boolean; open_commands?: number; steps_skipped?: number; steps_timed_out?: number }
export interface GrabState { object_id: number; hand_id: number; epoch: number; X_HO: Pose; tick: bigint }
export interface Presence { client_id: number; name: string; role: Role; hands: ArrayLike<number>; alive: boolean }
export interface EmergencyStop { client_guid: string; counter: number; who: string; reason: string }
export interface EmergencyClear { client_guid: string; counter: number; who: string; reason: string }
/** A clear names this number, and is refused when a newer raise stands. */
export interface NewestRaise { number: number; standing: number; who: string; reason: string }
export interface RecorderStatus { file: string; recording: boolean; messages: bigint; lost: bigint; problem: string }
export interface Telemetry { client_id: number; input_to_force_p50: number; input_to_force_p99: number; loop_overruns: bigint; samples: bigint; age: number; jitter: number; answers_lost: number; inputs_lost: number; inputs_replaced: number; clock_known: boolean; clock_offset: number; clock_error: number; round_trip: number }
export interface SessionAnnounce { session: string; title: string; host: string; lockstep: boolean; protocol_version: number; scene_hash: string }
/** `client_id`: of a ClientEvent, which has no severity of its own. */
export interface EventLog { seq: bigint; tick: bigint; severity: number; kind: string; text: string; client_id?: number }
export interface InstanceGone { topic: string; key_sample: Uint8Array }
/** Of the channel /console: how the gateway stands to its session. `modelOf`: of a recording. */
export interface ConsoleState {
  state: "searching" | "joined" | "refused" | "lost" | "ended" | "recorded";
  reason: string; life: number; session: string; title: string; lockstep: boolean; scene: string; protocol: number;
  /** Whether this gateway records the session. */
  recorded?: boolean; modelOf?: RecordedModel;
}
/** The display model of an object, by its name, from a recording. */
export type RecordedModel = (object: string) => Promise<ArrayBuffer>;
/** foxglove.SceneUpdate, as far as it is read here: what is shown has one model, or none. */
export interface SceneUpdate { entities: { models: { data: Uint8Array }[] }[] }
/** A level of an object's display model; the list of a scene's assets. */
export interface ModelLevel { model: string; triangles: number; error: number }
export interface SceneModels { version: number; objects: ModelLevel[][] }
/** Of the channel /lobby: the sessions of the bus. */
export interface LobbyState { sessions: { session: string; title: string; host: string; served: boolean; lockstep: boolean; protocol: number }[]; more?: boolean }
/** What this gateway shows: a session, a recording, or, with neither, all sessions. */
export interface Gateway { session: string; recording: string; role: string; protocol: number; recordings?: boolean; local?: boolean }
