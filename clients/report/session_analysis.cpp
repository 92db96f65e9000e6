#include "clients/report/session_analysis.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "idl/types/names.h"
#include "idl/wire/topics.h"

namespace tenon::report {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

Tick tickOf(double seconds) { return static_cast<Tick>(std::llround(seconds / kTickSeconds)); }

/// Computes the figures of a session when all of its messages are read, by tick: equal sessions give equal
/// figures.
class SessionAnalyzer {
 public:
  SessionAnalyzer(RecordedSession& session, const std::string& language)
      : session_(session), language_(language) {}

  SessionAnalysis run() {
    copyFacts();
    countMissing();
    for (const StepState& step : session_.steps) addVisit(step);
    endVisits();
    mergeHands();
    listAids();
    dropOwnGrabs();
    summarize();
    sortEvents();
    return std::move(analysis_);
  }

 private:
  void copyFacts();
  void countMissing();
  [[nodiscard]] bool lacks(std::string_view topic, double begin, double end) const;
  [[nodiscard]] bool lacksForces(double begin, double end) const;
  void addVisit(const StepState& step);
  void endByEvents(StepVisit& visit, bool led_back) const;
  void endVisits();
  void mergeHands();
  void sortEvents();
  void listAids();
  void dropOwnGrabs();
  void summarize();
  [[nodiscard]] double pathOf(const StepVisit& visit) const;
  [[nodiscard]] std::optional<int> collisionsOf(const StepVisit& visit) const;
  void measure(StepVisit& visit) const;
  [[nodiscard]] SessionMetrics metrics(double begin, double end) const;

  RecordedSession& session_;
  const std::string& language_;
  SessionAnalysis analysis_;
  std::vector<Series> contact_forces_;  ///< [N] of each of the trainee's hands
  std::vector<HandFigures> hands_;      ///< of the trainee: inputs and statements
  Series contact_;                      ///< 1 while a trainee's object is in contact, else 0
};

void SessionAnalyzer::copyFacts() {
  analysis_.problem = session_.problem;
  analysis_.messages = session_.messages;
  analysis_.malformed = session_.malformed;
  analysis_.began_ns = session_.began_ns;
  analysis_.duration = secondsOf(session_.last);
  analysis_.session = session_.announce.session;
  analysis_.title = session_.announce.title;
  analysis_.lockstep = session_.announce.lockstep;
  analysis_.participants = session_.participants;
  analysis_.run = session_.run;
  analysis_.has_run = session_.has_run;
  analysis_.late_ticks = session_.late_ticks;
  analysis_.slow_writes = session_.slow_writes;
  analysis_.unsent_samples = session_.unsent_samples;
  analysis_.input_age = session_.input_age;
  analysis_.events = session_.events;
  for (auto& [client, latency] : session_.force_latencies) {
    const auto present = session_.present.find(client);
    latency.who =
        present != session_.present.end() ? present->second.name : fmt::format("client {}", client.value);
    analysis_.force_latencies.push_back(latency);
  }
}

/// By the recorder's own count, or, where it was killed, by what is in the file.
void SessionAnalyzer::countMissing() {
  constexpr Tick kAll = std::numeric_limits<Tick>::max();
  auto& missing = analysis_.missing;
  for (const auto& [topic, count] : session_.counts)
    if (count.missing() > 0) missing[topic] = count;
  for (const std::string_view topic : {wire::kWorldFrame100.name, wire::kContactPairs100.name,
                                       wire::kTickStats100.name, wire::kHandManifold.name}) {
    const SampleCount count = session_.coverage.between(topic, 1, kAll);
    const auto counted = missing.find(std::string(topic));
    const std::uint64_t known = counted == missing.end() ? 0 : counted->second.missing();
    if (count.missing() > known) missing[std::string(topic)] = count;
  }
  if (missing.empty()) return;
  std::string text;
  for (const auto& [topic, count] : missing)
    text +=
        fmt::format("{}{} of {} of {}", text.empty() ? "" : ", ", count.missing(), count.published, topic);
  std::string& problem = analysis_.problem;
  problem += fmt::format("{}samples are missing: {}; figures that rest on too few of them are left blank",
                         problem.empty() ? "" : "; ", text);
}

/// Too much of a topic to rest a figure on.
bool SessionAnalyzer::lacks(std::string_view topic, double begin, double end) const {
  // a step's first tick follows the one at which it has begun
  return session_.coverage.between(topic, tickOf(begin) + 1, tickOf(end)).isSubstantial();
}

/// Of what the stations have said, of which nobody counts how much that was: one in 10 inputs.
bool SessionAnalyzer::lacksForces(double begin, double end) const {
  constexpr double kInputsOfAStatement = 10.0;
  constexpr double kLeast = 50.0;  // [-] statements, below which a hand has hardly been there
  const auto sum = [&](const Series& series) {
    double all = 0.0;
    for (const SeriesPoint& point : between(series, begin, end)) all += point.value;
    return all;
  };
  for (const HandFigures& hand : hands_) {
    const double expected = sum(hand.answered) / kInputsOfAStatement;
    if (expected >= kLeast && sum(hand.stated) < 0.5 * expected) return true;
  }
  return false;
}

void SessionAnalyzer::addVisit(const StepState& step) {
  analysis_.steps = std::max(analysis_.steps, step.steps);
  auto& visits = analysis_.visits;
  const bool same = !visits.empty() && visits.back().step == step.step &&
                    (visits.back().begin == secondsOf(step.started) || step.phase != StepPhase::kActive);
  if (same) {
    visits.back().phase = step.phase;
    return;
  }
  if (step.phase == StepPhase::kWaiting) return;
  // a step ends where the next one begins
  if (!visits.empty()) visits.back().end = secondsOf(step.started);
  if (!visits.empty() && visits.back().phase == StepPhase::kActive)
    endByEvents(visits.back(), step.step <= visits.back().step);
  StepVisit visit;
  visit.step = step.step;
  visit.object = step.object;
  visit.attempt =
      1 + static_cast<std::uint32_t>(std::count_if(visits.begin(), visits.end(),
                                                   [&](const StepVisit& v) { return v.step == step.step; }));
  visit.has_target = step.has_target;
  visit.tolerance = {step.tolerance, step.angle_tolerance};
  visit.revision = step.revision;
  visit.name = step.name;
  visit.title = localized(step.title, language_);
  if (visit.title.empty()) visit.title = step.name;
  visit.part = step.part;
  visit.phase = step.phase;
  visit.begin = visit.end = secondsOf(step.started);
  visits.push_back(std::move(visit));
}

/// How a step ended of whose end there is no message: by the log of events, which says that of each step that
/// did not end by a command; `led_back`: to it or one before it.
void SessionAnalyzer::endByEvents(StepVisit& visit, bool led_back) const {
  static const std::map<std::string_view, StepPhase> kEnds{{"step done", StepPhase::kDone},
                                                           {"step skipped", StepPhase::kSkipped},
                                                           {"step timed out", StepPhase::kTimedOut}};
  constexpr double kSlack = 0.01;  // [s] some ticks between end and begin
  bool is_led = led_back;
  for (const SessionEvent& event : session_.events) {
    if (event.time < visit.begin || event.time > visit.end + kSlack) continue;
    const auto end = kEnds.find(event.kind);
    if (end != kEnds.end() && event.text.starts_with(visit.name + " (")) {
      visit.phase = end->second;
      return;
    }
    is_led = is_led || (event.kind == "command" &&
                        event.text.find(fmt::format(": {} ", commandName(CommandKind::kGoToStep))) !=
                            std::string::npos);
  }
  visit.phase = StepPhase::kWaiting;
  visit.is_end_known = is_led;
}

void SessionAnalyzer::endVisits() {
  auto& visits = analysis_.visits;
  if (visits.empty()) return;
  StepVisit& last = visits.back();
  last.end = analysis_.duration;
  if (last.phase != StepPhase::kActive) return;
  const RunState& run = analysis_.run;
  if (run.phase == RunPhase::kFailed) last.phase = StepPhase::kTimedOut;
  if (run.phase != RunPhase::kSucceeded) return;
  if (run.steps_skipped == 0 && run.steps_timed_out == 0)
    last.phase = StepPhase::kDone;
  else
    endByEvents(last, false);
}

void SessionAnalyzer::mergeHands() {
  const auto append = [](Series& to, const Series& from) { to.insert(to.end(), from.begin(), from.end()); };
  const auto touches = [this](ObjectId object, Tick tick) { return session_.touches(object, tick); };
  for (const auto& [id, hand] : session_.hands) {
    HandFigures figures = evaluate(hand, touches);
    const bool instructor = hand.role == Role::kInstructor;
    append(instructor ? analysis_.instructor_force : analysis_.trainee_force, figures.force);
    if (instructor) continue;
    append(analysis_.gap, figures.gap);
    if (hand.role == Role::kTrainee) append(contact_, figures.contact);
    contact_forces_.push_back(std::move(figures.contact_force));
    hands_.push_back({.answered = std::move(figures.answered), .stated = std::move(figures.stated)});
  }
  for (Series* series : {&analysis_.trainee_force, &analysis_.instructor_force, &analysis_.gap, &contact_})
    *series = mergedToLargest(std::move(*series));
  analysis_.depth = mergedToLargest(std::move(session_.depth));
  analysis_.load = mergedToLargest(std::move(session_.load));
  analysis_.compute = mergedToLargest(std::move(session_.compute));
  analysis_.compute_max = mergedToLargest(std::move(session_.compute_max));
}

void SessionAnalyzer::listAids() {
  auto& aids = analysis_.aids;
  if (session_.assisted_seconds > 0.0)
    aids.push_back(fmt::format("instructor's pointer in contact for {:.1f} s", session_.assisted_seconds));
  if (session_.guided) aids.emplace_back("guidance by a virtual fixture");
  if (session_.external_force) aids.emplace_back("forces from another program");
  if (session_.indexed) aids.emplace_back("workspace shifted (indexing)");
  for (const auto& [what, count] : session_.commands)
    if (count > 0) aids.push_back(count > 1 ? fmt::format("{} ({} times)", what, count) : what);
}

SessionMetrics SessionAnalyzer::metrics(double begin, double end) const {
  SessionMetrics result;
  const bool has_contacts = !lacks(wire::kContactPairs100.name, begin, end);
  const bool has_manifolds = !lacks(wire::kHandManifold.name, begin, end);
  const bool has_forces = has_manifolds && !lacksForces(begin, end);
  result.peak_force = has_forces ? peak(analysis_.trainee_force, begin, end) : kUnknown;
  result.gap = has_manifolds ? peak(analysis_.gap, begin, end) : kUnknown;
  result.depth = has_contacts ? peak(analysis_.depth, begin, end) : kUnknown;
  result.load = lacks(wire::kTickStats100.name, begin, end) ? kUnknown : peak(analysis_.load, begin, end);
  double sum = 0.0;
  std::size_t count = 0;
  for (const Series& force : contact_forces_) {
    const std::span<const SeriesPoint> points = between(force, begin, end);
    for (const SeriesPoint& point : points) sum += point.value;
    count += points.size();
  }
  if (count > 0) result.mean_force = sum / static_cast<double>(count);
  if (!has_forces || !has_contacts) result.mean_force = kUnknown;
  for (const SeriesPoint& point : between(contact_, begin, end))
    result.contact_seconds += point.value * kTickSeconds;
  if (!has_manifolds || !has_contacts) result.contact_seconds = kUnknown;
  return result;
}

/// That a hand takes or releases its own object is no event for a trainer.
void SessionAnalyzer::dropOwnGrabs() {
  std::erase_if(analysis_.events, [this](const SessionEvent& event) {
    const bool grab = event.kind == "taken" || event.kind == "let go";
    return grab && session_.own_titles.contains(event.text.substr(0, event.text.rfind(" (")));
  });
}

double SessionAnalyzer::pathOf(const StepVisit& visit) const {
  if (lacks(wire::kWorldFrame100.name, visit.begin, visit.end)) return kUnknown;
  const auto path = session_.positions.find(visit.object);
  if (path == session_.positions.end()) return 0.0;
  double length = 0.0;
  const PathPoint* before = nullptr;
  for (const PathPoint& point : path->second) {
    if (secondsOf(point.tick) < visit.begin || secondsOf(point.tick) > visit.end) continue;
    if (before != nullptr && before->epoch == point.epoch)
      length += static_cast<double>((point.p_WO - before->p_WO).norm());
    before = &point;
  }
  return length;
}

std::optional<int> SessionAnalyzer::collisionsOf(const StepVisit& visit) const {
  constexpr double kApart = 0.2;  // [s] a shorter interruption does not end a contact
  if (lacks(wire::kContactPairs100.name, visit.begin, visit.end)) return std::nullopt;
  const auto contacts = session_.collisions.find(visit.object);
  if (contacts == session_.collisions.end()) return 0;
  int count = 0;
  double last = visit.begin - kApart;
  for (const Tick tick : contacts->second) {
    const double time = secondsOf(tick);
    if (time <= visit.begin || time > visit.end) continue;
    if (time >= last + kApart) ++count;
    last = time;
  }
  return count;
}

/// What the server has measured of the step last, if that is of its end.
void SessionAnalyzer::measure(StepVisit& visit) const {
  constexpr Tick kLate = 200;  // [ticks] of running: several of its periods
  const auto measured = session_.measures.find(visit.revision);
  const Tick newest = measured == session_.measures.end() ? tickOf(visit.begin) : measured->second.tick;
  const bool is_of_the_end = session_.clock.between(newest, tickOf(visit.end)) <= kLate;
  if (measured != session_.measures.end() && is_of_the_end)
    visit.error = measured->second.error;
  else
    visit.error = {kUnknown, kUnknown};
  // the server counts contacts of the step's object alone, every tick
  const auto counted = session_.contact_seconds.find(visit.revision);
  if (counted != session_.contact_seconds.end()) visit.metrics.contact_seconds = counted->second;
  if (!is_of_the_end) visit.metrics.contact_seconds = kUnknown;
}

void SessionAnalyzer::summarize() {
  analysis_.whole = metrics(0.0, analysis_.duration);
  if (!analysis_.visits.empty()) analysis_.whole.contact_seconds = 0.0;
  for (StepVisit& visit : analysis_.visits) {
    visit.metrics = metrics(visit.begin, visit.end);
    visit.seconds = secondsOf(session_.clock.between(tickOf(visit.begin), tickOf(visit.end)));
    measure(visit);
    analysis_.whole.contact_seconds += visit.metrics.contact_seconds;
    visit.path = pathOf(visit);
    visit.collisions = collisionsOf(visit);
    analysis_.path += visit.path;
    if (!visit.collisions) analysis_.collisions.reset();
    if (analysis_.collisions) *analysis_.collisions += *visit.collisions;
  }
  std::vector<double> values;
  for (const SeriesPoint& point : analysis_.compute) values.push_back(point.value);
  analysis_.compute_median = percentile(values, 0.5);
  analysis_.compute_p99 = percentile(values, 0.99);
  analysis_.compute_worst = peak(analysis_.compute_max, 0.0, analysis_.duration);
}

/// By time; of equal times those of the server first, in their order.
void SessionAnalyzer::sortEvents() {
  auto& client_events = session_.client_events;
  // how many steps a station makes after the end of the run is chance
  if (isOver(session_.run.phase))
    std::erase_if(client_events,
                  [&](const SessionEvent& event) { return event.time >= secondsOf(session_.run.tick); });
  std::sort(client_events.begin(), client_events.end(), [](const SessionEvent& a, const SessionEvent& b) {
    return std::tie(a.time, a.text) < std::tie(b.time, b.text);
  });
  auto& events = analysis_.events;
  events.insert(events.end(), client_events.begin(), client_events.end());
  std::stable_sort(events.begin(), events.end(),
                   [](const SessionEvent& a, const SessionEvent& b) { return a.time < b.time; });
}

}  // namespace

bool SessionAnalysis::succeeded(bool allow_skips) const {
  if (!has_run || !isCompleted(run, allow_skips) || steps == 0) return false;
  if (allow_skips) return true;
  for (std::uint32_t step = 0; step < steps; ++step) {
    const bool done = std::any_of(visits.begin(), visits.end(), [&](const StepVisit& visit) {
      return visit.step == step && visit.phase == StepPhase::kDone;
    });
    if (!done) return false;
  }
  return true;
}

Result<SessionAnalysis> analyzeRecording(const std::filesystem::path& file, const std::string& language) {
  auto session = readRecording(file);
  if (!session) return fail(session.error().what);
  SessionAnalysis analysis = SessionAnalyzer(*session, language).run();
  analysis.file = file.filename().string();
  return analysis;
}

}  // namespace tenon::report
