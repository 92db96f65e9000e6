#include "clients/report/summary.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "idl/types/messages/timing.h"
#include "idl/types/names.h"

namespace tenon::report {
namespace {

/// Number of columns in a terminal: continuation bytes of UTF-8 are not counted.
std::size_t columnsOf(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char byte) { return (byte & 0xC0) != 0x80; }));
}

std::string padded(std::string text, std::size_t width) {
  for (std::size_t length = columnsOf(text); length < width; ++length) text += ' ';
  return text;
}

/// `value` [unit of the table]; blank where it is not known.
std::string cell(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "";
}

std::string row(const SessionMetrics& metrics, const std::string& error, double path,
                const std::optional<int>& collisions) {
  return fmt::format("{:>12} {:>7} {:>10} {:>8} {:>8} {:>9}", error, cell(path, 2),
                     collisions ? std::to_string(*collisions) : "", cell(metrics.peak_force, 1),
                     cell(metrics.mean_force, 1), cell(metrics.contact_seconds, 1));
}

nlohmann::json jsonOf(const std::optional<int>& count) { return count ? nlohmann::json(*count) : nullptr; }

nlohmann::json jsonOf(const SessionMetrics& metrics) {
  return {{"peak_force", metrics.peak_force},
          {"mean_force", metrics.mean_force},
          {"contact_seconds", metrics.contact_seconds},
          {"device_proxy_gap", metrics.gap},
          {"field_depth", metrics.depth},
          {"load_percent", metrics.load}};
}

}  // namespace

std::string errorText(const StepVisit& visit) {
  if (!visit.has_target || !std::isfinite(visit.error.position)) return "";
  return fmt::format("{:.2f} of {:.1f}", 1e3 * visit.error.position, 1e3 * visit.tolerance.position);
}

std::string titleText(const StepVisit& visit) {
  return visit.attempt > 1 ? fmt::format("{} (attempt {})", visit.title, visit.attempt) : visit.title;
}

std::string_view resultOf(const StepVisit& visit) {
  if (!visit.is_end_known) return "not known";
  switch (visit.phase) {
    case StepPhase::kWaiting:
      return "abandoned";
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

std::string outcomeOf(const SessionAnalysis& analysis) {
  if (analysis.succeeded()) return "succeeded";
  if (!analysis.has_run) return "unknown: the recording holds no outcome";
  switch (analysis.run.phase) {
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

std::string linkText(const ForceLatency& latency) {
  const std::string text = fmt::format(
      "jitter up to {:.1f} ms; lost: {:.2f} % of inputs, {:.2f} % of contacts; replaced by newer ones: "
      "{:.2f} % of inputs, "
      "{:.2f} % of contacts; {:.2f} % of ticks without an input; hands held still after {} ms of silence at "
      "most",
      1e3 * latency.jitter, 1e2 * latency.inputs_lost, 1e2 * latency.answers_lost,
      1e2 * latency.inputs_replaced, 1e2 * latency.answers_replaced, 1e2 * latency.ticks_without_input,
      latency.freeze_ticks);
  const std::string far =
      latency.guidance_alone > 0.0
          ? fmt::format("; contacts were not felt for {:.0f} % of the time (more than {:.0f} ms one way)",
                        1e2 * latency.guidance_alone, 1e3 * kLongestContactDelay)
          : "";
  const std::string clock =
      latency.clock_known
          ? fmt::format("; round trip {:.1f} ms; the server's clock is {:.6f} s ahead, +-{:.1f} ms",
                        1e3 * latency.round_trip, latency.clock_offset, 1e3 * latency.clock_error)
          : "";
  return fmt::format("{}{}{} ({})", text, far, clock, latency.who);
}

std::string summaryText(const SessionAnalysis& analysis) {
  std::size_t width = 10;
  for (const StepVisit& visit : analysis.visits) width = std::max(width, columnsOf(titleText(visit)));
  std::string text =
      fmt::format("{}: {} after {:.1f} s\n", analysis.title.empty() ? analysis.session : analysis.title,
                  outcomeOf(analysis), analysis.duration);
  if (!analysis.run.reason.empty()) text += fmt::format("{}\n", analysis.run.reason);
  if (!analysis.problem.empty()) text += fmt::format("warning: {}\n", analysis.problem);

  text += fmt::format("\n    {}  {:>7} {:>12} {:>7} {:>10} {:>8} {:>8} {:>9}\n", padded("step", width),
                      "time", "error", "path", "collisions", "peak", "mean", "contact");
  text += fmt::format("    {}  {:>7} {:>12} {:>7} {:>10} {:>8} {:>8} {:>9}\n", padded("", width), "[s]",
                      "[mm]", "[m]", "", "[N]", "[N]", "[s]");
  for (std::size_t i = 0; i < analysis.visits.size(); ++i) {
    const StepVisit& visit = analysis.visits[i];
    text += fmt::format("{:3} {}  {:7.1f} {}  {}\n", i + 1, padded(titleText(visit), width), visit.seconds,
                        row(visit.metrics, errorText(visit), visit.path, visit.collisions), resultOf(visit));
  }
  text += fmt::format("    {}  {:7.1f} {}\n", padded("session", width), analysis.duration,
                      row(analysis.whole, "", analysis.path, analysis.collisions));
  text +=
      "time: of a step without pauses and emergency stops; error: last distance from the target, of what is "
      "allowed; path: how far the part was moved; peak and "
      "mean "
      "(in contact): force on the hand\n\n";

  text +=
      fmt::format("computation time  median {:.3f} ms, p99 {:.3f} ms, max {:.3f} ms\n",
                  1e3 * analysis.compute_median, 1e3 * analysis.compute_p99, 1e3 * analysis.compute_worst);
  text += fmt::format("late ticks        {}\n", analysis.late_ticks);
  text += fmt::format("writes to the bus {} took more than 5 ms, {} samples not sent\n", analysis.slow_writes,
                      analysis.unsent_samples);
  text += fmt::format("oldest input      {:.1f} ms\n", 1e3 * analysis.input_age);
  for (const ForceLatency& latency : analysis.force_latencies)
    text += fmt::format(
        "input to force    median {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms, longest silence "
        "{:.1f} ms ({})\n",
        1e3 * latency.p50, 1e3 * latency.p99, 1e3 * latency.max, 1e3 * latency.silence, latency.who);
  for (const ForceLatency& latency : analysis.force_latencies)
    text += fmt::format("link              {}\n", linkText(latency));
  const auto known = [](double value, int digits) {
    return std::isfinite(value) ? cell(value, digits) : std::string("(not known)");
  };
  text += fmt::format("hand to part      at most {} mm; parts inside each other: at most {} mm\n",
                      known(1e3 * analysis.whole.gap, 2), known(1e3 * analysis.whole.depth, 2));
  text += fmt::format("work of a pair    at most {} % of its limit\n", known(analysis.whole.load, 0));
  for (const std::string& aid : analysis.aids) text += fmt::format("aid               {}\n", aid);
  return text;
}

nlohmann::json summaryJson(const SessionAnalysis& analysis) {
  nlohmann::json all = {
      {"title", analysis.title},
      {"session", analysis.session},
      {"recording", analysis.file},
      {"problem", analysis.problem},
      {"began_ns", analysis.began_ns},
      {"lockstep", analysis.lockstep},
      {"succeeded", analysis.succeeded()},
      {"outcome", outcomeOf(analysis)},
      {"reason", analysis.run.reason},
      {"final_hash", fmt::format("{:016x}", analysis.run.final_hash)},
      {"seconds", analysis.duration},
      {"steps_skipped", analysis.run.steps_skipped},
      {"steps_timed_out", analysis.run.steps_timed_out},
      {"path", analysis.path},
      {"collisions", jsonOf(analysis.collisions)},
      {"whole", jsonOf(analysis.whole)},
      {"compute_seconds",
       {{"median", analysis.compute_median}, {"p99", analysis.compute_p99}, {"max", analysis.compute_worst}}},
      {"late_ticks", analysis.late_ticks},
      {"slow_writes", analysis.slow_writes},
      {"unsent_samples", analysis.unsent_samples},
      {"oldest_input_seconds", analysis.input_age},
      {"messages", analysis.messages},
      {"malformed_messages", analysis.malformed},
      {"aids", analysis.aids},
      {"people", nlohmann::json::array()},
      {"missing_samples", nlohmann::json::object()},
      {"steps", nlohmann::json::array()},
      {"input_to_force_seconds", nlohmann::json::array()},
      {"events", nlohmann::json::array()}};
  for (const auto& [topic, count] : analysis.missing)
    all["missing_samples"][topic] = {{"missing", count.missing()}, {"published", count.published}};
  for (const SessionParticipant& participant : analysis.participants)
    all["people"].push_back({{"name", participant.name}, {"role", roleName(participant.role)}});
  for (const StepVisit& visit : analysis.visits) {
    nlohmann::json step = jsonOf(visit.metrics);
    step["step"] = visit.step;
    step["name"] = visit.name;
    step["title"] = visit.title;
    step["part"] = visit.part;
    step["attempt"] = visit.attempt;
    step["path"] = visit.path;
    step["collisions"] = jsonOf(visit.collisions);
    if (visit.has_target) {
      step["position_error"] = visit.error.position;
      step["position_tolerance"] = visit.tolerance.position;
      step["angle_error"] = visit.error.angle;
      step["angle_tolerance"] = visit.tolerance.angle;
    }
    step["phase"] = resultOf(visit);
    step["begin"] = visit.begin;
    step["end"] = visit.end;
    step["seconds"] = visit.seconds;
    all["steps"].push_back(std::move(step));
  }
  for (const ForceLatency& latency : analysis.force_latencies)
    all["input_to_force_seconds"].push_back(
        {{"who", latency.who},
         {"median", latency.p50},
         {"p99", latency.p99},
         {"max", latency.max},
         {"longest_silence", latency.silence},
         {"jitter", latency.jitter},
         {"inputs_lost", latency.inputs_lost},
         {"answers_lost", latency.answers_lost},
         {"inputs_replaced", latency.inputs_replaced},
         {"answers_replaced", latency.answers_replaced},
         {"guidance_alone", latency.guidance_alone},
         {"ticks_without_input", latency.ticks_without_input},
         {"freeze_ms", latency.freeze_ticks},
         {"round_trip", latency.clock_known ? nlohmann::json(latency.round_trip) : nlohmann::json()},
         {"clock_offset", latency.clock_known ? nlohmann::json(latency.clock_offset) : nlohmann::json()},
         {"clock_error", latency.clock_known ? nlohmann::json(latency.clock_error) : nlohmann::json()}});
  for (const SessionEvent& event : analysis.events)
    all["events"].push_back({{"time", event.time}, {"kind", event.kind}, {"text", event.text}});
  return all;
}

}  // namespace tenon::report
