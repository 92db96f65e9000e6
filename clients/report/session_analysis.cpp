#include "clients/report/session_analysis.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <tuple>

#include <fmt/format.h>

#include "idl/record/mcap_reader.h"
#include "idl/types/messages/commands.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/external.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/timing.h"
#include "idl/types/stop_truth.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon::report {
namespace {

// A contact is assumed to go on for so long; a pair in contact is published every 10 ticks.
constexpr Tick kContactHold = 20;  // [ticks]

double seconds(Tick tick) { return static_cast<double>(tick) * kTickSeconds; }

/// Number of an input, and how often the numbers of its hand had begun anew before (with a new station).
struct InputNumber {
  std::uint32_t beginnings = 0;
  std::uint32_t seq = 0;

  auto operator<=>(const InputNumber&) const = default;
  [[nodiscard]] InputNumber followedBy(std::uint32_t next) const {
    return {beginnings + (next < seq ? 1 : 0), next};
  }
};

struct SentPose {
  InputNumber number;
  Eigen::Vector3f p_WH = Eigen::Vector3f::Zero();  ///< as float: there is one a tick
};

/// What a manifold says of its hand.
struct HandSample {
  Tick tick = 0;
  ObjectId object;
  InputNumber answers;
  double force = 0.0;  ///< [N]
  Eigen::Vector3f p_WH_proxy = Eigen::Vector3f::Zero();
  double extension = 0.0;  ///< [m] of the coupling; not a number without one
};

struct HandSeries {
  Role role = Role::kTrainee;
  std::vector<SentPose> sent;
  std::vector<HandSample> samples;
  Series force, gap, contact_force;
};

/// Reads the messages of a recording.
///
/// Topics reach a recorder in no order among each other, and on a busy machine in long batches. So what is
/// computed from several topics is computed at the end, by tick: equal sessions give equal figures.
class RecordingAnalyzer {
 public:
  RecordingAnalyzer(SessionAnalysis& analysis, std::string language)
      : analysis_(analysis), language_(std::move(language)) {
    subscribe<SessionAnnounce>(wire::kSessionAnnounce);
    subscribe<Presence>(wire::kPresence);
    subscribe<SceneObject>(wire::kSceneObject);
    subscribe<WorldFrame>(wire::kWorldFrame100);
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
    subscribe<Command>(wire::kCommand);
  }

  void read(const record::McapMessage& message) {
    ++analysis_.messages;
    if (analysis_.began_ns == 0) analysis_.began_ns = message.log_time_ns;
    const auto handler = handlers_.find(message.topic);
    if (handler != handlers_.end()) handler->second(message.data);
  }
  void finish();

 private:
  template <class M>
  void subscribe(const wire::Topic<M>& topic) {
    handlers_[topic.name] = [this](std::span<const std::uint8_t> bytes) {
      const auto message = wire::decode<M>(bytes);
      if (!message) {
        ++analysis_.malformed;
        return;
      }
      receive(*message);
    };
  }

  void receive(const SessionAnnounce& announce) {
    analysis_.session = announce.session;
    analysis_.title = announce.title;
    analysis_.lockstep = announce.lockstep;
  }
  void receive(const Presence& presence);
  void receive(const SceneObject& object) {
    kinds_[object.object] = object.kind;
    if (object.kind == "pointer" || object.kind == "assistant" || object.kind == "forearm" ||
        object.kind == "head")
      own_titles_.insert(object.title.empty() ? object.name : object.title);
  }
  void receive(const WorldFrame& frame) { advanceTo(frame.tick); }
  void receive(const DeviceInput& input);
  void receive(const HandManifold& manifold);
  void receive(const HandState& state) { indexed_ = indexed_ || state.indexing; }
  void receive(const ContactPairs& pairs);
  void receive(const TickStats& stats);
  void receive(const StepState& step);
  void receive(const StepProgress& progress);
  void receive(const RunState& run);
  void receive(const EventLog& event) {
    analysis_.events.push_back({seconds(event.tick), event.severity, event.kind, event.text});
  }
  void receive(const ClientEvent& event) {
    const Severity severity = event.kind == "safety" ? Severity::kWarning : Severity::kInfo;
    client_events_.push_back({seconds(event.tick), severity, event.kind, event.text});
  }
  void receive(const EmergencyStop& stop) {
    if (stops_.raise(stop)) addStop(Severity::kError, "raised", stop.who, stop.reason);
  }
  void receive(const EmergencyClear& cleared) {
    if (stops_.clear(cleared)) addStop(Severity::kInfo, "cleared", cleared.who, cleared.reason);
  }
  void addStop(Severity severity, std::string_view what, const std::string& who, const std::string& reason) {
    analysis_.events.push_back(
        {seconds(now_), severity, "emergency stop", fmt::format("{} by {}: {}", what, who, reason)});
  }
  void receive(const Telemetry& telemetry);
  void receive(const Guidance& guidance) { guided_ = guided_ || guidance.active; }
  void receive(const ForceContribution&) { external_force_ = true; }
  void receive(const Command& command);

  void advanceTo(Tick tick) { now_ = std::max(now_, tick); }
  static void add(Series& series, Tick tick, double value) {
    if (std::isfinite(value)) series.push_back({seconds(tick), value});
  }
  void endVisits();
  void evaluate(HandSeries& hand);
  [[nodiscard]] bool touches(ObjectId object, Tick tick) const;
  void mergeHands();
  void sortEvents();
  void listAids();
  void dropOwnGrabs();
  void summarize();
  [[nodiscard]] SessionMetrics metrics(double begin, double end) const;

  SessionAnalysis& analysis_;
  std::string language_;
  std::map<std::string_view, std::function<void(std::span<const std::uint8_t>)>> handlers_;
  Tick now_ = 0;
  std::map<HandId, HandSeries> hands_;
  std::map<ClientId, Presence> present_;
  std::map<ObjectId, std::string> kinds_;
  std::set<std::string> own_titles_;
  std::map<ObjectId, std::set<Tick>> contacts_;  ///< of each object
  std::vector<SessionEvent> client_events_;
  StopTruth stops_;
  std::map<std::uint32_t, double> contact_seconds_;  ///< [s] by step revision
  std::map<ClientId, ForceLatency> force_latencies_;
  Series contact_;                 ///< 1 while a trainee's object is in contact, else 0
  double assisted_seconds_ = 0.0;  ///< [s] in which the instructor's pointer was in contact
  bool indexed_ = false, guided_ = false, external_force_ = false;
  std::map<std::string, int> commands_;
};

void RecordingAnalyzer::receive(const Presence& presence) {
  if (!presence.client.valid()) return;
  if (!present_.contains(presence.client)) analysis_.participants.push_back({presence.name, presence.role});
  present_[presence.client] = presence;
  for (const HandId hand : presence.hands) hands_[hand].role = presence.role;
}

void RecordingAnalyzer::receive(const DeviceInput& input) {
  const DeviceSample& newest = input.sample;
  auto& sent = hands_[input.hand].sent;
  const InputNumber before = sent.empty() ? InputNumber{} : sent.back().number;
  sent.push_back({before.followedBy(newest.seq), newest.X_WH.translation().cast<float>()});
}

void RecordingAnalyzer::receive(const HandManifold& manifold) {
  advanceTo(manifold.tick);
  const double force = manifold.F_Ho_W.force.norm();
  const double extension =
      manifold.stiffness > 0.0 ? force / manifold.stiffness : std::numeric_limits<double>::quiet_NaN();
  const Vector3 p_WH_proxy = (manifold.X_WO * manifold.X_HO.inverse()).translation();
  auto& samples = hands_[manifold.hand].samples;
  // in lockstep a server repeats what a station has not answered
  if (!samples.empty() && samples.back().tick >= manifold.tick) return;
  const InputNumber before = samples.empty() ? InputNumber{} : samples.back().answers;
  samples.push_back({manifold.tick, manifold.object, before.followedBy(manifold.answers_seq), force,
                     p_WH_proxy.cast<float>(), extension});
}

bool RecordingAnalyzer::touches(ObjectId object, Tick tick) const {
  const auto contacts = contacts_.find(object);
  if (contacts == contacts_.end()) return false;
  const auto after = contacts->second.upper_bound(tick);
  return after != contacts->second.begin() && *std::prev(after) + kContactHold >= tick;
}

void RecordingAnalyzer::evaluate(HandSeries& hand) {
  auto sent = hand.sent.begin();
  for (const HandSample& sample : hand.samples) {
    add(hand.force, sample.tick, sample.force);
    const bool in_contact = touches(sample.object, sample.tick);
    if (in_contact) add(hand.contact_force, sample.tick, sample.force);
    if (hand.role == Role::kTrainee) add(contact_, sample.tick, in_contact ? 1.0 : 0.0);
    // distance of the proxy's hand pose from the device's; without the input, the extension of the coupling
    while (sent != hand.sent.end() && sent->number < sample.answers) ++sent;
    const bool is_answer =
        sent != hand.sent.end() && sent->number == sample.answers && sample.answers.seq != 0;
    const double distance = is_answer ? (sample.p_WH_proxy - sent->p_WH).norm() : sample.extension;
    add(hand.gap, sample.tick, distance);
  }
  hand.sent = {};
  hand.samples = {};
}

void RecordingAnalyzer::receive(const ContactPairs& pairs) {
  constexpr double kSampleSeconds = 0.01;
  advanceTo(pairs.tick);
  double depth = 0.0;
  bool assisted = false;
  for (const PairContact& pair : pairs.pairs) {
    depth = std::max({depth, pair.depth, pair.peak_depth});
    if (!pair.colliding) continue;
    contacts_[pair.a].insert(pairs.tick);
    contacts_[pair.b].insert(pairs.tick);
    assisted = assisted || kinds_[pair.a] == "assistant" || kinds_[pair.b] == "assistant";
  }
  add(analysis_.depth, pairs.tick, depth);
  if (assisted) assisted_seconds_ += kSampleSeconds;
}

void RecordingAnalyzer::receive(const TickStats& stats) {
  advanceTo(stats.tick);
  add(analysis_.load, stats.tick, stats.load_percent);
  add(analysis_.depth, stats.tick, 0.0);  // pairs apart are not published
  add(analysis_.compute, stats.tick, stats.compute_seconds);
  add(analysis_.compute_max, stats.tick, std::max(stats.compute_seconds, stats.compute_seconds_max));
  analysis_.late_ticks = std::max(analysis_.late_ticks, stats.late_ticks);
  if (std::isfinite(stats.input_age_seconds))
    analysis_.input_age = std::max(analysis_.input_age, stats.input_age_seconds);
}

void RecordingAnalyzer::receive(const StepState& step) {
  analysis_.steps = std::max(analysis_.steps, step.steps);
  auto& visits = analysis_.visits;
  const bool same = !visits.empty() && visits.back().step == step.step &&
                    (visits.back().begin == seconds(step.started) || step.phase != StepPhase::kActive);
  if (same) {
    visits.back().phase = step.phase;
    return;
  }
  if (step.phase == StepPhase::kWaiting) return;
  // a step ends where the next one begins; one that ends without a message was done if a later one follows,
  // else abandoned
  if (!visits.empty()) visits.back().end = seconds(step.started);
  if (!visits.empty() && visits.back().phase == StepPhase::kActive)
    visits.back().phase = step.step > visits.back().step ? StepPhase::kDone : StepPhase::kWaiting;
  StepVisit visit;
  visit.step = step.step;
  visit.revision = step.revision;
  visit.name = step.name;
  visit.title = localized(step.title, language_);
  if (visit.title.empty()) visit.title = step.name;
  visit.part = step.part;
  visit.phase = step.phase;
  visit.begin = visit.end = seconds(step.started);
  visits.push_back(std::move(visit));
}

void RecordingAnalyzer::receive(const StepProgress& progress) {
  advanceTo(progress.tick);
  double& longest = contact_seconds_[progress.revision];
  if (std::isfinite(progress.contact_seconds)) longest = std::max(longest, progress.contact_seconds);
}

void RecordingAnalyzer::receive(const RunState& run) {
  analysis_.run = run;
  analysis_.has_run = true;
  advanceTo(run.tick);
}

void RecordingAnalyzer::receive(const Telemetry& telemetry) {
  if (telemetry.samples == 0) return;
  ForceLatency& latency = force_latencies_[telemetry.client];
  latency.p50 = telemetry.input_to_force_p50;
  latency.p99 = telemetry.input_to_force_p99;
  latency.max = std::max(latency.max, telemetry.input_to_force_max);
}

void RecordingAnalyzer::receive(const Command& command) {
  switch (command.kind) {
    case CommandKind::kFulfilled:
      ++commands_["condition confirmed by a person"];
      return;
    case CommandKind::kSkipStep:
      ++commands_["step skipped"];
      return;
    case CommandKind::kPause:
      ++commands_["paused"];
      return;
    case CommandKind::kReset:
      ++commands_["exercise reset"];
      return;
    case CommandKind::kSwapHands:
      ++commands_["hands swapped"];
      return;
    case CommandKind::kSetCollision:
      ++commands_["collisions of two objects changed"];
      return;
    default:
      return;
  }
}

void RecordingAnalyzer::endVisits() {
  if (!analysis_.visits.empty()) analysis_.visits.back().end = analysis_.duration;
  for (StepVisit& visit : analysis_.visits) {
    if (visit.phase != StepPhase::kActive) continue;
    if (analysis_.run.phase == RunPhase::kSucceeded) visit.phase = StepPhase::kDone;
    if (analysis_.run.phase == RunPhase::kFailed) visit.phase = StepPhase::kTimedOut;
  }
}

void sortByTime(Series& series) {
  std::stable_sort(series.begin(), series.end(),
                   [](const SeriesPoint& a, const SeriesPoint& b) { return a.time < b.time; });
}

/// Merges points of equal time to the largest of them.
Series mergedToLargest(Series series) {
  sortByTime(series);
  Series merged;
  for (const SeriesPoint& point : series) {
    if (!merged.empty() && merged.back().time == point.time) {
      merged.back().value = std::max(merged.back().value, point.value);
    } else {
      merged.push_back(point);
    }
  }
  return merged;
}

void RecordingAnalyzer::mergeHands() {
  for (auto& [id, hand] : hands_) {
    evaluate(hand);
    const bool instructor = hand.role == Role::kInstructor;
    Series& force = instructor ? analysis_.instructor_force : analysis_.trainee_force;
    force.insert(force.end(), hand.force.begin(), hand.force.end());
    if (!instructor) analysis_.gap.insert(analysis_.gap.end(), hand.gap.begin(), hand.gap.end());
  }
  for (Series* series :
       {&analysis_.trainee_force, &analysis_.instructor_force, &analysis_.gap, &analysis_.depth,
        &analysis_.load, &analysis_.compute, &analysis_.compute_max, &contact_})
    *series = mergedToLargest(std::move(*series));
}

void RecordingAnalyzer::listAids() {
  auto& aids = analysis_.aids;
  if (assisted_seconds_ > 0.0)
    aids.push_back(fmt::format("instructor's pointer in contact for {:.1f} s", assisted_seconds_));
  if (guided_) aids.emplace_back("guidance by a virtual fixture");
  if (external_force_) aids.emplace_back("forces from another program");
  if (indexed_) aids.emplace_back("workspace shifted (indexing)");
  for (const auto& [what, count] : commands_)
    aids.push_back(count > 1 ? fmt::format("{} ({} times)", what, count) : what);
}

/// Largest value in [`begin`, `end`] [s]; 0 without one.
double peak(const Series& series, double begin, double end) {
  auto at = std::lower_bound(series.begin(), series.end(), begin,
                             [](const SeriesPoint& point, double time) { return point.time < time; });
  double highest = 0.0;
  for (; at != series.end() && at->time <= end; ++at) highest = std::max(highest, at->value);
  return highest;
}

/// `fraction` [-] of the values are at most the result; reorders them.
double percentile(std::vector<double>& values, double fraction) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

SessionMetrics RecordingAnalyzer::metrics(double begin, double end) const {
  SessionMetrics result;
  result.peak_force = peak(analysis_.trainee_force, begin, end);
  result.gap = peak(analysis_.gap, begin, end);
  result.depth = peak(analysis_.depth, begin, end);
  result.load = peak(analysis_.load, begin, end);
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& [id, hand] : hands_) {
    if (hand.role == Role::kInstructor) continue;
    for (const SeriesPoint& point : hand.contact_force) {
      if (point.time < begin || point.time > end) continue;
      sum += point.value;
      ++count;
    }
  }
  if (count > 0) result.mean_force = sum / static_cast<double>(count);
  for (const SeriesPoint& point : contact_)
    if (point.time >= begin && point.time <= end) result.contact_seconds += point.value * kTickSeconds;
  return result;
}

/// That a hand takes or releases its own object is no event for a trainer.
void RecordingAnalyzer::dropOwnGrabs() {
  std::erase_if(analysis_.events, [this](const SessionEvent& event) {
    const bool grab = event.kind == "taken" || event.kind == "let go";
    return grab && own_titles_.contains(event.text.substr(0, event.text.rfind(" (")));
  });
}

void RecordingAnalyzer::summarize() {
  analysis_.whole = metrics(0.0, analysis_.duration);
  if (!analysis_.visits.empty()) analysis_.whole.contact_seconds = 0.0;
  for (StepVisit& visit : analysis_.visits) {
    visit.metrics = metrics(visit.begin, visit.end);
    // the server counts contacts of the step's object alone, every tick
    const auto counted = contact_seconds_.find(visit.revision);
    if (counted != contact_seconds_.end()) visit.metrics.contact_seconds = counted->second;
    analysis_.whole.contact_seconds += visit.metrics.contact_seconds;
  }
  std::vector<double> values;
  for (const SeriesPoint& point : analysis_.compute) values.push_back(point.value);
  analysis_.compute_median = percentile(values, 0.5);
  analysis_.compute_p99 = percentile(values, 0.99);
  analysis_.compute_worst = peak(analysis_.compute_max, 0.0, analysis_.duration);
}

void RecordingAnalyzer::finish() {
  analysis_.duration = seconds(now_);
  endVisits();
  mergeHands();
  listAids();
  dropOwnGrabs();
  summarize();
  for (auto& [client, latency] : force_latencies_) {
    latency.who = present_.contains(client) ? present_[client].name : fmt::format("client {}", client.value);
    analysis_.force_latencies.push_back(latency);
  }
  sortEvents();
}

/// By time; of equal times those of the server first, in their order.
void RecordingAnalyzer::sortEvents() {
  std::sort(client_events_.begin(), client_events_.end(), [](const SessionEvent& a, const SessionEvent& b) {
    return std::tie(a.time, a.text) < std::tie(b.time, b.text);
  });
  auto& events = analysis_.events;
  events.insert(events.end(), client_events_.begin(), client_events_.end());
  std::stable_sort(events.begin(), events.end(),
                   [](const SessionEvent& a, const SessionEvent& b) { return a.time < b.time; });
}

}  // namespace

bool SessionAnalysis::succeeded() const {
  if (!has_run || run.phase != RunPhase::kSucceeded || steps == 0) return false;
  for (std::uint32_t step = 0; step < steps; ++step) {
    const bool done = std::any_of(visits.begin(), visits.end(), [&](const StepVisit& visit) {
      return visit.step == step && visit.phase == StepPhase::kDone;
    });
    if (!done) return false;
  }
  return true;
}

Result<SessionAnalysis> analyzeRecording(const std::filesystem::path& file, const std::string& language) {
  auto recording = record::McapReader::open(file);
  if (!recording) return fail(recording.error().what);
  SessionAnalysis analysis;
  analysis.file = file.filename().string();
  RecordingAnalyzer reader(analysis, language);
  for (record::McapMessage message; recording->next(message);) reader.read(message);
  analysis.problem = recording->problem();
  if (analysis.messages == 0)
    return fail(file.string() + ": holds no messages" +
                (analysis.problem.empty() ? "" : " (" + analysis.problem + ")"));
  reader.finish();
  return analysis;
}

}  // namespace tenon::report
