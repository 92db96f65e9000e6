#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>

#include "idl/types/messages.h"
#include "idl/types/resolution.h"

/// The fields of each message with their names in errors and their longest lists: one list per type serves
/// every direction. `d` is the direction (ToWire or FromWire of convert.cpp; random values in the tests), `c`
/// the C struct that idlc generates, `m` the message. A direction has
///   d(name, c, m)                     a number, id, vector, enumerator or text
///   d.status(name, c, m)              an ObjectStatus
///   d.steps(name, c, m, step)         a vector as whole numbers of `step` (idl/types/resolution.h)
///   d.bytes(name, c, m, bound)        octets
///   d.list(name, c, m, bound, each)   elements, by each(d, c_element, m_element)
/// Internal to idl/wire and its tests.
namespace tenon::wire {

/// [bytes] key texts are unbounded in the IDL, because Cyclone has no type object for bounded ones.
inline constexpr std::size_t kKeyTextMax = 63;

template <class T, class M>
concept Is = std::same_as<std::remove_const_t<T>, M>;

void fields(auto& d, auto& c, Is<Pose> auto& m) {
  d("", c.p, m.translation());
  d("", c.q, m.rotation().coeffs());  // x, y, z, w
}
void fields(auto& d, auto& c, Is<Twist> auto& m) {
  d("", c.linear, m.linear);
  d("", c.angular, m.angular);
}
void fields(auto& d, auto& c, Is<Wrench> auto& m) {
  d("", c.force, m.force);
  d("", c.torque, m.torque);
}
void fields(auto& d, auto& c, Is<DeviceSample> auto& m) {
  d("seq", c.seq, m.seq);
  d.steps("p_WH", c.p_WH, m.X_WH.translation(), kPositionStep);
  d.steps("q_WH", c.q_WH, m.X_WH.rotation().coeffs(), kRotationStep);
  d.steps("v_WH", c.v_WH, m.V_WH.linear, kVelocityStep);
  d.steps("w_WH", c.w_WH, m.V_WH.angular, kVelocityStep);
  d("buttons", c.buttons, m.buttons);
}
void fields(auto& d, auto& c, Is<ObjectState> auto& m) {
  d("object", c.object_id, m.object);
  d("epoch", c.epoch, m.epoch);
  fields(d, c.X_WO, m.X_WO);
  d("V_WO", c.V_WO, m.V_WO);
  d("holder", c.holder, m.holder);
  d.status("status", c.status, m.status);
  d("in_contact", c.in_contact, m.in_contact);
}
void fields(auto& d, auto& c, Is<ManifoldContact> auto& m) {
  d("other", c.other, m.other);
  d("p_BoP_B", c.p_BoP_B, m.p_BoP_B);
  d("normal_A", c.normal_A, m.normal_A);
  d("offset", c.plane_offset, m.offset);
  d("gap", c.gap, m.gap);
  d("velocity_W", c.velocity_W, m.velocity_W);
}
void fields(auto& d, auto& c, Is<HandPull> auto& m) {
  d("hand", c.hand_id, m.hand);
  d("object", c.object_id, m.object);
  fields(d, c.X_WG, m.X_WG);
  d("V_WG", c.V_WG, m.V_WG);
  d("p_BoC_B", c.p_BoC_B, m.p_BoC_B);
  d("stiffness", c.stiffness, m.stiffness);
  d("rotational_stiffness", c.rotational_stiffness, m.rotational_stiffness);
}
void fields(auto& d, auto& c, Is<ManifoldBody> auto& m) {
  d("object", c.object_id, m.object);
  d("epoch", c.epoch, m.epoch);
}
void fields(auto& d, auto& c, Is<HandStiffness> auto& m) {
  d("translational", c.translational, m.translational);
  d("rotational", c.rotational, m.rotational);
}
void fields(auto& d, auto& c, Is<PairContact> auto& m) {
  d("a", c.a, m.a);
  d("b", c.b, m.b);
  d("enabled", c.enabled, m.enabled);
  d("colliding", c.colliding, m.colliding);
  d("contacts", c.contacts, m.contacts);
  fields(d, c.F_Ao_W, m.F_Ao_W);
  d("p_WP", c.p_WP, m.p_WP);
  d("depth", c.depth, m.depth);
  d("gap", c.gap, m.gap);
  d("load_percent", c.load_percent, m.load_percent);
  d("peak_force", c.peak_force, m.peak_force);
  d("peak_depth", c.peak_depth, m.peak_depth);
}
void fields(auto& d, auto& c, Is<LocalizedText> auto& m) {
  d("language", c.language, m.language);
  d("text", c.text, m.text);
}
void fields(auto& d, auto& c, Is<ConditionValue> auto& m) {
  d("conditions.text", c.text, m.text);
  d("value", c.value, m.value);
  d("limit", c.limit, m.limit);
  d("group", c.group, m.group);
  d("met", c.met, m.met);
  d("depth", c.depth, m.depth);
}
void fields(auto& d, auto& c, Is<TopicSamples> auto& m) {
  d("topics.topic", c.topic, m.topic);
  d("samples", c.samples, m.samples);
}

inline constexpr auto kStructs = [](auto& d, auto& c, auto& m) { fields(d, c, m); };
inline constexpr auto kNumbers = [](auto& d, auto& c, auto& m) { d("", c, m); };
inline constexpr auto kNames = [](auto& d, auto& c, auto& m) { d("hand name", c.text, m); };

void fields(auto& d, auto& c, Is<SessionAnnounce> auto& m) {
  d("session", c.session, m.session);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("title", c.title, m.title);
  d("protocol_version", c.protocol_version, m.protocol_version);
  d("lockstep", c.lockstep, m.lockstep);
  d("objects", c.objects, m.objects);
  d("hands", c.hands, m.hands);
  d("steps", c.steps, m.steps);
  d("resumed_after", c.resumed_after, m.resumed_after);
  d("scenario_hash", c.scenario_hash, m.scenario_hash);
  d("host", c.host, m.host);
  d("pid", c.pid, m.pid);
  d("scene_hash", c.scene_hash, m.scene_hash);
  d("scenario", c.scenario, m.scenario);
  d("detail", c.detail, m.detail);
  d("freeze_ticks", c.freeze_ticks, m.freeze_ticks);
  d("park_ticks", c.park_ticks, m.park_ticks);
}
void fields(auto& d, auto& c, Is<Join> auto& m) {
  d("client_guid", c.client_guid, m.client_guid);
  d("session", c.session, m.session);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("name", c.name, m.name);
  d("role", c.role, m.role);
  d.list("hands", c.hands, m.hands, 16, kNames);
  d("seat_key", c.seat_key, m.seat_key);
  d("seat_proof", c.seat_proof, m.seat_proof);
  d("key_proof", c.key_proof, m.key_proof);
  d("protocol_version", c.protocol_version, m.protocol_version);
  d.list("stiffness", c.stiffness, m.stiffness, 8, kStructs);
  d("recorded_until", c.recorded_until, m.recorded_until);
}
void fields(auto& d, auto& c, Is<Welcome> auto& m) {
  d("client_guid", c.client_guid, m.client_guid);
  d("session", c.session, m.session);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("accepted", c.accepted, m.accepted);
  d("reason", c.reason, m.reason);
  d("challenge", c.challenge, m.challenge);
  d("client", c.client_id, m.client);
  d.list("hands", c.hands, m.hands, 16, kNumbers);
  d.list("objects", c.objects, m.objects, 16, kNumbers);
  d("tick", c.tick, m.tick);
  d("lockstep", c.lockstep, m.lockstep);
  d("people", c.people, m.people);
  d("permitted_commands", c.permitted_commands, m.permitted_commands);
}
void fields(auto& d, auto& c, Is<Presence> auto& m) {
  d("client", c.client_id, m.client);
  d("name", c.name, m.name);
  d("role", c.role, m.role);
  d.list("hands", c.hands, m.hands, 16, kNumbers);
  d("alive", c.alive, m.alive);
}
void fields(auto& d, auto& c, Is<DeviceInput> auto& m) {
  d("hand", c.hand_id, m.hand);
  d("client", c.client_id, m.client);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("active", c.active, m.active);
  d("period", c.period, m.period);
  fields(d, c.sample, m.sample);
  d.list("earlier", c.earlier, m.earlier, kEarlierSamples, kStructs);
}
void fields(auto& d, auto& c, Is<WorldFrame> auto& m) {
  d("part", c.part, m.part);
  d("parts", c.parts, m.parts);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("tick", c.tick, m.tick);
  d("step_revision", c.step_revision, m.step_revision);
  d.list("states", c.states, m.states, kStatesPerFrame, kStructs);
}
void fields(auto& d, auto& c, Is<HandManifold> auto& m) {
  d("hand", c.hand_id, m.hand);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("tick", c.tick, m.tick);
  d("sent", c.sent, m.sent);
  d("answers_seq", c.answers_seq, m.answers_seq);
  d("object", c.object_id, m.object);
  d("object_epoch", c.object_epoch, m.object_epoch);
  fields(d, c.X_HO, m.X_HO);
  fields(d, c.X_WO, m.X_WO);
  fields(d, c.F_Ho_W, m.F_Ho_W);
  d("stiffness", c.stiffness, m.stiffness);
  d("rotational_stiffness", c.rotational_stiffness, m.rotational_stiffness);
  d("validity_radius", c.validity_radius, m.validity_radius);
  d("step_revision", c.step_revision, m.step_revision);
  d("frozen", c.frozen, m.frozen);
  d.list("others", c.others, m.others, kOtherPulls, kStructs);
  d.list("contacts", c.contacts, m.contacts, kManifoldContacts, kStructs);
  d.list("bodies", c.bodies, m.bodies, kManifoldBodies, kStructs);
}
void fields(auto& d, auto& c, Is<HandState> auto& m) {
  d("hand", c.hand_id, m.hand);
  d("seq", c.seq, m.seq);
  fields(d, c.X_WH, m.X_WH);
  d("p_WC", c.p_WC, m.p_WC);
  fields(d, c.X_WO_local, m.X_WO_local);
  fields(d, c.F_Ho_W, m.F_Ho_W);
  d("manifold_age", c.manifold_age, m.manifold_age);
  d("safety_flags", c.safety_flags, m.safety_flags);
  d("indexing", c.indexing, m.indexing);
  d("tactors", c.tactors, m.tactors);
  d("peak_force", c.peak_force, m.peak_force);
  d("guidance_force", c.guidance_force, m.guidance_force);
}
void fields(auto& d, auto& c, Is<ContactPairs> auto& m) {
  d("part", c.part, m.part);
  d("parts", c.parts, m.parts);
  d("tick", c.tick, m.tick);
  d.list("pairs", c.pairs, m.pairs, kPairsPerSample, kStructs);
}
void fields(auto& d, auto& c, Is<TickStats> auto& m) {
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("tick", c.tick, m.tick);
  d("load_percent", c.load_percent, m.load_percent);
  d("compute_seconds", c.compute_seconds, m.compute_seconds);
  d("compute_seconds_max", c.compute_seconds_max, m.compute_seconds_max);
  d("late_ticks", c.late_ticks, m.late_ticks);
  d("active_pairs", c.active_pairs, m.active_pairs);
  d("queried_pairs", c.queried_pairs, m.queried_pairs);
  d("points_visited", c.points_visited, m.points_visited);
  d("input_age_seconds", c.input_age_seconds, m.input_age_seconds);
  d("state_hash", c.state_hash, m.state_hash);
  d("slow_writes", c.slow_writes, m.slow_writes);
  d("unsent_samples", c.unsent_samples, m.unsent_samples);
}
void fields(auto& d, auto& c, Is<Guidance> auto& m) {
  d("hand", c.hand_id, m.hand);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("tick", c.tick, m.tick);
  d("choice", c.choice, m.choice);
  d("mode", c.mode, m.mode);
  d("kind", c.kind, m.kind);
  d("guide", c.guide_hand_id, m.guide);
  fields(d, c.X_WF, m.X_WF);
  d("radius", c.radius, m.radius);
  d("stiffness", c.stiffness, m.stiffness);
  d("rotational_stiffness", c.rotational_stiffness, m.rotational_stiffness);
  d("damping", c.damping, m.damping);
}
void fields(auto& d, auto& c, Is<ForceContribution> auto& m) {
  d("source", c.source, m.source);
  d("client", c.client_id, m.client);
  d("object", c.object_id, m.object);
  fields(d, c.F_Oo_W, m.F_Oo_W);
  d("lifetime_ticks", c.lifetime_ticks, m.lifetime_ticks);
}
void fields(auto& d, auto& c, Is<ExternalPose> auto& m) {
  d("object", c.object_id, m.object);
  d("client", c.client_id, m.client);
  fields(d, c.X_WO, m.X_WO);
  d("lifetime_ticks", c.lifetime_ticks, m.lifetime_ticks);
}
void fields(auto& d, auto& c, Is<ClockSync> auto& m) {
  d("client", c.client_id, m.client);
  d("sent_ns", c.sent_ns, m.sent_ns);
  d("server_received_ns", c.server_received_ns, m.server_received_ns);
  d("server_sent_ns", c.server_sent_ns, m.server_sent_ns);
  d("inputs_received", c.inputs_received, m.inputs_received);
  d("inputs_replaced", c.inputs_replaced, m.inputs_replaced);
  d("ticks_without_input", c.ticks_without_input, m.ticks_without_input);
  d("newest_seq", c.newest_seq, m.newest_seq);
  d("longest_gap", c.longest_gap, m.longest_gap);
}
void fields(auto& d, auto& c, Is<Telemetry> auto& m) {
  d("client", c.client_id, m.client);
  d("input_to_force_p50", c.input_to_force_p50, m.input_to_force_p50);
  d("input_to_force_p99", c.input_to_force_p99, m.input_to_force_p99);
  d("input_to_force_max", c.input_to_force_max, m.input_to_force_max);
  d("inputs_replaced", c.inputs_replaced, m.inputs_replaced);
  d("ticks_without_input", c.ticks_without_input, m.ticks_without_input);
  d("input_gap", c.input_gap, m.input_gap);
  d("trip_jitter", c.trip_jitter, m.trip_jitter);
  d("freeze_ticks", c.freeze_ticks, m.limits.freeze_ticks);
  d("park_ticks", c.park_ticks, m.limits.park_ticks);
  d("playout_ticks", c.playout_ticks, m.playout_ticks);
  d("loop_late_p99", c.loop_late_p99, m.loop_late_p99);
  d("loop_overruns", c.loop_overruns, m.loop_overruns);
  d("samples", c.samples, m.samples);
  d("age", c.age, m.age);
  d("jitter", c.jitter, m.jitter);
  d("answers_lost", c.answers_lost, m.answers_lost);
  d("answers_replaced", c.answers_replaced, m.answers_replaced);
  d("inputs_lost", c.inputs_lost, m.inputs_lost);
  d("guidance_alone", c.guidance_alone, m.guidance_alone);
  d("clock_known", c.clock_known, m.clock_known);
  d("clock_offset", c.clock_offset, m.clock_offset);
  d("clock_error", c.clock_error, m.clock_error);
  d("round_trip", c.round_trip, m.round_trip);
  d("longest_silence", c.longest_silence, m.longest_silence);
}
void fields(auto& d, auto& c, Is<SceneObject> auto& m) {
  d("object", c.object_id, m.object);
  d("name", c.name, m.name);
  d("title", c.title, m.title);
  d("kind", c.kind, m.kind);
  d("structure_hash", c.structure_hash, m.structure_hash);
  d("color", c.color, m.color);
  fields(d, c.X_WO, m.X_WO);
  d("size", c.size, m.size);
  d("centre", c.centre, m.centre);
  d.list("titles", c.titles, m.titles, 3, kStructs);
}
void fields(auto& d, auto& c, Is<SceneHand> auto& m) {
  d("hand", c.hand_id, m.hand);
  d("name", c.name, m.name);
  d("role", c.role, m.role);
  d("object", c.object_id, m.object);
  d("freeze_ticks", c.freeze_ticks, m.limits.freeze_ticks);
  d("park_ticks", c.park_ticks, m.limits.park_ticks);
  d("guidance_alone", c.guidance_alone, m.guidance_alone);
}
void fields(auto& d, auto& c, Is<SceneStep> auto& m) {
  d("step", c.step, m.step);
  d("steps", c.steps, m.steps);
  d("name", c.name, m.name);
  d.list("title", c.title, m.title, 3, kStructs);
  d("part", c.part, m.part);
}
void fields(auto& d, auto& c, Is<SceneTitle> auto& m) { d.list("titles", c.titles, m.titles, 3, kStructs); }
void fields(auto& d, auto& c, Is<SceneSignal> auto& m) {
  d("signal", c.signal, m.signal);
  d("name", c.name, m.name);
}
void fields(auto& d, auto& c, Is<ObjectSnapshot> auto& m) {
  d("tick", c.tick, m.tick);
  fields(d, c.state, m.state);
  d("object", c.object_id, m.state.object);  // last: the samples of ended instances have only this key
}
void fields(auto& d, auto& c, Is<StepState> auto& m) {
  d("revision", c.revision, m.revision);
  d("step", c.step, m.step);
  d("steps", c.steps, m.steps);
  d("name", c.name, m.name);
  d.list("title", c.title, m.title, 3, kStructs);
  d.list("instruction", c.instruction, m.instruction, 3, kStructs);
  d("phase", c.phase, m.phase);
  d("part", c.part, m.part);
  d("object", c.object_id, m.object);
  d("hand", c.hand_id, m.hand);
  d("touch", c.touch_id, m.touch);
  d("has_target", c.has_target, m.has_target);
  fields(d, c.X_WG, m.X_WG);
  d("approach_W", c.approach_W, m.approach_W);
  d("approach_distance", c.approach_distance, m.approach_distance);
  d("tolerance", c.tolerance, m.tolerance);
  d("angle_tolerance", c.angle_tolerance, m.angle_tolerance);
  d("timeout", c.timeout, m.timeout);
  d("started", c.started, m.started);
}
void fields(auto& d, auto& c, Is<StepProgress> auto& m) {
  d("revision", c.revision, m.revision);
  d("tick", c.tick, m.tick);
  d("position_error", c.position_error, m.position_error);
  d("angle_error", c.angle_error, m.angle_error);
  d("contact_seconds", c.contact_seconds, m.contact_seconds);
  d("nodes", c.nodes, m.nodes);
  d.list("conditions", c.conditions, m.conditions, kMostConditionsTold, kStructs);
}
void fields(auto& d, auto& c, Is<RunState> auto& m) {
  d("phase", c.phase, m.phase);
  d("tick", c.tick, m.tick);
  d("reason", c.reason, m.reason);
  d("final_hash", c.final_hash, m.final_hash);
  d("server_epoch", c.server_epoch, m.server_epoch);
  d("steps_skipped", c.steps_skipped, m.steps_skipped);
  d("steps_timed_out", c.steps_timed_out, m.steps_timed_out);
  d("forces_frozen", c.forces_frozen, m.forces_frozen);
  d("emergency_stop", c.emergency_stop, m.emergency_stop);
  d("open_commands", c.open_commands, m.open_commands);
}
void fields(auto& d, auto& c, Is<CollisionMatrix> auto& m) {
  d("part", c.part, m.part);
  d("parts", c.parts, m.parts);
  d("tick", c.tick, m.tick);
  d.bytes("bits", c.bits, m.bits, kMatrixBytes);
}
void fields(auto& d, auto& c, Is<GrabState> auto& m) {
  d("object", c.object_id, m.object);
  d("hand", c.hand_id, m.hand);
  d("epoch", c.epoch, m.epoch);
  fields(d, c.X_HO, m.X_HO);
  d("tick", c.tick, m.tick);
}
void fields(auto& d, auto& c, Is<RecorderStatus> auto& m) {
  d("file", c.file, m.file);
  d("recording", c.recording, m.recording);
  d("messages", c.messages, m.messages);
  d("lost", c.lost, m.lost);
  d("problem", c.problem, m.problem);
}
void fields(auto& d, auto& c, Is<NewestRaise> auto& m) {
  d("number", c.number, m.number);
  d("standing", c.standing, m.standing);
  d("who", c.who, m.who);
  d("reason", c.reason, m.reason);
}
template <class M>
concept StopMessage = Is<M, EmergencyStop> || Is<M, EmergencyClear>;
void fields(auto& d, auto& c, StopMessage auto& m) {
  d("client_guid", c.client_guid, m.client_guid);
  d("counter", c.counter, m.counter);
  d("who", c.who, m.who);
  d("reason", c.reason, m.reason);
}
void fields(auto& d, auto& c, Is<Command> auto& m) {
  d("client", c.client_id, m.client);
  d("id", c.id, m.id);
  d("kind", c.kind, m.kind);
  d("hand", c.hand_id, m.hand);
  d("text", c.text, m.text);
  d("value", c.value, m.value);
}
void fields(auto& d, auto& c, Is<CommandAck> auto& m) {
  d("client", c.client_id, m.client);
  d("id", c.id, m.id);
  d("accepted", c.accepted, m.accepted);
  d("reason", c.reason, m.reason);
  d("refusal", c.refusal, m.refusal);
}
void fields(auto& d, auto& c, Is<EventLog> auto& m) {
  d("seq", c.seq, m.seq);
  d("tick", c.tick, m.tick);
  d("severity", c.severity, m.severity);
  d("kind", c.kind, m.kind);
  d("text", c.text, m.text);
}
void fields(auto& d, auto& c, Is<ClientEvent> auto& m) {
  d("client", c.client_id, m.client);
  d("seq", c.seq, m.seq);
  d("tick", c.tick, m.tick);
  d("kind", c.kind, m.kind);
  d("text", c.text, m.text);
}
void fields(auto& d, auto& c, Is<PublishedSamples> auto& m) {
  d("first_tick", c.first_tick, m.first_tick);
  d("last_tick", c.last_tick, m.last_tick);
  d.list("topics", c.topics, m.topics, 16, kStructs);
}
template <class M>
concept JournalPart = Is<M, TickInputPart> || Is<M, CheckpointPart>;
void fields(auto& d, auto& c, JournalPart auto& m) {
  d("tick", c.tick, m.tick);
  d("part", c.part, m.part);
  d("parts", c.parts, m.parts);
  d("state_hash", c.state_hash, m.state_hash);
  d.bytes("bytes", c.bytes, m.bytes, 1100);
}

}  // namespace tenon::wire
