#include "clients/report/page.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "clients/report/chart.h"
#include "clients/report/summary.h"
#include "idl/types/names.h"

namespace tenon::report {
namespace {

constexpr std::string_view kStyle = R"css(
:root { color-scheme: light dark; --page: #f6f7f9; --card: #fff; --ink: #1b2430; --soft: #5c6b7c; --line: #dde3ea;
  --band0: #eaf0f7; --band1: #f4f7fb; --c1: #1466c2; --c2: #e0752d; --c3: #158a72; --c4: #7b4bc4; --good: #17803d;
  --warn: #b86e00; --bad: #c4282d; }
@media (prefers-color-scheme: dark) { :root { --page: #12161c; --card: #1a2028; --ink: #e5eaf0; --soft: #95a3b3;
  --line: #303a46; --band0: #232d39; --band1: #1d2530; --c1: #5aa7ff; --c2: #ff9d57; --c3: #3fcaa9; --c4: #b692f6;
  --good: #4cc978; --warn: #f0ae45; --bad: #ff6e70; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--ink); font: 15px/1.5 system-ui, "Segoe UI", Roboto, sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 32px 20px 56px; }
h1 { font-size: 30px; line-height: 1.2; margin: 0 0 4px; }
h2 { font-size: 18px; margin: 34px 0 10px; }
.soft { color: var(--soft); }
.outcome { display: inline-block; padding: 3px 12px; border-radius: 99px; color: #fff; font-weight: 600; }
.outcome.good { background: var(--good); color: #fff; } .outcome.bad { background: var(--bad); color: #fff; }
@media screen and (prefers-color-scheme: dark) { .outcome.good, .outcome.bad { color: #10141a; } }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 10px; margin: 22px 0 0; }
.tile, .card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; }
.tile { padding: 10px 14px; } .tile b { display: block; font-size: 22px; font-variant-numeric: tabular-nums; }
.tile span { color: var(--soft); font-size: 13px; }
.card { padding: 10px 14px; margin: 0 0 12px; overflow-x: auto; }
.warning { border-color: var(--warn); margin-top: 18px; }
img { width: 100%; border-radius: 10px; border: 1px solid var(--line); margin-top: 22px; display: block; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th { font-weight: 600; font-size: 13px; color: var(--soft); text-align: right; padding: 6px 8px; vertical-align: bottom; }
td { text-align: right; padding: 6px 8px; border-top: 1px solid var(--line); }
th:nth-child(-n+2), td:nth-child(-n+2) { text-align: left; } td.state, th.state { text-align: left; }
tr.sum td { font-weight: 600; border-top: 2px solid var(--line); }
.part { color: var(--soft); font-size: 13px; }
.facts td { text-align: left; width: 34%; } .facts td + td { width: auto; }
table tr:first-child td { border-top: 0; }
.events td { text-align: left; vertical-align: top; } .events td:first-child { text-align: right; width: 80px; }
.good { color: var(--good); } .warn { color: var(--warn); } .bad { color: var(--bad); }
svg { display: block; width: 100%; height: auto; font: 11px system-ui, "Segoe UI", Roboto, sans-serif; }
svg text { fill: var(--ink); } svg .tick, svg .unit, svg .step { fill: var(--soft); }
svg .name { font-size: 14px; font-weight: 600; } svg .step { text-anchor: middle; }
.band0 { fill: var(--band0); } .band1 { fill: var(--band1); }
.grid { stroke: var(--line); fill: none; } .curve { fill: none; stroke-width: 1.2; stroke-linejoin: round; }
.thick { stroke-width: 3; } .c1 { stroke: var(--c1); } .c2 { stroke: var(--c2); } .c3 { stroke: var(--c3); }
.c4 { stroke: var(--c4); } path.limit { stroke: var(--bad); stroke-dasharray: 5 4; }
svg text.limit { fill: var(--bad); }
.mark path { stroke: currentColor; stroke-dasharray: 2 3; opacity: .7; } .mark circle { fill: currentColor; }
footer { margin-top: 34px; color: var(--soft); font-size: 13px; }
@media print { :root { --page: #fff; --card: #fff; --ink: #000; --soft: #444; --line: #bbb; --band0: #e9edf2;
  --band1: #f5f7f9; --c1: #1466c2; --c2: #d0661f; --c3: #158a72; --c4: #7b4bc4; --good: #17803d; --warn: #b86e00;
  --bad: #c4282d; }
  body { font-size: 11px; -webkit-print-color-adjust: exact; print-color-adjust: exact; }
  main { max-width: none; padding: 0; } .card, tr, .tiles { break-inside: avoid; } h2 { break-after: avoid; } }
)css";

std::string dateOf(std::int64_t time_ns) {
  const auto time = static_cast<std::time_t>(time_ns / 1'000'000'000);
  std::tm calendar{};
  if (gmtime_r(&time, &calendar) == nullptr) return "";
  char text[48];
  std::strftime(text, sizeof text, "%d %B %Y, %H:%M UTC", &calendar);
  return text;
}

std::string_view styleOf(StepPhase phase) {
  if (phase == StepPhase::kDone) return "good";
  return phase == StepPhase::kTimedOut ? "bad" : "warn";
}

/// CSS class of an event that is marked in the charts; nullptr for all others.
const char* markStyleOf(const SessionEvent& event) {
  if (event.kind == "mounted") return "good";
  if (event.severity == Severity::kError || event.kind == "emergency stop") return "bad";
  if (event.severity == Severity::kWarning || event.kind == "hand frozen" || event.kind == "safety")
    return "warn";
  return nullptr;
}

/// Whether an event is about people, steps, mounts or safety.
bool isForTrainers(const SessionEvent& event) {
  static const std::set<std::string, std::less<>> kKinds{
      "join",           "leave",       "run",         "step",      "step done", "step skipped",
      "step timed out", "not in time", "taken",       "let go",    "mounted",   "put in place",
      "emergency stop", "safety",      "hand frozen", "hand gone", "note",      "command"};
  return event.severity == Severity::kError || kKinds.contains(event.kind);
}

/// The events for trainers. A safety layer may act many times a second: an event that follows one of its
/// kind within 10 s is counted there.
std::vector<SessionEvent> condensed(const std::vector<SessionEvent>& events) {
  constexpr double kJoinTime = 10.0;  // [s]
  struct Group {
    std::size_t index = 0;  // of its first event in `few`
    double last = 0.0;      // [s]
    int more = 0;
  };
  std::vector<SessionEvent> few;
  std::vector<Group> groups;
  std::map<std::string, std::size_t> newest;  // group of each kind
  for (const SessionEvent& event : events) {
    if (!isForTrainers(event)) continue;
    const bool repeats = event.kind == "safety" || event.kind == "hand frozen";
    const auto known = newest.find(event.kind);
    if (repeats && known != newest.end() && event.time - groups[known->second].last < kJoinTime) {
      groups[known->second].last = event.time;
      ++groups[known->second].more;
      continue;
    }
    newest[event.kind] = groups.size();
    groups.push_back({few.size(), event.time, 0});
    few.push_back(event);
  }
  for (const Group& group : groups)
    if (group.more > 0)
      few[group.index].text += fmt::format(" (and {} more until {:.1f} s)", group.more, group.last);
  return few;
}

/// "12 others: 10 refused, 2 hand free": the events that condensed() leaves out, by kind; empty without any.
std::string othersOf(const std::vector<SessionEvent>& events) {
  std::map<std::string, int> kinds;
  int all = 0;
  for (const SessionEvent& event : events) {
    if (isForTrainers(event)) continue;
    ++kinds[event.kind];
    ++all;
  }
  if (all == 0) return "";
  std::string text = fmt::format("{} other{}", all, all == 1 ? "" : "s");
  const char* separator = ": ";
  for (const auto& [kind, count] : kinds) {
    text += fmt::format("{}{} {}", separator, count, kind);
    separator = ", ";
  }
  return text + "; all are in summary.json";
}

std::string head(const SessionAnalysis& analysis) {
  const std::string title = escaped(analysis.title.empty() ? "Session " + analysis.session : analysis.title);
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{0}: report</title>\n"
      "<style>{1}</style>\n</head>\n<body>\n<main>\n<h1>{0}</h1>\n<p class=\"soft\">{2}",
      title, kStyle, dateOf(analysis.began_ns));
  for (const SessionParticipant& participant : analysis.participants) {
    if (participant.role == Role::kRecorder) continue;
    html += fmt::format(" · {} ({})", escaped(participant.name), roleName(participant.role));
  }
  if (analysis.lockstep) html += " · lockstep, not in real time";
  html += "</p>\n";
  html += fmt::format("<p><span class=\"outcome {}\">{}</span> <span class=\"soft\">{}</span></p>\n",
                      analysis.succeeded() ? "good" : "bad", escaped(outcomeOf(analysis)),
                      escaped(analysis.run.reason));
  if (!analysis.problem.empty())
    html += fmt::format("<p class=\"card warning\"><b class=\"warn\">Warning:</b> {}</p>\n",
                        escaped(analysis.problem));
  return html;
}

std::string tile(const std::string& value, std::string_view what) {
  return fmt::format("<div class=\"tile\"><b>{}</b><span>{}</span></div>", value, what);
}

std::string tiles(const SessionAnalysis& analysis) {
  std::string html = "<div class=\"tiles\">";
  html += tile(fmt::format("{:.0f}:{:04.1f}", std::floor(analysis.duration / 60.0),
                           std::fmod(analysis.duration, 60.0)),
               "session time [min:s]");
  html += tile(fmt::format("{:.1f} N", analysis.whole.peak_force), "largest force on a hand");
  html += tile(fmt::format("{:.1f} s", analysis.whole.contact_seconds), "in contact");
  html += tile(std::to_string(analysis.collisions), "collisions");
  html += tile(fmt::format("{:.1f} m", analysis.path), "path of the parts");
  const auto done = std::count_if(analysis.visits.begin(), analysis.visits.end(),
                                  [](const StepVisit& visit) { return visit.phase == StepPhase::kDone; });
  html += tile(fmt::format("{} of {}", done, analysis.steps), "steps done");
  return html + "</div>\n";
}

std::string stepTable(const SessionAnalysis& analysis) {
  std::string html =
      "<h2>Steps</h2>\n<div class=\"card\"><table>\n<tr><th></th><th>step</th><th>time<br>[s]</th>"
      "<th>error, of<br>allowed [mm]</th><th>path of the<br>part [m]</th><th>collisions</th>"
      "<th>peak force<br>[N]</th><th>mean force<br>in contact [N]</th><th>contact<br>[s]</th>"
      "<th class=\"state\"></th></tr>\n";
  const auto cells = [](double time, const std::string& error, double path, int collisions,
                        const SessionMetrics& metrics) {
    return fmt::format(
        "<td>{:.1f}</td><td>{}</td><td>{:.2f}</td><td>{}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.1f}</td>",
        time, error, path, collisions, metrics.peak_force, metrics.mean_force, metrics.contact_seconds);
  };
  for (std::size_t i = 0; i < analysis.visits.size(); ++i) {
    const StepVisit& visit = analysis.visits[i];
    html += fmt::format("<tr><td>{}</td><td>{}", i + 1, escaped(titleText(visit)));
    if (!visit.part.empty()) html += fmt::format(" <span class=\"part\">{}</span>", escaped(visit.part));
    html += fmt::format(
        "</td>{}<td class=\"state {}\">{}</td></tr>\n",
        cells(visit.end - visit.begin, errorText(visit), visit.path, visit.collisions, visit.metrics),
        styleOf(visit.phase), phaseName(visit.phase));
  }
  html += fmt::format("<tr class=\"sum\"><td></td><td>whole session</td>{}<td></td></tr>\n",
                      cells(analysis.duration, "", analysis.path, analysis.collisions, analysis.whole));
  return html +
         "</table></div>\n<p class=\"soft\">Error: last distance of the part from its place, of what is "
         "allowed. "
         "Forces: what the device displayed on the hand. Collisions: contacts of the part that began.</p>\n";
}

/// What describes the simulation more than the trainee.
std::string engineerTable(const SessionAnalysis& analysis) {
  std::string html =
      "<h2>For engineers</h2>\n<div class=\"card\"><table>\n<tr><th></th><th>step</th><th>hand–part<br>gap "
      "[mm]</th><th>overlap<br>[mm]</th><th>comp. load<br>[%]</th></tr>\n";
  const auto row = [&html](const std::string& number, const std::string& title,
                           const SessionMetrics& metrics) {
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.0f}</td></tr>\n",
                        number, escaped(title), 1e3 * metrics.gap, 1e3 * metrics.depth, metrics.load);
  };
  for (std::size_t i = 0; i < analysis.visits.size(); ++i)
    row(std::to_string(i + 1), titleText(analysis.visits[i]), analysis.visits[i].metrics);
  row("", "whole session", analysis.whole);
  return html +
         "</table></div>\n<p class=\"soft\">Gap: how far contacts hold the part back behind the hand. "
         "Overlap: how "
         "deep two parts are inside each other. Computational load: work of the most expensive pair of "
         "parts, 100 % "
         "is its limit.</p>\n";
}

std::string charts(const SessionAnalysis& analysis) {
  std::vector<ChartBand> bands;
  for (const StepVisit& visit : analysis.visits) {
    bands.push_back(
        {visit.begin, visit.end, visit.title,
         fmt::format("{}: {:.1f} s, {}", visit.title, visit.end - visit.begin, phaseName(visit.phase))});
  }
  std::vector<ChartMark> marks;
  for (const SessionEvent& event : condensed(analysis.events))
    if (const char* style = markStyleOf(event))
      marks.push_back({event.time, style, event.kind + ": " + event.text});

  Chart force{"Force", "N", {{"trainee", "c1", &analysis.trainee_force}}};
  if (!analysis.instructor_force.empty())
    force.curves.push_back({"instructor", "c2", &analysis.instructor_force});
  const Chart penetration{
      "Gap and overlap",
      "mm",
      {{"hand–part gap", "c1", &analysis.gap, 1e3}, {"overlap", "c2", &analysis.depth, 1e3}}};
  const Chart load{
      "Computational load", "%", {{"largest of all pairs", "c3", &analysis.load}}, 0.0, "", 10.0};
  const Chart compute{"Computation time",
                      "ms",
                      {{"longest of ten ticks", "c4", &analysis.compute_max, 1e3}},
                      1.0,
                      "real-time limit: 1 ms",
                      1.2,
                      4.0};
  std::string html = "<h2>Over time</h2>\n";
  for (const Chart* chart : {static_cast<const Chart*>(&force), &penetration, &load, &compute})
    html += "<div class=\"card\">" + drawChart(*chart, analysis.duration, bands, marks) + "</div>\n";
  html +=
      "<p class=\"soft\">Bands: the steps of the table. Dots: <span class=\"good\">mounted</span>, "
      "<span class=\"warn\">warning, frozen hand or safety limit</span>, <span class=\"bad\">fault or "
      "emergency stop</span>.</p>\n";
  return html;
}

std::string performanceTable(const SessionAnalysis& analysis) {
  std::string html = "<h2>Real-time performance</h2>\n<div class=\"card\"><table class=\"facts\">\n";
  const auto line = [&html](std::string_view what, const std::string& value) {
    html += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", what, escaped(value));
  };
  line("Computation time of a tick",
       fmt::format("median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms", 1e3 * analysis.compute_median,
                   1e3 * analysis.compute_p99, 1e3 * analysis.compute_worst));
  line("Late ticks", std::to_string(analysis.late_ticks));
  line("Oldest input used by a tick", fmt::format("{:.1f} ms", 1e3 * analysis.input_age));
  for (const ForceLatency& latency : analysis.force_latencies)
    line("Latency from input to force",
         fmt::format("{}: median {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms", latency.who, 1e3 * latency.p50,
                     1e3 * latency.p99, 1e3 * latency.max));
  std::string aids;
  for (const std::string& aid : analysis.aids) aids += (aids.empty() ? "" : "; ") + aid;
  line("Aids used", aids.empty() ? "none" : aids);
  return html + "</table></div>\n";
}

std::string eventTable(const SessionAnalysis& analysis) {
  constexpr std::size_t kMaxEvents = 200;
  const std::vector<SessionEvent> events = condensed(analysis.events);
  if (events.empty()) return "";
  std::string html = "<h2>Events</h2>\n<div class=\"card\"><table class=\"events\">\n";
  for (std::size_t i = 0; i < std::min(kMaxEvents, events.size()); ++i) {
    const SessionEvent& event = events[i];
    const char* style = markStyleOf(event);
    html +=
        fmt::format("<tr><td class=\"soft\">{:.1f} s</td><td class=\"{}\">{}</td><td>{}</td></tr>\n",
                    event.time, style == nullptr ? "soft" : style, escaped(event.kind), escaped(event.text));
  }
  if (events.size() > kMaxEvents)
    html += fmt::format("<tr><td></td><td></td><td class=\"soft\">and {} more, see summary.json</td></tr>\n",
                        events.size() - kMaxEvents);
  if (const std::string others = othersOf(analysis.events); !others.empty())
    html += fmt::format("<tr><td></td><td></td><td class=\"soft\">{}</td></tr>\n", escaped(others));
  return html + "</table></div>\n";
}

}  // namespace

std::string reportPage(const SessionAnalysis& analysis, const std::string& picture) {
  std::string html = head(analysis) + tiles(analysis);
  if (!picture.empty()) html += fmt::format("<img src=\"{}\" alt=\"the scene\">\n", escaped(picture));
  html += stepTable(analysis) + charts(analysis) + eventTable(analysis) + engineerTable(analysis) +
          performanceTable(analysis);
  html += fmt::format("<footer>{}, {} messages", escaped(analysis.file), analysis.messages);
  if (analysis.run.final_hash != 0) html += fmt::format(", final state {:016x}", analysis.run.final_hash);
  return html + "</footer>\n</main>\n</body>\n</html>\n";
}

}  // namespace tenon::report
