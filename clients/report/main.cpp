#include <cstdio>
#include <filesystem>
#include <fstream>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "clients/report/embedded_session.h"
#include "clients/report/page.h"
#include "clients/report/page_data.h"
#include "clients/report/session_analysis.h"
#include "clients/report/summary.h"
#include "idl/types/cache_folder.h"
#include "idl/types/output_files.h"

namespace {

int printError(const std::string& what) {
  std::fprintf(stderr, "tenon-report: %s\n", what.c_str());
  return 1;
}

bool save(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  return static_cast<bool>(out.flush());
}

/// Makes report.html; fails with a sentence when its page is not built or nothing can be written.
tenon::Result<void> saveReport(const tenon::report::SessionAnalysis& analysis,
                               const std::filesystem::path& recording, const std::filesystem::path& cache,
                               const std::filesystem::path& file) {
  const auto page = tenon::report::readReportPage(tenon::report::defaultReportPage());
  if (!page) return tenon::fail(page.error().what);
  nlohmann::json data = tenon::report::pageData(analysis);
  const auto session =
      tenon::report::embedSession(recording, cache, tenon::report::sessionBudget(*page, data));
  if (session)
    data["player"] = {{"rate", session->rate}, {"objects", session->objects}, {"models", session->models}};
  else
    data["no_player"] = session.error().what;
  if (!save(file, tenon::report::reportPage(*page, data, session ? &*session : nullptr)))
    return tenon::fail(file.string() + ": cannot be written");
  return {};
}

int run(int argc, char** argv) {
  CLI::App app{"tenon-report: makes a report of a recording: a table, report.html and summary.json"};
  std::filesystem::path recording, folder;
  std::filesystem::path cache = tenon::defaultCache();
  std::string language = "en";
  bool json = false;
  bool overwrite = false;
  bool allow_skips = false;
  app.add_option("recording", recording, "an MCAP file of tenon-record")->required();
  app.add_option("-o,--output", folder, "folder for report.html and summary.json; created if missing");
  app.add_flag("--json", json, "print the summary as JSON instead of a table");
  app.add_option("--language", language, "language of the steps' titles in table and summary")
      ->capture_default_str();
  app.add_option("--cache", cache, "folder in which the server keeps the models of parts")
      ->option_text("DIR");
  app.add_flag("--overwrite", overwrite, tenon::kOverwriteHelp);
  app.add_flag("--allow-skips", allow_skips, "exit 0 although steps were skipped");
  app.footer(
      "Exit code: 0 if the run succeeded and every step was done, 1 if not or if there is no report, 2 for "
      "wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  if (!folder.empty()) {
    const tenon::ProgramFiles files{
        {folder / "report.html", folder / "summary.json"}, {recording}, overwrite};
    if (const auto refusal = tenon::refuseOutputs(files)) {
      printError(refusal->what);
      return refusal->exit_code;
    }
  }
  const auto analysis = tenon::report::analyzeRecording(recording, language);
  if (!analysis) return printError(analysis.error().what);
  // texts in a recording may be invalid UTF-8
  const std::string summary =
      tenon::report::summaryJson(*analysis).dump(2, ' ', false, nlohmann::json::error_handler_t::replace) +
      "\n";
  std::fputs((json ? summary : tenon::report::summaryText(*analysis)).c_str(), stdout);
  if (!folder.empty()) {
    std::error_code problem;
    std::filesystem::create_directories(folder, problem);
    if (!save(folder / "summary.json", summary))
      return printError((folder / "summary.json").string() + ": cannot be written");
    if (const auto saved = saveReport(*analysis, recording, cache, folder / "report.html"); !saved)
      return printError(saved.error().what);
  }
  return analysis->succeeded(allow_skips) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    return printError(problem.what());
  }
}
