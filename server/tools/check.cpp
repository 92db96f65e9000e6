#include "server/check/check.h"

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "devices/catalog.h"
#include "idl/types/cache_folder.h"
#include "idl/types/number_range.h"
#include "server/session/loading_display.h"
#include "server/session/scene_loader.h"

namespace tenon::tools {
namespace {

using check::Finding;
using game_control::ScenarioFile;
using OrderedJson = nlohmann::ordered_json;

constexpr int kFound = 1;
constexpr int kWrongUsage = 2;

struct CheckArguments {
  std::string scenario;
  check::CheckOptions check;
  session::LoadOptions load{.cache = defaultCache()};
  bool json = false;
  bool quiet = false;
};

/// A scenario as far as it could be read, and what was found.
struct CheckReport {
  std::shared_ptr<const ScenarioFile> scenario;
  std::vector<Finding> findings;
};

CheckReport checkScenario(const CheckArguments& arguments, const check::CheckOptions& options) {
  auto file = game_control::readScenario(arguments.scenario);
  if (!file) return {std::make_shared<ScenarioFile>(), {{.text = file.error().what}}};
  const auto scenario = std::make_shared<const ScenarioFile>(std::move(*file));
  const auto progress =
      arguments.quiet ? session::LoadProgress() : session::LoadProgress(session::showOnTerminal);
  const auto loaded = session::loadStructures(scenario, arguments.load, progress);
  if (!loaded)
    return {scenario,
            check::findingsOf(loaded.error(), *scenario, session::meshBoxes(*scenario, arguments.load))};
  const auto scene = game_control::makeScene(*scenario, loaded->structures);
  if (!scene) return {scenario, check::findingsOf(scene.error(), *scenario, loaded->structures)};
  CheckReport report{scenario, check::checkScene(*scenario, **scene, options)};
  for (std::string& sentence : session::thinWallReport(**scene))
    report.findings.push_back(
        {.kind = check::FindingKind::kOpen, .severity = Severity::kInfo, .text = std::move(sentence)});
  return report;
}

OrderedJson nameOrNull(const ScenarioFile& scenario, ObjectId object) {
  return object.valid() ? OrderedJson(scenario.objects[object.value].name) : OrderedJson();
}

OrderedJson jsonOf(const ScenarioFile& scenario, const Finding& finding) {
  OrderedJson json;
  json["kind"] = check::nameOf(finding.kind);
  json["severity"] = check::nameOf(finding.severity);
  json["object"] = nameOrNull(scenario, finding.object);
  json["other"] = nameOrNull(scenario, finding.other);
  json["state"] = finding.state.empty() ? OrderedJson() : OrderedJson(finding.state);
  json["line"] = finding.line > 0 ? OrderedJson(finding.line) : OrderedJson();
  json["place"] =
      finding.p_WP ? OrderedJson{finding.p_WP->x(), finding.p_WP->y(), finding.p_WP->z()} : OrderedJson();
  json["value"] = finding.kind == check::FindingKind::kLoad ? OrderedJson() : OrderedJson(finding.value);
  json["error"] = finding.error > 0.0 ? OrderedJson(finding.error) : OrderedJson();
  json["unit"] = finding.unit;
  json["text"] = finding.text;
  json["hint"] = finding.hint;
  return json;
}

void printJson(const CheckArguments& arguments, const CheckReport& report) {
  OrderedJson json;
  json["scenario"] = report.scenario->path.empty() ? arguments.scenario : report.scenario->path.string();
  for (const Severity severity : {Severity::kError, Severity::kWarning, Severity::kInfo})
    json[std::string(check::nameOf(severity)) + "s"] = check::countOf(report.findings, severity);
  json["findings"] = OrderedJson::array();
  for (const Finding& finding : report.findings)
    json["findings"].push_back(jsonOf(*report.scenario, finding));
  fmt::print("{}\n", json.dump(2, ' ', false, OrderedJson::error_handler_t::replace));
}

std::string inColour(Severity severity, const std::string& text) {
  static const bool is_terminal = isatty(STDOUT_FILENO) != 0;
  if (!is_terminal) return text;
  const int colour = severity == Severity::kError ? 31 : severity == Severity::kWarning ? 33 : 36;
  return fmt::format("\033[{}m{}\033[0m", colour, text);
}

void printTable(const CheckArguments& arguments, const CheckReport& report) {
  for (const Finding& finding : report.findings) {
    if (arguments.quiet && finding.severity == Severity::kInfo) continue;
    const std::string line = finding.line > 0 ? fmt::format("line {}", finding.line) : "";
    fmt::print("{}  {:<9}  {:<9}  {}\n",
               inColour(finding.severity, fmt::format("{:<7}", check::nameOf(finding.severity))),
               check::nameOf(finding.kind), line, finding.text);
    if (!finding.hint.empty()) fmt::print("{:<31}{}\n", "", finding.hint);
  }
  const auto number = [&](Severity severity) {
    const std::size_t count = check::countOf(report.findings, severity);
    return fmt::format("{} {}{}", count, check::nameOf(severity), count == 1 ? "" : "s");
  };
  fmt::print("{}, {}, {}\n", number(Severity::kError), number(Severity::kWarning), number(Severity::kInfo));
}

int run(const CheckArguments& arguments) {
  check::CheckOptions options = arguments.check;
  if (!arguments.quiet) options.progress = session::showOnTerminal;
  const CheckReport report = checkScenario(arguments, options);
  arguments.json ? printJson(arguments, report) : printTable(arguments, report);
  const std::size_t notes = check::countOf(report.findings, Severity::kInfo);
  return report.findings.size() > notes ? kFound : 0;
}

int main(int argc, char** argv) {
  CheckArguments arguments;
  CLI::App app{
      "Looks for what is wrong with a scenario, without a session: overlaps at the start and at targets, "
      "the\n"
      "play of parts at their targets beside the stated clearance, sizes that cannot be, approaches that "
      "are\n"
      "blocked, objects out of reach, turns that a device does not have. What is not baked yet is baked.",
      "tenon check"};
  const auto known = [](const std::string& name) {
    const auto found = devices::findDevice(name);
    return found ? std::string() : found.error().what;
  };
  app.set_help_flag("-h,--help", "print this help");
  app.add_option("scenario", arguments.scenario, "a scenario's folder or YAML file")->required();
  app.add_flag("--json", arguments.json, "one JSON object: lengths in metres, angles in radians");
  app.add_option("--device", arguments.check.trainee_device,
                 "of the trainee's hands, for its range of turning")
      ->check(known)
      ->capture_default_str();
  app.add_option("--instructor-device", arguments.check.instructor_device,
                 "of the instructor's hand, likewise")
      ->check(known)
      ->capture_default_str();
  app.add_option("--detail", arguments.load.detail,
                 "mesh resolution of generated parts, 0 to 1; 1: that of the paper")
      ->check(numberFrom(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--cache", arguments.load.cache, "folder for generated parts and haptic structures");
  app.add_flag("-q,--quiet", arguments.quiet, "errors and warnings only, no progress");
  app.footer("Exit code: 0 nothing wrong (there may be notes), 1 errors or warnings, 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongUsage;
  }
  return run(arguments);
}

}  // namespace
}  // namespace tenon::tools

int main(int argc, char** argv) { return tenon::tools::main(argc, argv); }
