#include "clients/report/session_analysis.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include <fmt/format.h>

namespace tenon::report {
namespace {

Tick tickOf(double seconds) { return static_cast<Tick>(std::llround(seconds / kTickSeconds)); }

/// Computes the figures of a session when all of its messages are read, by tick: equal sessions give equal
/// figures.
class SessionAnalyzer {
 public:
  SessionAnalyzer(RecordedSession& session, const std::string& language)
      : session_(session), language_(language) {}

  SessionAnalysis run() {
    copyFacts();
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
  void addVisit(const StepState& step);
  [[nodiscard]] bool wasDone(const StepVisit& visit) const;
  void endVisits();
  void mergeHands();
  void sortEvents();
  void listAids();
  void dropOwnGrabs();
  void summarize();
  [[nodiscard]] double pathOf(const StepVisit& visit) const;
  [[nodiscard]] int collisionsOf(const StepVisit& visit) const;
  [[nodiscard]] SessionMetrics metrics(double begin, double end) const;

  RecordedSession& session_;
  const std::string& language_;
  SessionAnalysis analysis_;
  std::vector<Series> contact_forces_;  ///< [N] of each of the trainee's hands
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
  // a step ends where the next one begins; one that ends without a message was done if a later one follows,
  // else abandoned
  if (!visits.empty()) visits.back().end = secondsOf(step.started);
  if (!visits.empty() && visits.back().phase == StepPhase::kActive)
    visits.back().phase =
        step.step > visits.back().step && wasDone(visits.back()) ? StepPhase::kDone : StepPhase::kWaiting;
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

/// By the event log: a step that was left by a command has no such event. A log without any is not asked.
bool SessionAnalyzer::wasDone(const StepVisit& visit) const {
  constexpr double kSlack = 0.01;  // [s] some ticks between end and begin
  bool any = false;
  for (const SessionEvent& event : session_.events) {
    if (event.kind != "step done") continue;
    any = true;
    if (event.text.starts_with(visit.name + " (") && event.time >= visit.begin &&
        event.time <= visit.end + kSlack)
      return true;
  }
  return !any;
}

void SessionAnalyzer::endVisits() {
  if (!analysis_.visits.empty()) analysis_.visits.back().end = analysis_.duration;
  for (StepVisit& visit : analysis_.visits) {
    if (visit.phase != StepPhase::kActive) continue;
    if (analysis_.run.phase == RunPhase::kSucceeded) visit.phase = StepPhase::kDone;
    if (analysis_.run.phase == RunPhase::kFailed) visit.phase = StepPhase::kTimedOut;
  }
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
  result.peak_force = peak(analysis_.trainee_force, begin, end);
  result.gap = peak(analysis_.gap, begin, end);
  result.depth = peak(analysis_.depth, begin, end);
  result.load = peak(analysis_.load, begin, end);
  double sum = 0.0;
  std::size_t count = 0;
  for (const Series& force : contact_forces_) {
    const std::span<const SeriesPoint> points = between(force, begin, end);
    for (const SeriesPoint& point : points) sum += point.value;
    count += points.size();
  }
  if (count > 0) result.mean_force = sum / static_cast<double>(count);
  for (const SeriesPoint& point : between(contact_, begin, end))
    result.contact_seconds += point.value * kTickSeconds;
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

int SessionAnalyzer::collisionsOf(const StepVisit& visit) const {
  constexpr double kApart = 0.2;  // [s] a shorter interruption does not end a contact
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

void SessionAnalyzer::summarize() {
  analysis_.whole = metrics(0.0, analysis_.duration);
  if (!analysis_.visits.empty()) analysis_.whole.contact_seconds = 0.0;
  for (StepVisit& visit : analysis_.visits) {
    visit.metrics = metrics(visit.begin, visit.end);
    visit.seconds = secondsOf(session_.clock.between(tickOf(visit.begin), tickOf(visit.end)));
    // the server counts contacts of the step's object alone, every tick
    const auto counted = session_.contact_seconds.find(visit.revision);
    if (counted != session_.contact_seconds.end()) visit.metrics.contact_seconds = counted->second;
    analysis_.whole.contact_seconds += visit.metrics.contact_seconds;
    if (const auto error = session_.errors.find(visit.revision); error != session_.errors.end())
      visit.error = error->second;
    visit.path = pathOf(visit);
    visit.collisions = collisionsOf(visit);
    analysis_.path += visit.path;
    analysis_.collisions += visit.collisions;
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
