#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <random>
#include <string>

#include "idl/wire/topics.h"

namespace tenon::test {

/// Fills any message with random values: finite numbers, valid and invalid ids, texts and lists up to their
/// bounds. With `full`, all texts and lists have their maximum length.
///
/// Threads: one. Real-time: no.
class RandomMessages {
 public:
  explicit RandomMessages(std::uint64_t seed, bool full = false) : random_(seed), full_(full) {}

  template <class M>
  M make() {
    M m;
    fill(m);
    return m;
  }

 private:
  std::uint32_t below(std::uint32_t bound) { return static_cast<std::uint32_t>(random_() % bound); }
  std::size_t upTo(std::size_t max) { return full_ ? max : random_() % (max + 1); }

  void fill(bool& x) { x = below(2) == 1; }
  void fill(std::uint8_t& x) { x = static_cast<std::uint8_t>(below(256)); }
  void fill(std::uint32_t& x) { x = static_cast<std::uint32_t>(random_()); }
  void fill(std::uint64_t& x) { x = random_(); }
  void fill(std::int64_t& x) { x = static_cast<std::int64_t>(random_()); }
  void fill(float& x) {
    do x = std::bit_cast<float>(static_cast<std::uint32_t>(random_()));
    while (!std::isfinite(x));
  }
  void fill(double& x) {
    do x = std::bit_cast<double>(random_());
    while (!std::isfinite(x));
  }
  template <class S, int R>
  void fill(Eigen::Matrix<S, R, 1>& v) {
    for (int i = 0; i < R; ++i) fill(v[i]);
  }
  template <class Tag>
  void fill(Id<Tag>& id) {
    if (below(4) == 0)
      id = {};
    else
      fill(id.value);
  }
  void text(std::string& s, std::size_t max) {
    s.clear();
    for (std::size_t size = upTo(max); s.size() < size;) s += static_cast<char>(1 + below(255));
  }
  void many(auto& list, std::size_t max) {
    list.clear();
    list.resize(upTo(max));
    for (std::size_t i = 0; i < list.size(); ++i) fill(list[i]);
  }
  void names(std::vector<std::string>& list) {
    list.resize(upTo(16));
    for (std::string& name : list) text(name, 31);
  }
  template <class E>
  void oneOf(E& e, E last) {
    e = static_cast<E>(below(static_cast<std::uint32_t>(last) + 1));
  }
  void fill(auto&... all) requires(sizeof...(all) > 1) { (fill(all), ...); }

  void fill(Pose& X) { fill(X.translation(), X.rotation().coeffs()); }
  void fill(Twist& V) { fill(V.linear, V.angular); }
  void fill(Wrench& F) { fill(F.force, F.torque); }
  void fill(DeviceSample& m) { fill(m.seq, m.X_WH, m.V_WH, m.buttons); }
  void fill(ObjectState& m) {
    fill(m.object, m.epoch, m.X_WO, m.V_WO, m.holder, m.in_contact);
    m.status = static_cast<std::uint8_t>(below(5));
  }
  void fill(ManifoldContact& m) { fill(m.other, m.p_BoP_B, m.normal_A, m.offset, m.gap, m.velocity_W); }
  void fill(HandPull& m) { fill(m.hand, m.X_WG, m.p_BoC_B, m.stiffness, m.rotational_stiffness); }
  void fill(PairContact& m) {
    fill(m.a, m.b, m.enabled, m.colliding, m.contacts, m.F_Ao_W, m.p_WP, m.depth, m.gap, m.load_percent,
         m.peak_force, m.peak_depth);
  }
  void fill(ConditionValue& m) {
    text(m.text, 79);
    fill(m.value, m.limit, m.met);
  }
  void texts(std::vector<LocalizedText>& list, std::size_t max) {
    list.resize(upTo(3));
    for (LocalizedText& entry : list) {
      text(entry.language, 7);
      text(entry.text, max);
    }
  }

  void fill(SessionAnnounce& m) {
    text(m.session, 63);
    text(m.title, 127);
    fill(m.protocol_version, m.server_epoch, m.lockstep, m.asset_port);
    text(m.scenario_hash, 31);
    names(m.free_hands);
  }
  void fill(Join& m) {
    text(m.client_guid, 63);
    text(m.name, 63);
    oneOf(m.role, Role::kRecorder);
    names(m.hands);
    text(m.token, 63);
    fill(m.protocol_version);
  }
  void fill(Welcome& m) {
    text(m.client_guid, 63);
    text(m.reason, 255);
    text(m.token, 63);
    many(m.hands, 16);
    fill(m.accepted, m.client, m.server_epoch, m.tick, m.lockstep);
  }
  void fill(Presence& m) {
    text(m.name, 63);
    oneOf(m.role, Role::kRecorder);
    many(m.hands, 16);
    fill(m.client, m.alive);
  }
  void fill(DeviceInput& m) {
    fill(m.hand, m.client, m.server_epoch, m.heard_tick, m.dof_mask, m.active, m.p_WC);
    for (DeviceSample& sample : m.samples) fill(sample);
  }
  void fill(WorldFrame& m) {
    fill(m.part, m.parts, m.server_epoch, m.tick, m.step_revision);
    many(m.states, kStatesPerFrame);
  }
  void fill(HandManifold& m) {
    fill(m.hand, m.server_epoch, m.tick, m.answers_seq, m.object, m.object_epoch, m.X_HO, m.X_WO, m.F_Ho_W,
         m.stiffness, m.rotational_stiffness, m.validity_radius, m.step_revision, m.frozen);
    many(m.others, kOtherPulls);
    many(m.contacts, kManifoldContacts);
  }
  void fill(HandState& m) {
    fill(m.hand, m.seq, m.X_WH, m.p_WC, m.X_WO_local, m.F_Ho_W, m.manifold_age, m.safety_flags, m.indexing);
    for (std::uint8_t& tactor : m.tactors) fill(tactor);
  }
  void fill(ContactPairs& m) {
    fill(m.part, m.parts, m.tick);
    many(m.pairs, kPairsPerSample);
  }
  void fill(TickStats& m) {
    fill(m.server_epoch, m.tick, m.load_percent, m.compute_seconds, m.compute_seconds_max, m.late_ticks,
         m.active_pairs, m.queried_pairs, m.points_visited, m.input_age_seconds, m.state_hash);
  }
  void fill(Guidance& m) { fill(m.hand, m.tick, m.active, m.X_WF, m.stiffness, m.damping); }
  void fill(ForceContribution& m) { fill(m.source, m.client, m.object, m.F_Oo_W, m.lifetime_ticks); }
  void fill(ExternalPose& m) { fill(m.object, m.client, m.X_WO, m.lifetime_ticks); }
  void fill(ClockSync& m) { fill(m.client, m.sent_ns, m.server_received_ns, m.server_sent_ns); }
  void fill(Telemetry& m) {
    fill(m.client, m.input_to_force_p50, m.input_to_force_p99, m.input_to_force_max, m.loop_late_p99,
         m.loop_overruns, m.samples);
  }
  void fill(SceneObject& m) {
    fill(m.object, m.X_WO, m.size, m.centre);
    text(m.name, 63);
    text(m.title, 127);
    text(m.kind, 31);
    text(m.mesh_hash, 71);
    text(m.structure_hash, 71);
    text(m.color, 15);
  }
  void fill(ObjectSnapshot& m) { fill(m.tick, m.state); }
  void fill(StepState& m) {
    fill(m.revision, m.step, m.steps, m.object, m.hand, m.touch, m.has_target, m.X_WG, m.approach_W,
         m.approach_distance, m.tolerance, m.angle_tolerance, m.timeout, m.started);
    text(m.name, 47);
    text(m.part, 47);
    texts(m.title, 71);
    texts(m.instruction, 223);
    oneOf(m.phase, StepPhase::kSkipped);
  }
  void fill(StepProgress& m) {
    fill(m.revision, m.tick, m.position_error, m.angle_error, m.contact_seconds);
    many(m.conditions, 10);
  }
  void fill(RunState& m) {
    oneOf(m.phase, RunPhase::kStopped);
    text(m.reason, 511);
    fill(m.tick, m.final_hash, m.server_epoch);
  }
  void fill(GrabState& m) { fill(m.object, m.hand, m.epoch, m.X_HO, m.tick); }
  void fill(RecorderStatus& m) {
    text(m.file, 511);
    text(m.problem, 511);
    fill(m.recording, m.messages, m.lost);
  }
  void fill(EmergencyStop& m) {
    fill(m.engaged);
    text(m.who, 63);
    text(m.reason, 255);
  }
  void fill(Command& m) {
    oneOf(m.kind, CommandKind::kClearEmergencyStop);
    text(m.text, 255);
    fill(m.client, m.id, m.hand, m.value);
  }
  void fill(CommandAck& m) {
    text(m.reason, 255);
    fill(m.client, m.id, m.accepted);
  }
  void fill(EventLog& m) {
    oneOf(m.severity, Severity::kError);
    text(m.kind, 31);
    text(m.text, 1023);
    fill(m.seq, m.tick);
  }
  void fill(ClientEvent& m) {
    text(m.kind, 31);
    text(m.text, 1023);
    fill(m.client, m.seq);
  }
  void fill(TickInputPart& m) {
    fill(m.tick, m.part, m.parts, m.state_hash);
    many(m.bytes, 1100);
  }
  void fill(CheckpointPart& m) {
    fill(m.tick, m.part, m.parts, m.state_hash);
    many(m.bytes, 1100);
  }

  std::mt19937_64 random_;
  bool full_;
};

}  // namespace tenon::test
