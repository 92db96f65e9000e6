#include "clients/report/summary.h"

#include <algorithm>

#include <fmt/format.h>

#include "idl/types/names.h"

namespace tenon {
namespace {

/// Counts what a terminal shows: bytes that continue a UTF-8 letter take no room.
std::size_t shownLength(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char byte) { return (byte & 0xC0) != 0x80; }));
}

std::string padded(std::string text, std::size_t width) {
  for (std::size_t length = shownLength(text); length < width; ++length) text += ' ';
  return text;
}

std::string row(const Figures& figures) {
  return fmt::format("{:8.1f} {:8.1f} {:9.1f} {:8.2f} {:8.2f} {:7.0f}", figures.peak_force,
                     figures.mean_force, figures.contact_seconds, 1e3 * figures.gap, 1e3 * figures.depth,
                     figures.load);
}

nlohmann::json jsonOf(const Figures& figures) {
  return {{"peak_force", figures.peak_force},
          {"mean_force", figures.mean_force},
          {"contact_seconds", figures.contact_seconds},
          {"device_proxy_gap", figures.gap},
          {"field_depth", figures.depth},
          {"load_percent", figures.load}};
}

}  // namespace

std::string_view phaseName(StepPhase phase) {
  switch (phase) {
    case StepPhase::kWaiting:
      return "left";
    case StepPhase::kActive:
      return "not finished";
    case StepPhase::kDone:
      return "done";
    case StepPhase::kTimedOut:
      return "timed out";
    case StepPhase::kSkipped:
      return "skipped";
  }
  return "unknown";
}

std::string outcomeOf(const SessionStory& story) {
  if (story.succeeded()) return "succeeded";
  if (!story.has_run) return "unknown: the recording holds no outcome";
  switch (story.run.phase) {
    case RunPhase::kSucceeded:
      return "not every step was done";
    case RunPhase::kFailed:
      return "failed";
    case RunPhase::kStopped:
      return "stopped";
    default:
      return "not finished";
  }
}

std::string summaryText(const SessionStory& story) {
  std::size_t width = 10;
  for (const StepVisit& visit : story.visits) width = std::max(width, shownLength(visit.title));
  std::string text = fmt::format("{}: {} after {:.1f} s\n", story.title.empty() ? story.session : story.title,
                                 outcomeOf(story), story.duration);
  if (!story.run.reason.empty()) text += fmt::format("{}\n", story.run.reason);
  if (!story.problem.empty()) text += fmt::format("warning: {}\n", story.problem);

  text += fmt::format("\n    {}  {:>7} {:>8} {:>8} {:>9} {:>8} {:>8} {:>7}\n", padded("step", width), "time",
                      "peak", "mean", "contact", "gap", "depth", "load");
  text += fmt::format("    {}  {:>7} {:>8} {:>8} {:>9} {:>8} {:>8} {:>7}\n", padded("", width), "[s]", "[N]",
                      "[N]", "[s]", "[mm]", "[mm]", "[%]");
  for (std::size_t i = 0; i < story.visits.size(); ++i) {
    const StepVisit& visit = story.visits[i];
    text += fmt::format("{:3} {}  {:7.1f} {}  {}\n", i + 1, padded(visit.title, width),
                        visit.end - visit.begin, row(visit.figures), phaseName(visit.phase));
  }
  text += fmt::format("    {}  {:7.1f} {}\n\n", padded("session", width), story.duration, row(story.whole));

  text += fmt::format("computation time  median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms\n",
                      1e3 * story.compute_median, 1e3 * story.compute_p99, 1e3 * story.compute_worst);
  text += fmt::format("late ticks        {}\n", story.late_ticks);
  text += fmt::format("oldest input      {:.1f} ms\n", 1e3 * story.input_age);
  for (const ForceAge& age : story.force_ages)
    text += fmt::format("input to force    median {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms ({})\n",
                        1e3 * age.p50, 1e3 * age.p99, 1e3 * age.max, age.who);
  for (const std::string& aid : story.aids) text += fmt::format("aid               {}\n", aid);
  text += "gap: device to proxy; depth: deepest point in a part's field; mean: while touching\n";
  return text;
}

nlohmann::json summaryJson(const SessionStory& story) {
  nlohmann::json all = {
      {"title", story.title},
      {"session", story.session},
      {"recording", story.file},
      {"problem", story.problem},
      {"began_ns", story.began_ns},
      {"lockstep", story.lockstep},
      {"succeeded", story.succeeded()},
      {"outcome", outcomeOf(story)},
      {"reason", story.run.reason},
      {"final_hash", fmt::format("{:016x}", story.run.final_hash)},
      {"seconds", story.duration},
      {"whole", jsonOf(story.whole)},
      {"compute_seconds",
       {{"median", story.compute_median}, {"p99", story.compute_p99}, {"max", story.compute_worst}}},
      {"late_ticks", story.late_ticks},
      {"oldest_input_seconds", story.input_age},
      {"messages", story.messages},
      {"malformed_messages", story.malformed},
      {"aids", story.aids},
      {"people", nlohmann::json::array()},
      {"steps", nlohmann::json::array()},
      {"input_to_force_seconds", nlohmann::json::array()},
      {"events", nlohmann::json::array()}};
  for (const Person& person : story.people)
    all["people"].push_back({{"name", person.name}, {"role", roleName(person.role)}});
  for (const StepVisit& visit : story.visits) {
    nlohmann::json step = jsonOf(visit.figures);
    step["step"] = visit.step;
    step["name"] = visit.name;
    step["title"] = visit.title;
    step["part"] = visit.part;
    step["phase"] = phaseName(visit.phase);
    step["begin"] = visit.begin;
    step["seconds"] = visit.end - visit.begin;
    all["steps"].push_back(std::move(step));
  }
  for (const ForceAge& age : story.force_ages)
    all["input_to_force_seconds"].push_back(
        {{"who", age.who}, {"median", age.p50}, {"p99", age.p99}, {"max", age.max}});
  for (const SessionEvent& event : story.events)
    all["events"].push_back({{"time", event.time}, {"kind", event.kind}, {"text", event.text}});
  return all;
}

}  // namespace tenon
