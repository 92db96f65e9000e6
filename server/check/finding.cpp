#include "server/check/finding.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace tenon::check {

std::string_view nameOf(FindingKind kind) {
  constexpr std::array<std::string_view, 9> kNames{"load",  "overlap", "clearance", "scale", "approach",
                                                   "reach", "turning", "open",      "filled"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view nameOf(Severity severity) {
  return severity == Severity::kError ? "error" : severity == Severity::kWarning ? "warning" : "note";
}

std::size_t countOf(const std::vector<Finding>& findings, Severity severity) {
  return static_cast<std::size_t>(
      std::count_if(findings.begin(), findings.end(),
                    [severity](const Finding& finding) { return finding.severity == severity; }));
}

std::string lineOf(const game_control::ScenarioFile& scenario, const Finding& finding) {
  const std::string at =
      finding.line > 0 ? fmt::format("{}:{}", scenario.path.string(), finding.line) : scenario.path.string();
  const std::string hint = finding.hint.empty() ? "" : fmt::format(" ({})", finding.hint);
  return fmt::format("{}: {}: {}{}", at, nameOf(finding.severity), finding.text, hint);
}

}  // namespace tenon::check
