#include "clients/report/recording_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <set>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "idl/record/mcap_reader.h"
#include "idl/record/recording_kind.h"
#include "idl/types/messages/commands.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/external.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/timing.h"
#include "idl/types/names.h"
#include "idl/types/stop_truth.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon::report {
namespace {

// A contact is assumed to continue for so long; a pair in contact is published every 10 ticks.
constexpr Tick kContactHold = 20;  // [ticks]

/// How many events a station's entry stands for: ", 28 times, step 4000" at its end.
int timesOf(std::string_view text) {
  const std::size_t end = text.rfind(" times, step ");
  if (end == std::string_view::npos) return 1;
  const std::size_t comma = text.rfind(", ", end);
  if (comma == std::string_view::npos) return 1;
  int times = 1;
  const auto read = std::from_chars(text.data() + comma + 2, text.data() + end, times);
  return read.ec == std::errc{} && read.ptr == text.data() + end ? std::max(1, times) : 1;
}

class RecordingReader {
 public:
  explicit RecordingReader(RecordedSession& session) : session_(session) {
    subscribe<SessionAnnounce>(wire::kSessionAnnounce);
    subscribe<Presence>(wire::kPresence);
    subscribe<SceneObject>(wire::kSceneObject);
    subscribe<WorldFrame>(wire::kWorldFrame100);
    subscribe<SceneHand>(wire::kSceneHand);
    subscribe<DeviceInput>(wire::kDeviceInput);
    subscribe<HandManifold>(wire::kHandManifold);
    subscribe<HandState>(wire::kHandState100);
    subscribe<ContactPairs>(wire::kContactPairs100);
    subscribe<TickStats>(wire::kTickStats100);
    subscribe<StepState>(wire::kStepState);
    subscribe<StepProgress>(wire::kStepProgress);
    subscribe<RunState>(wire::kRunState);
    subscribe<EventLog>(wire::kEventLog);
    subscribe<ClientEvent>(wire::kClientEvent);
    subscribe<EmergencyStop>(wire::kEmergencyStop);
    subscribe<EmergencyClear>(wire::kEmergencyClear);
    subscribe<Telemetry>(wire::kTelemetry);
    subscribe<Guidance>(wire::kGuidance);
    subscribe<ForceContribution>(wire::kForceContribution);
    subscribe<PublishedSamples>(wire::kPublishedSamples);
  }

  void read(const record::McapMessage& message) {
    ++session_.messages;
    if (session_.began_ns == 0) session_.began_ns = message.log_time_ns;
    const auto handler = handlers_.find(message.topic);
    if (handler != handlers_.end()) handler->second(message.data);
  }
  /// After the last message.
  void finish() {
    for (auto& [client, latency] : session_.force_latencies) latency.freeze_ticks = granted_[client];
  }

 private:
  template <class M>
  void subscribe(const wire::Topic<M>& topic) {
    handlers_[topic.name] = [this](std::span<const std::uint8_t> bytes) {
      const auto message = wire::decode<M>(bytes);
      if (!message) {
        ++session_.malformed;
        return;
      }
      receive(*message);
    };
  }

  void receive(const SessionAnnounce& announce) { session_.announce = announce; }
  void receive(const Presence& presence);
  void receive(const SceneObject& object);
  void receive(const SceneHand& hand) {
    freezes_[hand.hand] = hand.limits.freeze_ticks;
    for (const auto& [client, presence] : session_.present) noteLimits(presence);
  }
  void noteLimits(const Presence& presence) {
    if (!presence.alive) return;
    std::uint32_t& longest = granted_[presence.client];
    for (const HandId hand : presence.hands) longest = std::max(longest, freezes_[hand]);
  }
  void receive(const WorldFrame& frame);
  void receive(const DeviceInput& input) { session_.hands[input.hand].add(input); }
  void receive(const HandManifold& manifold) {
    advanceTo(manifold.tick);
    session_.coverage.addManifold(manifold.hand, manifold.tick);
    session_.hands[manifold.hand].add(manifold);
  }
  void receive(const HandState& state) {
    session_.indexed = session_.indexed || state.indexing;
    session_.hands[state.hand].add(state);
  }
  void receive(const ContactPairs& pairs);
  void receive(const TickStats& stats);
  void receive(const StepState& step) { session_.steps.push_back(step); }
  void receive(const StepProgress& progress);
  void receive(const RunState& run) {
    advanceTo(run.tick);
    session_.run = run;
    session_.has_run = true;
    session_.clock.add(run);
  }
  void receive(const EventLog& event) {
    session_.events.push_back({secondsOf(event.tick), event.severity, event.kind, event.text});
    if (event.kind == "command") countCommand(event.text, 1);
    if (event.kind == "dropped") countCommand(event.text, -1);
  }
  void receive(const ClientEvent& event) {
    // a station names its devices again from time to time, for those that come late
    if (event.kind == "device" && !devices_.emplace(event.client.value, event.text).second) return;
    const Severity severity = event.kind == "safety" ? Severity::kWarning : Severity::kInfo;
    session_.client_events.push_back(
        {secondsOf(event.tick), severity, event.kind, event.text, timesOf(event.text)});
  }
  void receive(const EmergencyStop& stop) {
    if (stops_.raise(stop)) addStop(Severity::kError, "raised", stop.who, stop.reason);
  }
  void receive(const EmergencyClear& cleared) {
    if (stops_.clear(cleared)) addStop(Severity::kInfo, "cleared", cleared.who, cleared.reason);
  }
  void addStop(Severity severity, std::string_view what, const std::string& who, const std::string& reason) {
    session_.events.push_back({secondsOf(session_.last), severity, "emergency stop",
                               fmt::format("{} by {}: {}", what, who, reason)});
  }
  void receive(const Telemetry& telemetry);
  void receive(const Guidance& guidance) {
    session_.guided = session_.guided || guidance.mode != GuidanceMode::kOff;
  }
  void receive(const ForceContribution&) { session_.external_force = true; }
  void receive(const PublishedSamples& published) { session_.coverage.add(published); }
  void countCommand(const std::string& text, int times);

  [[nodiscard]] bool isOfAHand(ObjectId object);
  void advanceTo(Tick tick) { session_.last = std::max(session_.last, tick); }

  RecordedSession& session_;
  StopTruth stops_;
  std::set<std::pair<std::uint32_t, std::string>> devices_;  ///< client and text
  std::map<std::string_view, std::function<void(std::span<const std::uint8_t>)>> handlers_;
  std::map<ObjectId, std::string> kinds_;
  std::map<HandId, std::uint32_t> freezes_;    ///< [ticks] in force
  std::map<ClientId, std::uint32_t> granted_;  ///< [ticks] longest freeze of its hands
};

void RecordingReader::receive(const Presence& presence) {
  if (!presence.client.valid()) return;
  if (!session_.present.contains(presence.client))
    session_.participants.push_back({presence.name, presence.role});
  session_.present[presence.client] = presence;
  for (const HandId hand : presence.hands) session_.hands[hand].role = presence.role;
  noteLimits(presence);
}

/// Whether a hand has the object by itself: it is no part of the exercise.
bool RecordingReader::isOfAHand(ObjectId object) {
  const std::string& kind = kinds_[object];
  return kind == "pointer" || kind == "assistant" || kind == "forearm" || kind == "head";
}

void RecordingReader::receive(const SceneObject& object) {
  kinds_[object.object] = object.kind;
  if (isOfAHand(object.object)) session_.own_titles.insert(object.title.empty() ? object.name : object.title);
}

void RecordingReader::receive(const WorldFrame& frame) {
  advanceTo(frame.tick);
  session_.coverage.addSample(wire::kWorldFrame100.name, frame.tick);
  for (const ObjectState& state : frame.states)
    session_.positions[state.object].push_back(
        {frame.tick, state.epoch, state.X_WO.translation().cast<float>()});
}

void RecordingReader::receive(const ContactPairs& pairs) {
  constexpr double kSampleSeconds = 0.01;
  advanceTo(pairs.tick);
  session_.coverage.addSample(wire::kContactPairs100.name, pairs.tick);
  double depth = 0.0;
  bool assisted = false;
  for (const PairContact& pair : pairs.pairs) {
    depth = std::max({depth, pair.depth, pair.peak_depth});
    if (!pair.colliding) continue;
    session_.contacts[pair.a].push_back(pairs.tick);
    session_.contacts[pair.b].push_back(pairs.tick);
    if (!isOfAHand(pair.a) && !isOfAHand(pair.b)) {
      session_.collisions[pair.a].push_back(pairs.tick);
      session_.collisions[pair.b].push_back(pairs.tick);
    }
    assisted = assisted || kinds_[pair.a] == "assistant" || kinds_[pair.b] == "assistant";
  }
  addPoint(session_.depth, pairs.tick, depth);
  if (assisted) session_.assisted_seconds += kSampleSeconds;
}

void RecordingReader::receive(const TickStats& stats) {
  advanceTo(stats.tick);
  session_.coverage.addSample(wire::kTickStats100.name, stats.tick);
  addPoint(session_.load, stats.tick, stats.load_percent);
  addPoint(session_.depth, stats.tick, 0.0);  // pairs apart are not published
  addPoint(session_.compute, stats.tick, stats.compute_seconds);
  addPoint(session_.compute_max, stats.tick, std::max(stats.compute_seconds, stats.compute_seconds_max));
  session_.late_ticks = std::max(session_.late_ticks, stats.late_ticks);
  session_.slow_writes = std::max(session_.slow_writes, stats.slow_writes);
  session_.unsent_samples = std::max(session_.unsent_samples, stats.unsent_samples);
  if (std::isfinite(stats.input_age_seconds))
    session_.input_age = std::max(session_.input_age, stats.input_age_seconds);
}

void RecordingReader::receive(const StepProgress& progress) {
  advanceTo(progress.tick);
  double& longest = session_.contact_seconds[progress.revision];
  if (std::isfinite(progress.contact_seconds)) longest = std::max(longest, progress.contact_seconds);
  session_.measures[progress.revision] = {progress.tick, {progress.position_error, progress.angle_error}};
}

void RecordingReader::receive(const Telemetry& telemetry) {
  if (telemetry.samples == 0) return;
  ForceLatency& latency = session_.force_latencies[telemetry.client];
  latency.p50 = telemetry.input_to_force_p50;
  latency.p99 = telemetry.input_to_force_p99;
  latency.max = std::max(latency.max, telemetry.input_to_force_max);
  latency.silence = std::max(latency.silence, telemetry.longest_silence);
  latency.jitter = std::max(latency.jitter, telemetry.jitter);
  const double share = 1.0 / static_cast<double>(++latency.statements);
  latency.inputs_lost += share * (telemetry.inputs_lost - latency.inputs_lost);
  latency.answers_lost += share * (telemetry.answers_lost - latency.answers_lost);
  latency.inputs_replaced += share * (telemetry.inputs_replaced - latency.inputs_replaced);
  latency.answers_replaced += share * (telemetry.answers_replaced - latency.answers_replaced);
  latency.guidance_alone += share * ((telemetry.guidance_alone ? 1.0 : 0.0) - latency.guidance_alone);
  latency.ticks_without_input += share * (telemetry.ticks_without_input - latency.ticks_without_input);
  if (!telemetry.clock_known) return;
  latency.clock_known = true;
  latency.round_trip = telemetry.round_trip;
  latency.clock_offset = telemetry.clock_offset;
  latency.clock_error = telemetry.clock_error;
}

/// "NAME: WORD ...": a command that the server has accepted; -1 `times`: and dropped.
void RecordingReader::countCommand(const std::string& text, int times) {
  static const std::map<CommandKind, std::string> kAids{
      {CommandKind::kFulfilled, "condition confirmed by a person"},
      {CommandKind::kSkipStep, "step skipped"},
      {CommandKind::kGoToStep, "led to a step"},
      {CommandKind::kBack, "led back a step"},
      {CommandKind::kRepeatStep, "step repeated"},
      {CommandKind::kHandOver, "object handed over"},
      {CommandKind::kPause, "paused"},
      {CommandKind::kReset, "exercise reset"},
      {CommandKind::kSwapHands, "hands swapped"},
      {CommandKind::kSetCollision, "collisions of two objects changed"}};
  for (const auto& [kind, aid] : kAids) {
    const std::string word = ": " + std::string(commandName(kind));
    if (text.ends_with(word) || text.find(word + " ") != std::string::npos) session_.commands[aid] += times;
  }
}

/// "12 of 15" by topic, as a recorder writes at its end.
std::map<std::string, SampleCount> readCounts(const record::McapReader& recording) {
  std::map<std::string, SampleCount> counts;
  const auto [begin, end] = recording.metadata().equal_range("tenon samples");
  for (auto samples = begin; samples != end; ++samples)
    for (const auto& [topic, text] : samples->second) {
      SampleCount& count = counts[topic];
      const char* const last = text.data() + text.size();
      const auto recorded = std::from_chars(text.data(), last, count.recorded);
      constexpr std::string_view kOf = " of ";
      const std::string_view rest(recorded.ptr, static_cast<std::size_t>(last - recorded.ptr));
      if (rest.starts_with(kOf)) std::from_chars(recorded.ptr + kOf.size(), last, count.published);
    }
  return counts;
}

}  // namespace

bool RecordedSession::touches(ObjectId object, Tick tick) const {
  const auto of_object = contacts.find(object);
  if (of_object == contacts.end()) return false;
  const std::vector<Tick>& ticks = of_object->second;
  const auto after = std::upper_bound(ticks.begin(), ticks.end(), tick);
  return after != ticks.begin() && *std::prev(after) + kContactHold >= tick;
}

Result<RecordedSession> readRecording(const std::filesystem::path& file) {
  auto recording = record::McapReader::open(file);
  if (!recording) return fail(recording.error().what);
  if (std::string refusal = record::refusalOfKind(*recording, file);
      !refusal.empty() && !recording->channels().empty())
    return fail(std::move(refusal));
  RecordedSession session;
  RecordingReader reader(session);
  for (record::McapMessage message; recording->next(message);) reader.read(message);
  reader.finish();
  session.problem = recording->problem();
  session.counts = readCounts(*recording);
  if (session.messages == 0)
    return fail(file.string() + ": holds no messages" +
                (session.problem.empty() ? "" : " (" + session.problem + ")"));
  for (auto& [object, ticks] : session.contacts) std::sort(ticks.begin(), ticks.end());
  for (auto& [object, ticks] : session.collisions) std::sort(ticks.begin(), ticks.end());
  for (auto& [object, path] : session.positions)
    std::stable_sort(path.begin(), path.end(),
                     [](const PathPoint& a, const PathPoint& b) { return a.tick < b.tick; });
  return session;
}

}  // namespace tenon::report
