#include "clients/report/page.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "clients/report/chart.h"
#include "clients/report/summary.h"
#include "idl/types/names.h"

namespace tenon {
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

/// Of the log, what belongs into a diagram; nullptr for the rest.
const char* markOf(const SessionEvent& event) {
  if (event.kind == "mounted") return "good";
  if (event.severity == Severity::kError || event.kind == "emergency stop") return "bad";
  if (event.severity == Severity::kWarning || event.kind == "hand frozen" || event.kind == "safety")
    return "warn";
  return nullptr;
}

/// A safety layer may act many times a second: what follows its like within two seconds is told with it.
std::vector<SessionEvent> condensed(const std::vector<SessionEvent>& events) {
  constexpr double kTogether = 2.0;
  struct Group {
    std::size_t place = 0;
    double last = 0.0;
    int more = 0;
  };
  std::vector<SessionEvent> few;
  std::vector<Group> groups;
  std::map<std::string, std::size_t> newest;  // group of each kind
  for (const SessionEvent& event : events) {
    const bool repeats = event.kind == "safety" || event.kind == "refused";
    const auto known = newest.find(event.kind);
    if (repeats && known != newest.end() && event.time - groups[known->second].last < kTogether) {
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
      few[group.place].text += fmt::format(" (and {} more until {:.1f} s)", group.more, group.last);
  return few;
}

std::string head(const SessionStory& story) {
  const std::string title = escaped(story.title.empty() ? "Session " + story.session : story.title);
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{0}: report</title>\n"
      "<style>{1}</style>\n</head>\n<body>\n<main>\n<h1>{0}</h1>\n<p class=\"soft\">{2}",
      title, kStyle, dateOf(story.began_ns));
  for (const Person& person : story.people) {
    if (person.role == Role::kRecorder) continue;
    html += fmt::format(" · {} ({})", escaped(person.name), roleName(person.role));
  }
  if (story.lockstep) html += " · lockstep, not in real time";
  html += "</p>\n";
  html +=
      fmt::format("<p><span class=\"outcome {}\">{}</span> <span class=\"soft\">{}</span></p>\n",
                  story.succeeded() ? "good" : "bad", escaped(outcomeOf(story)), escaped(story.run.reason));
  if (!story.problem.empty())
    html += fmt::format("<p class=\"card warning\"><b class=\"warn\">Careful:</b> {}</p>\n",
                        escaped(story.problem));
  return html;
}

std::string tile(const std::string& value, std::string_view what) {
  return fmt::format("<div class=\"tile\"><b>{}</b><span>{}</span></div>", value, what);
}

std::string tiles(const SessionStory& story) {
  std::string html = "<div class=\"tiles\">";
  html +=
      tile(fmt::format("{:.0f}:{:04.1f}", std::floor(story.duration / 60.0), std::fmod(story.duration, 60.0)),
           "minutes in session");
  html += tile(fmt::format("{:.1f} N", story.whole.peak_force), "largest force on a hand");
  html += tile(fmt::format("{:.1f} s", story.whole.contact_seconds), "in contact");
  html += tile(fmt::format("{:.2f} mm", 1e3 * story.whole.gap), "largest device–proxy gap");
  html += tile(fmt::format("{:.2f} mm", 1e3 * story.whole.depth), "deepest in a part's field");
  html += tile(fmt::format("{:.0f} %", story.whole.load), "largest load");
  return html + "</div>\n";
}

std::string cells(double time, const Figures& figures) {
  return fmt::format(
      "<td>{:.1f}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.0f}</"
      "td>",
      time, figures.peak_force, figures.mean_force, figures.contact_seconds, 1e3 * figures.gap,
      1e3 * figures.depth, figures.load);
}

std::string stepTable(const SessionStory& story) {
  std::string html =
      "<h2>Steps</h2>\n<div class=\"card\"><table>\n<tr><th></th><th>step</th><th>time<br>[s]</th>"
      "<th>peak force<br>[N]</th><th>mean force<br>in contact [N]</th><th>contact<br>[s]</th>"
      "<th>device–proxy<br>gap [mm]</th><th>field depth<br>[mm]</th><th>load<br>[%]</th><th "
      "class=\"state\"></th></tr>\n";
  for (std::size_t i = 0; i < story.visits.size(); ++i) {
    const StepVisit& visit = story.visits[i];
    html += fmt::format("<tr><td>{}</td><td>{}", i + 1, escaped(visit.title));
    if (!visit.part.empty()) html += fmt::format(" <span class=\"part\">{}</span>", escaped(visit.part));
    html += fmt::format("</td>{}<td class=\"state {}\">{}</td></tr>\n",
                        cells(visit.end - visit.begin, visit.figures), styleOf(visit.phase),
                        phaseName(visit.phase));
  }
  html += fmt::format("<tr class=\"sum\"><td></td><td>whole session</td>{}<td></td></tr>\n",
                      cells(story.duration, story.whole));
  return html + "</table></div>\n";
}

std::string charts(const SessionStory& story) {
  std::vector<Band> bands;
  for (const StepVisit& visit : story.visits) {
    bands.push_back(
        {visit.begin, visit.end, visit.title,
         fmt::format("{}: {:.1f} s, {}", visit.title, visit.end - visit.begin, phaseName(visit.phase))});
  }
  std::vector<Mark> marks;
  for (const SessionEvent& event : condensed(story.events))
    if (const char* style = markOf(event))
      marks.push_back({event.time, style, event.kind + ": " + event.text});

  Chart force{"Force", "N", {{"trainee", "c1", &story.trainee_force}}};
  if (!story.instructor_force.empty()) force.curves.push_back({"instructor", "c2", &story.instructor_force});
  const Chart penetration{
      "Penetration",
      "mm",
      {{"device–proxy gap", "c1", &story.gap, 1e3}, {"field depth", "c2", &story.depth, 1e3}}};
  const Chart load{"Load", "%", {{"largest of the pairs", "c3", &story.load}}, 0.0, "", 10.0};
  const Chart compute{"Computation time",
                      "ms",
                      {{"longest of ten ticks", "c4", &story.compute_max, 1e3}},
                      1.0,
                      "one tick: 1 ms",
                      1.2,
                      4.0};
  std::string html = "<h2>Over time</h2>\n";
  for (const Chart* chart : {static_cast<const Chart*>(&force), &penetration, &load, &compute})
    html += "<div class=\"card\">" + drawChart(*chart, story.duration, bands, marks) + "</div>\n";
  html +=
      "<p class=\"soft\">Bands are the steps of the table. Dots: <span class=\"good\">mounted</span>, "
      "<span class=\"warn\">warning, hand frozen or safety</span>, <span class=\"bad\">fault or "
      "stop</span>.</p>\n";
  return html;
}

std::string machineTable(const SessionStory& story) {
  std::string html = "<h2>How the machine kept up</h2>\n<div class=\"card\"><table class=\"facts\">\n";
  const auto line = [&html](std::string_view what, const std::string& value) {
    html += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", what, escaped(value));
  };
  line("Computation time of a tick",
       fmt::format("median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms", 1e3 * story.compute_median,
                   1e3 * story.compute_p99, 1e3 * story.compute_worst));
  line("Late ticks", std::to_string(story.late_ticks));
  line("Oldest input a tick used", fmt::format("{:.1f} ms", 1e3 * story.input_age));
  for (const ForceAge& age : story.force_ages)
    line("From input to force", fmt::format("{}: median {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms", age.who,
                                            1e3 * age.p50, 1e3 * age.p99, 1e3 * age.max));
  std::string aids;
  for (const std::string& aid : story.aids) aids += (aids.empty() ? "" : "; ") + aid;
  line("Aids used", aids.empty() ? "none" : aids);
  return html + "</table></div>\n";
}

std::string eventTable(const SessionStory& story) {
  constexpr std::size_t kMost = 200;
  const std::vector<SessionEvent> events = condensed(story.events);
  if (events.empty()) return "";
  std::string html = "<h2>What happened</h2>\n<div class=\"card\"><table class=\"events\">\n";
  for (std::size_t i = 0; i < std::min(kMost, events.size()); ++i) {
    const SessionEvent& event = events[i];
    const char* style = markOf(event);
    html +=
        fmt::format("<tr><td class=\"soft\">{:.1f} s</td><td class=\"{}\">{}</td><td>{}</td></tr>\n",
                    event.time, style == nullptr ? "soft" : style, escaped(event.kind), escaped(event.text));
  }
  if (events.size() > kMost)
    html += fmt::format("<tr><td></td><td></td><td class=\"soft\">and {} more, see summary.json</td></tr>\n",
                        events.size() - kMost);
  return html + "</table></div>\n";
}

}  // namespace

std::string reportPage(const SessionStory& story, const std::string& picture) {
  std::string html = head(story) + tiles(story);
  if (!picture.empty()) html += fmt::format("<img src=\"{}\" alt=\"the scene\">\n", escaped(picture));
  html += stepTable(story) + charts(story) + machineTable(story) + eventTable(story);
  html += fmt::format("<footer>{}, {} messages", escaped(story.file), story.messages);
  if (story.run.final_hash != 0) html += fmt::format(", final state {:016x}", story.run.final_hash);
  return html + "</footer>\n</main>\n</body>\n</html>\n";
}

}  // namespace tenon
