#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "idl/record/mcap_reader.h"
#include "idl/threads/line_printer.h"
#include "idl/types/cache_folder.h"
#include "idl/types/number_range.h"
#include "idl/types/output_files.h"
#include "idl/types/result.h"
#include "idl/wire/identity.h"
#include "idl/wire/key_option.h"
#include "idl/wire/network.h"
#include "idl/wire/session_name.h"
#include "server/check/check.h"
#include "server/session/journal.h"
#include "server/session/loading_display.h"
#include "server/session/renamed_options.h"
#include "server/session/scenario_copy.h"
#include "server/session/session_server.h"
#include "server/session/start_condition.h"
#include "server/session/stop_file.h"

namespace {

std::atomic<bool> stop_requested = false;

std::atomic<std::uint32_t> stop_signals = 0;

void onStopSignal(int) {
  ++stop_signals;
  stop_requested = true;
}

constexpr int kWrongUsage = 2;
constexpr const char* kStopped = "stopped while the scene was prepared";

struct ServeArguments {
  std::string scenario;
  tenon::session::SessionOptions session;
  tenon::session::LoadOptions load{.cache = tenon::defaultCache()};
  std::filesystem::path key_file;
  std::string resume;          ///< journal of a killed server; empty: begin a session
  std::string resimulate;      ///< journal or recording; empty: open a session
  bool states_detail = false;  ///< --detail is given
  bool despite_changes = false;
  bool overwrite = false;
  bool allow_skips = false;
};

void declareOptions(CLI::App& app, ServeArguments& arguments) {
  app.set_help_flag("-h,--help", "what this program does and how to call it");
  app.add_option("scenario", arguments.scenario,
                 "a scenario's folder or YAML file, as in scenarios/engine_bay");
  tenon::wire::addSessionOption(app, arguments.session.name, "name by which clients find it")
      ->capture_default_str();
  app.add_option("--domain", arguments.session.domain, "DDS domain, 0 to 230")->check(CLI::Range(0, 230));
  tenon::wire::addNetworkOption(app);
  app.add_flag("--open", arguments.session.open,
               "on a network beyond loopback: trainees, observers and recorders need no key");
  app.add_option("--detail", arguments.load.detail,
                 "mesh resolution of generated parts, 0 to 1; 1: that of the paper")
      ->check(tenon::numberFrom(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--cache", arguments.load.cache, "folder for generated parts and haptic structures");
  app.add_option("--wait-for", arguments.session.wait_for,
                 "hands and roles that must be present before the first tick (default: the trainee's hands)")
      ->delimiter(',');
  app.add_option("--workers", arguments.session.simulation.environment.workers,
                 "threads that compute contacts; the result does not depend on their number")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option(
         "--budget", arguments.session.simulation.environment.work.points,
         "initial work budget: pointshell points tested per tick at most; the finest levels that do not fit "
         "are skipped; 0: no limit")
      ->check(CLI::Range(0, 1'000'000'000))
      ->capture_default_str();
  app.add_option("--critical-load", arguments.session.simulation.environment.work.critical_load,
                 "load of a collision pair, in percent, above which it skips a level while there is a budget")
      ->check(tenon::numberFrom(1.0, 1000.0))
      ->capture_default_str();
  app.add_option_function<double>(
         "--tick-goal", [&arguments](double ms) { arguments.session.tick_goal = 1e-3 * ms; },
         "milliseconds that a tick should take at most in real time: the governor lowers the budget when "
         "ticks "
         "are slower and raises it again when they are not; 0: off")
      ->check(tenon::numberFrom(0.0, 1.0))
      ->default_str("0.7");
  app.add_option("--journal", arguments.session.journal,
                 "record the inputs of each tick, and a checkpoint a second, in this file")
      ->check(tenon::wire::namesNoFile);
  CLI::Option* const journal = app.get_option("--journal");
  app.add_option(
         "--resume", arguments.resume,
         "take up the session of a killed server where its journal ends, and continue that file: same step, "
         "same seats, what hands held is parked until they are back; --detail is that of the journal")
      ->excludes(journal)
      ->check(tenon::wire::namesNoFile);
  app.add_flag("--overwrite", arguments.overwrite, tenon::kOverwriteHelp);
  app.add_flag("--allow-skips", arguments.allow_skips, "exit 0 although steps were skipped");
  tenon::wire::addKeyOption(
      app, arguments.key_file,
      "file of the key that admins and instructors need; made when it does not exist (default: one "
      "in your runtime folder, which your own programs find)");
  app.add_flag("--lockstep", arguments.session.lockstep,
               "a tick waits for the inputs of all hands instead of the clock: repeatable to the last bit");
  app.add_option(
         "--resimulate", arguments.resimulate,
         "simulate a journal or recording again and compare the state hash after every tick; opens no "
         "session")
      ->check(tenon::wire::namesNoFile)
      ->excludes("--resume");
  app.add_flag("--despite-changes", arguments.despite_changes,
               "re-simulate although scenario or structures have changed since the recording, to see where "
               "it differs");
  app.footer(
      "Exit code: 0 when every step was done (or all hashes of the re-simulation were equal, no tick is "
      "missing and the file records how the run ended), 1 otherwise; 2 for wrong usage.");
}

void printLine(const std::string& text) {
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

const char* verb = "serve";  ///< of this run: or resimulate

int reportError(const std::string& what, int exit_code = 1) {
  std::fprintf(stderr, "tenon %s: %s\n", verb, what.c_str());
  return exit_code;
}

/// Says once that something has to be baked, and shows the progress on one line of a terminal.
void showLoading(std::string_view activity, double fraction) {
  static bool is_said = false;
  if (!is_said) printLine("preparing the scene: what is not baked yet is baked, which can take a minute");
  is_said = true;
  tenon::session::showOnTerminal(activity, fraction);
}

/// Says what is wrong with the scenario, as `tenon check` does for the devices that stations open by default.
void printProblems(const tenon::session::LoadedScene& loaded) {
  for (const std::string& line : tenon::check::problems(*loaded.scenario, *loaded.scene)) printLine(line);
}

/// Reports what has changed since the recording; true when that forbids the re-simulation.
bool isRefusedForChanges(const ServeArguments& arguments, const tenon::session::Fingerprint& then,
                         const tenon::session::LoadedScene& loaded) {
  const auto changes = tenon::session::changesSince(then, loaded);
  if (changes.empty()) return false;
  reportError(fmt::format("the scenario has changed since {} was recorded: {}", arguments.resimulate,
                          fmt::join(changes, ", ")));
  if (!arguments.despite_changes) reportError("not re-simulated; --despite-changes does it nevertheless");
  return !arguments.despite_changes;
}

std::string describe(const tenon::session::JournalGap& gap) {
  if (gap.first == 1)
    return fmt::format("ticks 1 to {} are not compared: no checkpoint before them can be read", gap.last);
  const std::string missing = fmt::format("ticks {} to {} are missing", gap.first, gap.last);
  if (gap.is_at_end) return missing + ": the run went on, the inputs end";
  return gap.compared_after == 0
             ? missing + ", and no checkpoint follows them: the rest is not compared"
             : fmt::format("{}: compared again after the checkpoint of tick {}", missing, gap.compared_after);
}

/// How much was compared, and what was not: all of it counted, the begin of it named.
void printGaps(const tenon::session::ResimulationReport& report) {
  constexpr std::size_t kMostNamed = 10;
  const std::size_t gaps = report.gaps.size();
  printLine(fmt::format("ticks {} to {}: {} compared, {} gap{}{}", report.first, report.last, report.compared,
                        gaps, gaps == 1 ? "" : "s",
                        gaps == 0 ? "" : fmt::format(" of {} ticks in all", report.gapTicks())));
  for (std::size_t i = 0; i < std::min(gaps, kMostNamed); ++i) printLine(describe(report.gaps[i]));
  if (gaps > kMostNamed) printLine(fmt::format("and {} more gaps", gaps - kMostNamed));
}

/// What is known of a run whose end its file lacks.
std::string describeMissingEnd(const std::string& file, const tenon::session::ResimulationReport& report) {
  return fmt::format(
      "{} reaches tick {} and does not record how the run ended: the program that wrote it was killed, still "
      "runs, or could not write any more, as to a disk that hung; what came after that tick is not known{}",
      file, report.reached,
      report.is_journal ? fmt::format(" (`tenon serve --resume {}` continues the session there)", file) : "");
}

int resimulateFile(const ServeArguments& arguments, const tenon::session::LoadedScene& loaded) {
  const auto fingerprint = tenon::session::readFingerprint(arguments.resimulate);
  if (!fingerprint) return reportError(fingerprint.error().what);
  if (isRefusedForChanges(arguments, *fingerprint, loaded)) return 1;
  tenon::session::SessionSimulation simulation(loaded.scenario, loaded.scene, arguments.session.simulation);
  const auto report = tenon::session::resimulate(arguments.resimulate, simulation);
  if (!report) return reportError(report.error().what);
  printGaps(*report);
  if (!report->problem.empty()) printLine(report->problem);
  if (report->has_no_end) printLine(describeMissingEnd(arguments.resimulate, *report));
  if (report->first_difference) {
    printLine(fmt::format("first difference: tick {}", *report->first_difference));
    return 1;
  }
  printLine(fmt::format("final state hash: {:016x}", report->final_hash));
  return report->gaps.empty() && !report->is_damaged && !report->has_no_end ? 0 : 1;
}

/// Checks before anything is baked what the scenario's text suffices for; the exit code, 0 for none.
int checkArguments(const ServeArguments& arguments) {
  const auto scenario = tenon::game_control::readScenario(arguments.scenario);
  if (!scenario) return reportError(scenario.error().what);
  if (const auto known = tenon::session::StartCondition::make(*scenario, arguments.session.wait_for); !known)
    return reportError("--wait-for: " + known.error().what, kWrongUsage);
  if (!arguments.resume.empty()) return 0;  // its journal is continued
  tenon::ProgramFiles files{{arguments.session.journal}, {scenario->path}, arguments.overwrite};
  for (const tenon::game_control::ScenarioObject& object : scenario->objects)
    for (const tenon::game_control::MeshSource& mesh : object.meshes) files.inputs.push_back(mesh.file);
  const auto refusal = tenon::refuseOutputs(files);
  return refusal ? reportError(refusal->what, refusal->exit_code) : 0;
}

using Copy = std::optional<tenon::session::UnpackedScenario>;

/// Takes from the journal or recording `file` what the command line does not say: limits, level of detail,
/// and the scenario, whose files `copy` holds where the file has them. The exit code, 0 for none.
int readOrigin(const std::string& file, ServeArguments& arguments, Copy& copy) {
  const bool resumes = !arguments.resume.empty();
  if (std::error_code error;
      std::filesystem::exists(file, error) && !std::filesystem::is_regular_file(file, error))
    return reportError(file + ": is no file");
  const auto origin = tenon::session::readJournalOrigin(file);
  if (!origin && resumes)
    return reportError(origin.error().what + "; begin a new session with --journal and another file");
  if (!origin)
    if (const auto recording = tenon::record::McapReader::open(file); !recording)
      return reportError(recording.error().what);
  if (!origin && arguments.scenario.empty())
    return reportError(origin.error().what + "; name it as well, as in: tenon resimulate " + file +
                       " scenarios/engine_bay");
  if (!origin) return 0;
  arguments.session.simulation.limits = origin->limits;
  if (resumes || !arguments.states_detail) arguments.load.detail = origin->detail;
  if (!arguments.scenario.empty()) return 0;
  std::string missing;  ///< why the file's own copy of its scenario cannot be used
  if (!resumes) {
    auto unpacked = tenon::session::UnpackedScenario::of(file);
    if (unpacked) arguments.scenario = copy.emplace(std::move(*unpacked)).path().string();
    if (unpacked) return 0;
    missing = unpacked.error().what + "; ";
  }
  const auto scenario = tenon::session::findScenario(file, *origin);
  if (!scenario) return reportError(missing + scenario.error().what);
  arguments.scenario = scenario->string();
  return 0;
}

/// Of the session, from --key or the user's runtime folder, where the first server makes it.
tenon::Result<tenon::wire::SharedKey> readKey(const std::filesystem::path& key_file) {
  if (!key_file.empty()) {
    auto key = tenon::wire::readOrMakeKeyFile(key_file);
    if (!key) return tenon::fail("--key: " + key.error().what);
    return key;
  }
  const auto runtime = tenon::wire::runtimeFolder();
  if (!runtime) return tenon::fail(runtime.error().what + "; or name a file with --key");
  return tenon::wire::readOrMakeKeyFile(*runtime / "key");
}

using Say = std::function<void(const std::string&)>;

/// For people, how the session went.
void describeSession(const tenon::session::SessionReport& report, const Say& say) {
  say(fmt::format("{} after {:.1f} s; late ticks: {}; refused inputs: {}", report.run.reason,
                  static_cast<double>(report.run.tick) * tenon::kTickSeconds, report.late_ticks,
                  report.refused_inputs));
  if (report.slow_writes > 0 || report.failed_writes > 0)
    say(fmt::format("writes to the bus that took longer than 5 ms: {}, the longest {:.1f} ms; failed: {}",
                    report.slow_writes, 1e3 * report.longest_write, report.failed_writes));
  if (report.dropped_outputs > 0)
    say(fmt::format("ticks that were not published: {}", report.dropped_outputs));
  if (report.lost_journal_ticks > 0)
    say(fmt::format("{} tick{} missing in the journal", report.lost_journal_ticks,
                    report.lost_journal_ticks == 1 ? " is" : "s are"));
  if (!report.journal_problem.empty())
    say(fmt::format("the journal ended before the session: {}", report.journal_problem));
  say(fmt::format("final state hash: {:016x}", report.run.final_hash));
}

/// Opens the session and runs it to its end.
int serve(ServeArguments& arguments, const tenon::session::LoadedScene& loaded) {
  printProblems(loaded);
  for (const std::string& sentence : tenon::session::thinWallReport(*loaded.scene)) printLine(sentence);
  tenon::session::SessionOptions& session = arguments.session;
  const auto key = readKey(arguments.key_file);
  if (!key) return reportError(key.error().what);
  session.key = *key;
  session.stop_file = tenon::session::defaultStopFile(session.domain, session.name);
  if (session.stop_file.empty()) reportError(tenon::session::kNoStopFile);
  // a terminal that stands still does not stop the session
  std::optional<tenon::threads::LinePrinter> printer(tenon::threads::LinePrinter::kOutput);
  const Say say = [&printer](const std::string& text) { printer->print(text); };
  // a session without pictures is a session
  const auto models = tenon::session::storeAssets(loaded, arguments.load);
  if (stop_requested) return reportError(kStopped);
  if (models) session.scene_hash = *models;
  if (!models) say("the console will show boxes instead of parts: " + models.error().what);
  session.print = say;
  session.signals = &stop_signals;
  session.detail = arguments.load.detail;
  session.resume = !arguments.resume.empty();
  if (session.resume) session.journal = arguments.resume;
  auto server = tenon::session::SessionServer::open(loaded, session);
  if (!server) return reportError(server.error().what);
  const auto report = (*server)->run(stop_requested);
  if (!report) return reportError(report.error().what);
  if (report->replaced_by.empty())
    describeSession(*report, say);
  else
    reportError(report->replaced_by);
  if (report->left_journal) {
    printer.reset();  // prints what waits
    std::_Exit(1);    // destroys nothing: a thread waits for the disk
  }
  if (!report->replaced_by.empty()) return 1;
  return tenon::isCompleted(report->run, arguments.allow_skips) ? 0 : 1;
}

/// Loads the scene, for a session or a re-simulation.
int run(ServeArguments& arguments) {
  Copy copy;  // of a journal's scenario, for as long as it is read
  const bool resimulates = !arguments.resimulate.empty();
  if (const std::string& file = resimulates ? arguments.resimulate : arguments.resume; !file.empty())
    if (const int wrong = readOrigin(file, arguments, copy); wrong != 0) return wrong;
  if (arguments.scenario.empty())
    return reportError("name a scenario, as in: tenon serve scenarios/engine_bay", kWrongUsage);
  if (!resimulates)
    if (const int wrong = checkArguments(arguments); wrong != 0) return wrong;
  arguments.load.stop = &stop_requested;
  const auto loaded = tenon::session::loadScene(arguments.scenario, arguments.load, showLoading);
  if (stop_requested) return reportError(kStopped);
  if (!loaded) return reportError(loaded.error().what);
  return resimulates ? resimulateFile(arguments, *loaded) : serve(arguments, *loaded);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Runs a training session: simulates all objects and contacts and publishes the results over DDS.",
      "tenon serve");
  ServeArguments arguments;
  declareOptions(app, arguments);
  if (const auto answer = tenon::session::renamedOption({argv, static_cast<std::size_t>(argc)}))
    return reportError(*answer, kWrongUsage);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongUsage;
  }
  if (!arguments.resimulate.empty()) verb = "resimulate";
  arguments.states_detail = app.count("--detail") > 0;
  std::signal(SIGINT, onStopSignal);
  std::signal(SIGTERM, onStopSignal);
  // a limit on the size of files is an error of the write, as a full disk is
  std::signal(SIGXFSZ, SIG_IGN);
  return run(arguments);
}
