#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "idl/record/mcap_writer.h"
#include "idl/types/messages/commands.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "idl/types/messages/timing.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon::test {

/// Parameters of a synthetic session.
struct SyntheticSession {
  bool succeeds = true;
  bool skips_a_step = false;
  bool leaves_a_step = false;  ///< the second one, by `goto`
  bool pauses = false;         ///< for the second quarter of the second step
  std::uint32_t steps = 4;
  Tick ticks_per_step = 2000;
  double peak_force = 18.0;    ///< [N] in the last step, for one tick
  bool leaves_no_end = false;  ///< of the first step: it was skipped, and neither message nor event say so
  bool skip_is_in_the_log = false;          ///< with leaves_no_end: the event does
  std::set<std::string, std::less<>> lost;  ///< topics of which the second step has no samples
  bool states_losses = false;               ///< the recorder has ended and written its own counts
  bool arrives_by_topic = false;  ///< topics reach the recorder one after the other, not tick by tick
};

/// Writes the recording of a synthetic session: a trainee takes and inserts parts with contact in each step,
/// and an instructor helps in one. All its numbers are known.
class SyntheticRecording {
 public:
  SyntheticRecording(const std::filesystem::path& file, const SyntheticSession& parameters)
      : parameters_(parameters), writer_(std::move(*record::McapWriter::open(file))) {
    put(wire::kSessionAnnounce, SessionAnnounce{.session = "demo", .title = "Engine <bay>"});
    put(wire::kPresence,
        Presence{.client = ClientId{1}, .name = "Grace", .role = Role::kTrainee, .hands = {HandId{0}}});
    put(wire::kPresence,
        Presence{.client = ClientId{2}, .name = "Mikel", .role = Role::kInstructor, .hands = {HandId{1}}});
    put(wire::kSceneHand, SceneHand{.hand = HandId{0}, .name = "right", .limits = {.freeze_ticks = 80}});
    put(wire::kSceneObject, SceneObject{.object = ObjectId{0}, .name = "bay", .kind = "scene"});
    put(wire::kSceneObject, SceneObject{.object = ObjectId{2}, .name = "cube", .kind = "assistant"});
    put(wire::kEventLog, EventLog{8, 0, Severity::kInfo, "taken", "cube (instructor hand)"});
    std::uint64_t seq = 0;
    for (const auto& [kind, text] :
         {std::pair{"device", "hand right: HUG, workspace radius 0.400 m"},
          std::pair{"station", "hand right: ahead of the contact set (2 ms in total), step 400"},
          std::pair{"station", "hand right: ahead of the contact set (40 ms in total), 28 times, step 1400"},
          std::pair{"device", "hand right: HUG, workspace radius 0.400 m"}})
      put(wire::kClientEvent, ClientEvent{ClientId{1}, ++seq, 8, kind, text});
    const Tick end = parameters_.ticks_per_step * parameters_.steps;
    for (tick_ = 1; tick_ <= end; ++tick_) tick();
    put(wire::kTelemetry, Telemetry{.client = ClientId{1},
                                    .input_to_force_p50 = 0.003,
                                    .input_to_force_p99 = 0.006,
                                    .input_to_force_max = 0.011,
                                    .limits = {.freeze_ticks = 120},
                                    .samples = 1000,
                                    .longest_silence = 0.013});
    put(wire::kRunState,
        RunState{.phase = parameters_.succeeds ? RunPhase::kSucceeded : RunPhase::kFailed,
                 .tick = end,
                 .reason = parameters_.succeeds ? "all steps done" : "a step was not done in time",
                 .final_hash = 0xFEED});
    if (parameters_.arrives_by_topic)
      std::stable_sort(sent_.begin(), sent_.end(),
                       [](const Sent& a, const Sent& b) { return a.topic > b.topic; });
    for (const Sent& sent : sent_) write(sent);
    if (parameters_.states_losses)
      static_cast<void>(
          writer_.addMetadata("tenon samples", {{"TickInput", "100 of 8000"}, {"GrabState", "3 of 3"}}));
    static_cast<void>(writer_.close());
  }

 private:
  struct Sent {
    std::string_view topic;
    std::string_view type;
    Tick tick = 0;
    std::vector<std::uint8_t> bytes;
  };

  template <class M>
  void put(const wire::Topic<M>& topic, const M& message) {
    if (topic.parameters.of_server || topic.qos_class == wire::QosClass::kStream)
      ++published_[std::string(topic.name)];
    const Tick step = tick_ == 0 ? 0 : (tick_ - 1) / parameters_.ticks_per_step;
    if (step == 1 && parameters_.lost.contains(topic.name)) return;
    sent_.push_back({topic.name, wire::typeName<M>(), tick_, *wire::encode(message)});
  }
  void write(const Sent& sent) {
    auto [channel, is_new] = channels_.try_emplace(sent.topic, 0);
    if (is_new) channel->second = writer_.addChannel(sent.topic, sent.type, wire::idlText());
    constexpr std::int64_t kStart = 1'790'000'000'000'000'000;
    static_cast<void>(writer_.write(
        channel->second, kStart + static_cast<std::int64_t>(sent.tick) * 1'000'000, 0, sent.bytes));
  }

  void tick() {
    const Tick in_step = (tick_ - 1) % parameters_.ticks_per_step;
    const auto step = static_cast<std::uint32_t>((tick_ - 1) / parameters_.ticks_per_step);
    if (in_step == 0) beginStep(step);
    if (parameters_.pauses && step == 1 && in_step == parameters_.ticks_per_step / 4)
      put(wire::kRunState, RunState{.phase = RunPhase::kPaused, .tick = tick_});
    if (parameters_.pauses && step == 1 && in_step == parameters_.ticks_per_step / 2)
      put(wire::kRunState, RunState{.phase = RunPhase::kRunning, .tick = tick_});
    // contact in the second half of each step
    const double pressed = std::max(
        0.0, 2.0 * static_cast<double>(in_step) / static_cast<double>(parameters_.ticks_per_step) - 1.0);
    double force = 12.0 * std::sin(3.14159 * pressed) + (pressed > 0.0 ? noise() : 0.0);
    if (tick_ == parameters_.ticks_per_step * parameters_.steps - 1) force = parameters_.peak_force;
    if (tick_ % 10 == 0) addPairs(pressed > 0.0, step, force);
    // a skipped step: the server holds the part still, and the pull of its coupling is no force on a hand
    const bool frozen = parameters_.skips_a_step && step == 0 && in_step > 100 && in_step < 1000;
    if (frozen) force = 248.0;
    manifold(HandId{0}, ObjectId{1}, force, frozen);
    manifold(HandId{1}, ObjectId{2}, step == 2 ? 4.0 * std::sin(3.14159 * pressed) : 0.0);
    if (tick_ % 10 == 0) addFrame(wire::kWorldFrame100, step, in_step);
    if (tick_ % 33 == 0) addFrame(wire::kWorldFrame30, step, in_step);
    if (tick_ % 10 == 0) addStats(pressed);
    if (tick_ % kPublishedSamplesPeriod == 0) statePublished();
    if (tick_ % 33 == 0)
      put(wire::kStepProgress, StepProgress{.revision = step + 1,
                                            .tick = tick_,
                                            .position_error = 0.05 - 0.049 * pressed,
                                            .contact_seconds = 1e-3 * pressed * 1000.0});
  }

  void statePublished() {
    PublishedSamples published{tick_ + 1 - kPublishedSamplesPeriod, tick_, {}};
    for (const auto topic : {wire::kWorldFrame100.name, wire::kContactPairs100.name, wire::kTickStats100.name,
                             wire::kHandManifold.name})
      published.topics.push_back({std::string(topic), published_[std::string(topic)]});
    published_.clear();
    put(wire::kPublishedSamples, published);
  }

  void beginStep(std::uint32_t step) {
    if (step > 0 && !parameters_.leaves_a_step && !(parameters_.skips_a_step && step == 1) &&
        !(parameters_.leaves_no_end && step == 1))
      put(wire::kEventLog, EventLog{40 + step, tick_, Severity::kInfo, "step done",
                                    "step_" + std::to_string(step - 1) + " (2.0 s)"});
    if (parameters_.skip_is_in_the_log && step == 1)
      put(wire::kEventLog, EventLog{50, tick_, Severity::kInfo, "step skipped", "step_0 (2.0 s)"});
    if (parameters_.skips_a_step && step == 1) put(wire::kStepState, stepState(0, StepPhase::kSkipped));
    put(wire::kStepState, stepState(step, StepPhase::kActive));
    if (parameters_.leaves_a_step && step > 0 && step != 2)
      put(wire::kEventLog, EventLog{20 + step, tick_, Severity::kInfo, "step done",
                                    "step_" + std::to_string(step - 1) + " (2.0 s)"});
    if (parameters_.leaves_a_step && step == 2) {
      put(wire::kEventLog, EventLog{30, tick_, Severity::kInfo, "command", "Mikel: goto 3"});
      put(wire::kEventLog, EventLog{31, tick_, Severity::kInfo, "command", "Mikel: reset"});
      put(wire::kEventLog, EventLog{32, tick_, Severity::kWarning, "dropped", "Mikel: reset (a stop)"});
      put(wire::kCommand, Command{.client = ClientId{1}, .id = 1, .kind = CommandKind::kSkipStep});
    }
    if (step > 0)
      put(wire::kEventLog, EventLog{step, tick_, Severity::kInfo, "mounted", "Part " + std::to_string(step)});
    if (step == 2)
      put(wire::kEventLog,
          EventLog{9, tick_ + 900, Severity::kWarning, "hand frozen", "hand 'right' is held still"});
  }
  StepState stepState(std::uint32_t step, StepPhase phase) const {
    return {
        .revision = step + 1,
        .step = step,
        .steps = parameters_.steps,
        .name = "step_" + std::to_string(step),
        .title = {{"de", "Teil einsetzen"}, {"en", step % 2 == 0 ? "Take the control box" : "Slide it in"}},
        .phase = phase,
        .part = "Control box",
        .object = ObjectId{1},
        .has_target = true,
        .tolerance = 0.002,
        .started = step * parameters_.ticks_per_step};
  }
  /// `force` [N] on the hand.
  void manifold(HandId hand, ObjectId object, double force, bool frozen = false) {
    HandManifold m;
    m.answers_seq = static_cast<std::uint32_t>(tick_);
    m.frozen = frozen;
    m.hand = hand;
    m.object = object;
    m.tick = tick_;
    m.stiffness = 1000.0;
    m.F_Ho_W.force = Vector3(0.0, 0.0, force);
    put(wire::kHandManifold, m);
    // the device shows half of it: what the safety layer lets through
    const double displayed = 0.5 * force;
    peaks_[hand] = std::max(peaks_[hand], static_cast<float>(std::abs(displayed)));
    if (tick_ % 10 != 0) return;
    HandState state;
    state.hand = hand;
    state.seq = m.answers_seq;
    state.F_Ho_W.force = Vector3(0.0, 0.0, displayed);
    state.peak_force = std::exchange(peaks_[hand], 0.0F);
    put(wire::kHandState100, state);
  }
  /// The part moves by 1 m a second in the first half of each step, and jumps back where the step begins.
  void addFrame(const wire::Topic<WorldFrame>& topic, std::uint32_t step, Tick in_step) {
    WorldFrame frame{.part = 0, .parts = 1, .tick = tick_};
    ObjectState part{.object = ObjectId{1}, .epoch = step};
    part.X_WO.translation().x() =
        1e-3 * static_cast<double>(std::min(in_step, parameters_.ticks_per_step / 2));
    frame.states.push_back(part);
    put(topic, frame);
  }
  /// `force` [N] sets the penetration depth of the pair.
  void addPairs(bool colliding, std::uint32_t step, double force) {
    ContactPairs pairs;
    pairs.tick = tick_;
    PairContact part;
    part.a = ObjectId{1};
    part.b = ObjectId{0};
    part.colliding = colliding;
    part.peak_depth = colliding ? 0.00004 * std::abs(force) : 0.0;
    if (colliding) pairs.pairs.push_back(part);
    if (colliding && step == 2)
      pairs.pairs.push_back({.a = ObjectId{2}, .b = ObjectId{1}, .colliding = true});
    if (!pairs.pairs.empty()) put(wire::kContactPairs100, pairs);
  }
  /// `pressed` [-]: how far the contact of the step is over, 0 to 1.
  void addStats(double pressed) {
    TickStats stats;
    stats.tick = tick_;
    stats.load_percent = 3.0 + 60.0 * pressed;
    stats.compute_seconds = 2e-4 + 3e-4 * pressed + 2e-5 * std::abs(noise());
    stats.compute_seconds_max = stats.compute_seconds + (tick_ == 3000 ? 7e-3 : 5e-5);
    stats.late_ticks = tick_ >= 3000 ? 2 : 0;
    stats.input_age_seconds = 0.002;
    stats.slow_writes = tick_ >= 3000 ? 3 : 0;
    stats.unsent_samples = tick_ >= 3000 ? 4 : 0;
    put(wire::kTickStats100, stats);
  }
  double noise() { return 2.0 * static_cast<double>(random_() % 1000) / 1000.0 - 1.0; }

  SyntheticSession parameters_;
  record::McapWriter writer_;
  std::map<std::string_view, std::uint16_t> channels_;
  std::vector<Sent> sent_;
  std::map<std::string, std::uint64_t> published_;  ///< since the last statement
  std::map<HandId, float> peaks_;                   ///< [N] displayed since the last HandState
  Tick tick_ = 0;
  std::mt19937_64 random_{5};
};

}  // namespace tenon::test
