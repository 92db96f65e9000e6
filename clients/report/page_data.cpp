#include "clients/report/page_data.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "clients/report/event_list.h"
#include "clients/report/summary.h"

namespace tenon::report {
namespace {

constexpr double kSamplePeriod = 0.01;      // [s] of most series
constexpr double kHighestComputing = 4e-3;  // [s] the plot of computation times ends here
constexpr std::size_t kMaxListedEvents = 2000;

/// Four digits: what a plot can show.
double rounded(double value) {
  if (value == 0.0) return 0.0;
  const double scale = std::pow(10.0, 3.0 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

/// The largest value in each of `count` stretches of `width` [s].
nlohmann::json columnsOf(const Series& series, double width, std::size_t count) {
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  std::vector<double> largest(count, kNone);
  for (const SeriesPoint& point : series) {
    if (point.time < 0.0) continue;
    double& column = largest[std::min(count - 1, static_cast<std::size_t>(point.time / width))];
    column = std::max(column, point.value);
  }
  nlohmann::json columns = nlohmann::json::array();
  for (const double value : largest)
    columns.push_back(value == kNone ? nlohmann::json() : nlohmann::json(rounded(value)));
  return columns;
}

nlohmann::json plotsOf(const SessionAnalysis& analysis) {
  const double width = std::max(kSamplePeriod, analysis.duration / static_cast<double>(kMaxColumns));
  const std::size_t count =
      std::clamp<std::size_t>(static_cast<std::size_t>(std::ceil(analysis.duration / width)), 1, kMaxColumns);
  nlohmann::json plots = {{"seconds", width}, {"count", count}};
  const auto add = [&](const char* name, const Series& series) {
    if (!series.empty()) plots["series"][name] = columnsOf(series, width, count);
  };
  plots["series"] = nlohmann::json::object();
  add("trainee_force", analysis.trainee_force);
  add("instructor_force", analysis.instructor_force);
  add("gap", analysis.gap);
  add("depth", analysis.depth);
  add("load", analysis.load);
  add("compute", analysis.compute_max);
  const auto above = std::count_if(analysis.compute_max.begin(), analysis.compute_max.end(),
                                   [](const SeriesPoint& point) { return point.value > kHighestComputing; });
  plots["compute_cut"] = {
      {"limit", kHighestComputing}, {"above", above}, {"largest", analysis.compute_worst}};
  return plots;
}

}  // namespace

nlohmann::json pageData(const SessionAnalysis& analysis) {
  nlohmann::json summary = summaryJson(analysis);
  summary.erase("events");
  nlohmann::json data = {{"version", 1},
                         {"summary", std::move(summary)},
                         {"steps_of_exercise", analysis.steps},
                         {"plots", plotsOf(analysis)},
                         {"events", nlohmann::json::array()},
                         {"other_events", otherEvents(analysis.events)}};
  const std::vector<ReportEvent> events = listedEvents(analysis.events);
  for (std::size_t i = 0; i < std::min(events.size(), kMaxListedEvents); ++i) {
    const ReportEvent& event = events[i];
    nlohmann::json row = {{"time", event.event.time},
                          {"kind", event.event.kind},
                          {"text", event.event.text},
                          {"tone", event.tone}};
    if (event.more > 0) row.update({{"more", event.more}, {"until", event.until}});
    data["events"].push_back(std::move(row));
  }
  data["unlisted_events"] = events.size() - data["events"].size();
  return data;
}

}  // namespace tenon::report
