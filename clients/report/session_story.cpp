#include "clients/report/session_story.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "idl/record/mcap_reader.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon {
namespace {

constexpr Tick kStillTouching = 20;  // [ticks] a pair is listed every 10 as long as it collides

double seconds(Tick tick) { return static_cast<double>(tick) * kTickSeconds; }

/// Where a hand was when it sent an input, to be found again when a manifold answers it.
struct SentPose {
  std::uint32_t seq = 0;
  Vector3 p_WH = Vector3::Zero();
};

struct HandTrace {
  Role role = Role::kTrainee;
  std::array<SentPose, 64> sent;
  Series force, gap, touching_force;
};

/// Listens to the messages of a recording, in file order.
class StoryReader {
 public:
  StoryReader(SessionStory& story, std::string language) : story_(story), language_(std::move(language)) {
    listen<SessionAnnounce>(kSessionAnnounce);
    listen<Presence>(kPresence);
    listen<SceneObject>(kSceneObject);
    listen<WorldFrame>(kWorldFrame100);
    listen<DeviceInput>(kDeviceInput);
    listen<HandManifold>(kHandManifold);
    listen<HandState>(kHandState100);
    listen<ContactPairs>(kContactPairs100);
    listen<TickStats>(kTickStats100);
    listen<StepState>(kStepState);
    listen<StepProgress>(kStepProgress);
    listen<RunState>(kRunState);
    listen<EventLog>(kEventLog);
    listen<ClientEvent>(kClientEvent);
    listen<EmergencyStop>(kEmergencyStop);
    listen<Telemetry>(kTelemetry);
    listen<Guidance>(kGuidance);
    listen<ForceContribution>(kForceContribution);
    listen<Command>(kCommand);
  }

  void read(const McapMessage& message) {
    ++story_.messages;
    if (story_.began_ns == 0) story_.began_ns = message.log_time_ns;
    const auto handler = handlers_.find(message.topic);
    if (handler != handlers_.end()) handler->second(message.data);
  }
  void finish();

 private:
  template <class M>
  void listen(const Topic<M>& topic) {
    handlers_[topic.name] = [this](std::span<const std::uint8_t> bytes) {
      const auto message = decode<M>(bytes);
      if (!message) {
        ++story_.malformed;
        return;
      }
      hear(*message);
    };
  }

  void hear(const SessionAnnounce& announce) {
    story_.session = announce.session;
    story_.title = announce.title;
    story_.lockstep = announce.lockstep;
  }
  void hear(const Presence& presence);
  void hear(const SceneObject& object) { kinds_[object.object] = object.kind; }
  void hear(const WorldFrame& frame) { pass(frame.tick); }
  void hear(const DeviceInput& input);
  void hear(const HandManifold& manifold);
  void hear(const HandState& state) { indexed_ = indexed_ || state.indexing; }
  void hear(const ContactPairs& pairs);
  void hear(const TickStats& stats);
  void hear(const StepState& step);
  void hear(const StepProgress& progress);
  void hear(const RunState& run);
  void hear(const EventLog& event) {
    story_.events.push_back({seconds(event.tick), event.severity, event.kind, event.text});
  }
  void hear(const ClientEvent& event) {
    const Severity severity = event.kind == "safety" ? Severity::kWarning : Severity::kInfo;
    story_.events.push_back({seconds(now_), severity, event.kind, event.text});
  }
  void hear(const EmergencyStop& stop) {
    story_.events.push_back(
        {seconds(now_), stop.engaged ? Severity::kError : Severity::kInfo, "emergency stop",
         fmt::format("{} by {}: {}", stop.engaged ? "engaged" : "released", stop.who, stop.reason)});
  }
  void hear(const Telemetry& telemetry);
  void hear(const Guidance& guidance) { guided_ = guided_ || guidance.active; }
  void hear(const ForceContribution&) { pushed_by_force_ = true; }
  void hear(const Command& command);

  void pass(Tick tick) { now_ = std::max(now_, tick); }
  static void add(Series& series, Tick tick, double value) {
    if (std::isfinite(value)) series.push_back({seconds(tick), value});
  }
  [[nodiscard]] std::string chosen(const std::vector<LocalizedText>& texts) const;
  void endVisits();
  void mergeHands();
  void nameAids();
  void summarize();
  [[nodiscard]] Figures figures(double begin, double end) const;

  SessionStory& story_;
  std::string language_;
  std::map<std::string_view, std::function<void(std::span<const std::uint8_t>)>> handlers_;
  Tick now_ = 0;
  std::map<HandId, HandTrace> hands_;
  std::map<ClientId, Presence> present_;
  std::map<ObjectId, std::string> kinds_;
  std::map<ObjectId, Tick> touched_;                 ///< when it was last in contact
  std::map<std::uint32_t, double> contact_seconds_;  ///< by step revision
  std::map<ClientId, ForceAge> ages_;
  Series contact_;  ///< 1 while a trainee's object touches something
  double assisted_seconds_ = 0.0;
  bool indexed_ = false, guided_ = false, pushed_by_force_ = false;
  std::map<std::string, int> commands_;
};

void StoryReader::hear(const Presence& presence) {
  if (!presence.client.valid()) return;
  if (!present_.contains(presence.client)) story_.people.push_back({presence.name, presence.role});
  present_[presence.client] = presence;
  for (const HandId hand : presence.hands) hands_[hand].role = presence.role;
}

void StoryReader::hear(const DeviceInput& input) {
  const DeviceSample& newest = input.samples.front();
  HandTrace& hand = hands_[input.hand];
  hand.sent[newest.seq % hand.sent.size()] = {newest.seq, newest.X_WH.translation()};
}

void StoryReader::hear(const HandManifold& manifold) {
  pass(manifold.tick);
  HandTrace& hand = hands_[manifold.hand];
  const double force = manifold.F_Ho_W.force.norm();
  add(hand.force, manifold.tick, force);
  const auto touched = touched_.find(manifold.object);
  const bool touches = touched != touched_.end() && touched->second + kStillTouching >= manifold.tick;
  if (touches) add(hand.touching_force, manifold.tick, force);
  if (hand.role == Role::kTrainee) add(contact_, manifold.tick, touches ? 1.0 : 0.0);

  // the hand where the proxy puts it, against where its device was; a lost input leaves the coupling's
  // stretch
  const SentPose& sent = hand.sent[manifold.answers_seq % hand.sent.size()];
  const Vector3 p_WH_proxy = (manifold.X_WO * manifold.X_HO.inverse()).translation();
  if (sent.seq == manifold.answers_seq && manifold.answers_seq != 0) {
    add(hand.gap, manifold.tick, (p_WH_proxy - sent.p_WH).norm());
  } else if (manifold.stiffness > 0.0) {
    add(hand.gap, manifold.tick, force / manifold.stiffness);
  }
}

void StoryReader::hear(const ContactPairs& pairs) {
  constexpr double kSampleSeconds = 0.01;
  pass(pairs.tick);
  double depth = 0.0;
  bool assisted = false;
  for (const PairContact& pair : pairs.pairs) {
    depth = std::max({depth, pair.depth, pair.peak_depth});
    if (!pair.colliding) continue;
    touched_[pair.a] = touched_[pair.b] = pairs.tick;
    assisted = assisted || kinds_[pair.a] == "assistant" || kinds_[pair.b] == "assistant";
  }
  add(story_.depth, pairs.tick, depth);
  if (assisted) assisted_seconds_ += kSampleSeconds;
}

void StoryReader::hear(const TickStats& stats) {
  pass(stats.tick);
  add(story_.load, stats.tick, stats.load_percent);
  add(story_.depth, stats.tick, 0.0);  // pairs that do not touch are not listed
  add(story_.compute, stats.tick, stats.compute_seconds);
  add(story_.compute_max, stats.tick, std::max(stats.compute_seconds, stats.compute_seconds_max));
  story_.late_ticks = std::max(story_.late_ticks, stats.late_ticks);
  if (std::isfinite(stats.input_age_seconds))
    story_.input_age = std::max(story_.input_age, stats.input_age_seconds);
}

void StoryReader::hear(const StepState& step) {
  story_.steps = std::max(story_.steps, step.steps);
  auto& visits = story_.visits;
  const bool same = !visits.empty() && visits.back().step == step.step &&
                    (visits.back().begin == seconds(step.started) || step.phase != StepPhase::kActive);
  if (same) {
    if (visits.back().phase == StepPhase::kActive && step.phase != StepPhase::kActive)
      visits.back().end = seconds(std::max(now_, step.started));
    visits.back().phase = step.phase;
    return;
  }
  if (step.phase == StepPhase::kWaiting) return;
  // the next one begins: the one before was done, unless it said otherwise
  if (!visits.empty() && visits.back().phase == StepPhase::kActive) {
    visits.back().end = seconds(step.started);
    visits.back().phase = step.step > visits.back().step ? StepPhase::kDone : StepPhase::kWaiting;
  }
  StepVisit visit;
  visit.step = step.step;
  visit.revision = step.revision;
  visit.name = step.name;
  visit.title = chosen(step.title);
  if (visit.title.empty()) visit.title = step.name;
  visit.part = step.part;
  visit.phase = step.phase;
  visit.begin = visit.end = seconds(step.started);
  visits.push_back(std::move(visit));
}

void StoryReader::hear(const StepProgress& progress) {
  pass(progress.tick);
  double& most = contact_seconds_[progress.revision];
  if (std::isfinite(progress.contact_seconds)) most = std::max(most, progress.contact_seconds);
}

void StoryReader::hear(const RunState& run) {
  story_.run = run;
  story_.has_run = true;
  pass(run.tick);
}

void StoryReader::hear(const Telemetry& telemetry) {
  if (telemetry.samples == 0) return;
  ForceAge& age = ages_[telemetry.client];
  age.p50 = telemetry.input_to_force_p50;
  age.p99 = telemetry.input_to_force_p99;
  age.max = std::max(age.max, telemetry.input_to_force_max);
}

void StoryReader::hear(const Command& command) {
  switch (command.kind) {
    case CommandKind::kFulfilled:
      ++commands_["confirmed by key"];
      return;
    case CommandKind::kSkipStep:
      ++commands_["step skipped"];
      return;
    case CommandKind::kPause:
      ++commands_["paused"];
      return;
    case CommandKind::kReset:
      ++commands_["started again"];
      return;
    case CommandKind::kSwapHands:
      ++commands_["hands swapped"];
      return;
    case CommandKind::kSetCollision:
      ++commands_["collisions of a pair switched"];
      return;
    default:
      return;
  }
}

std::string StoryReader::chosen(const std::vector<LocalizedText>& texts) const {
  for (const LocalizedText& text : texts)
    if (text.language == language_) return text.text;
  return texts.empty() ? std::string() : texts.front().text;
}

void StoryReader::endVisits() {
  for (StepVisit& visit : story_.visits) {
    if (visit.phase != StepPhase::kActive) continue;
    visit.end = story_.duration;
    if (story_.run.phase == RunPhase::kSucceeded) visit.phase = StepPhase::kDone;
    if (story_.run.phase == RunPhase::kFailed) visit.phase = StepPhase::kTimedOut;
  }
}

void sortByTime(Series& series) {
  std::stable_sort(series.begin(), series.end(),
                   [](const SeriesPoint& a, const SeriesPoint& b) { return a.time < b.time; });
}

/// Of points at one time the largest stays.
Series largestOf(Series series) {
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

void StoryReader::mergeHands() {
  for (auto& [id, hand] : hands_) {
    const bool teaches = hand.role == Role::kInstructor;
    Series& force = teaches ? story_.instructor_force : story_.trainee_force;
    force.insert(force.end(), hand.force.begin(), hand.force.end());
    if (!teaches) story_.gap.insert(story_.gap.end(), hand.gap.begin(), hand.gap.end());
  }
  for (Series* series : {&story_.trainee_force, &story_.instructor_force, &story_.gap, &story_.depth,
                         &story_.load, &story_.compute, &story_.compute_max, &contact_})
    *series = largestOf(std::move(*series));
}

void StoryReader::nameAids() {
  auto& aids = story_.aids;
  if (assisted_seconds_ > 0.0)
    aids.push_back(fmt::format("instructor's cube in contact for {:.1f} s", assisted_seconds_));
  if (guided_) aids.emplace_back("guidance along a fixture");
  if (pushed_by_force_) aids.emplace_back("forces added by a program");
  if (indexed_) aids.emplace_back("workspace moved with the hand");
  for (const auto& [what, count] : commands_)
    aids.push_back(count > 1 ? fmt::format("{} ({} times)", what, count) : what);
}

/// Largest value in [begin, end].
double peak(const Series& series, double begin, double end) {
  auto at = std::lower_bound(series.begin(), series.end(), begin,
                             [](const SeriesPoint& point, double time) { return point.time < time; });
  double most = 0.0;
  for (; at != series.end() && at->time <= end; ++at) most = std::max(most, at->value);
  return most;
}

double percentile(std::vector<double>& values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

Figures StoryReader::figures(double begin, double end) const {
  Figures all;
  all.peak_force = peak(story_.trainee_force, begin, end);
  all.gap = peak(story_.gap, begin, end);
  all.depth = peak(story_.depth, begin, end);
  all.load = peak(story_.load, begin, end);
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& [id, hand] : hands_) {
    if (hand.role == Role::kInstructor) continue;
    for (const SeriesPoint& point : hand.touching_force) {
      if (point.time < begin || point.time > end) continue;
      sum += point.value;
      ++count;
    }
  }
  if (count > 0) all.mean_force = sum / static_cast<double>(count);
  for (const SeriesPoint& point : contact_)
    if (point.time >= begin && point.time <= end) all.contact_seconds += point.value * kTickSeconds;
  return all;
}

void StoryReader::summarize() {
  story_.whole = figures(0.0, story_.duration);
  if (!story_.visits.empty()) story_.whole.contact_seconds = 0.0;
  for (StepVisit& visit : story_.visits) {
    visit.figures = figures(visit.begin, visit.end);
    // the server's own count is of the step's object alone, and exact
    const auto counted = contact_seconds_.find(visit.revision);
    if (counted != contact_seconds_.end()) visit.figures.contact_seconds = counted->second;
    story_.whole.contact_seconds += visit.figures.contact_seconds;
  }
  std::vector<double> values;
  for (const SeriesPoint& point : story_.compute) values.push_back(point.value);
  story_.compute_median = percentile(values, 0.5);
  story_.compute_p99 = percentile(values, 0.99);
  story_.compute_worst = peak(story_.compute_max, 0.0, story_.duration);
}

void StoryReader::finish() {
  story_.duration = seconds(now_);
  endVisits();
  mergeHands();
  nameAids();
  summarize();
  for (auto& [client, age] : ages_) {
    age.who = present_.contains(client) ? present_[client].name : fmt::format("client {}", client.value);
    story_.force_ages.push_back(age);
  }
  std::stable_sort(story_.events.begin(), story_.events.end(),
                   [](const SessionEvent& a, const SessionEvent& b) { return a.time < b.time; });
}

}  // namespace

bool SessionStory::succeeded() const {
  if (!has_run || run.phase != RunPhase::kSucceeded || steps == 0) return false;
  for (std::uint32_t step = 0; step < steps; ++step) {
    const bool done = std::any_of(visits.begin(), visits.end(), [&](const StepVisit& visit) {
      return visit.step == step && visit.phase == StepPhase::kDone;
    });
    if (!done) return false;
  }
  return true;
}

Result<SessionStory> readStory(const std::filesystem::path& file, const std::string& language) {
  auto recording = McapReader::open(file);
  if (!recording) return fail(recording.error().what);
  SessionStory story;
  story.file = file.filename().string();
  StoryReader reader(story, language);
  for (McapMessage message; recording->next(message);) reader.read(message);
  story.problem = recording->problem();
  if (story.messages == 0)
    return fail(file.string() + ": holds no messages" +
                (story.problem.empty() ? "" : " (" + story.problem + ")"));
  reader.finish();
  return story;
}

}  // namespace tenon
