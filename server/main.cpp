#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include "server/session/journal.h"
#include "server/session/session_server.h"

namespace {

std::atomic<bool> stop_asked = false;

void askToStop(int) { stop_asked = true; }

struct Arguments {
  std::string scenario;
  tenon::SessionOptions session;
  tenon::LoadOptions load{.cache = tenon::defaultCache()};
  std::string rerun;
  bool anyway = false;
};

/// The command line, with every word a user may say.
void declare(CLI::App& app, Arguments& arguments) {
  app.set_help_flag("-h,--help", "what this program does and how to call it");
  app.add_option("scenario", arguments.scenario,
                 "a scenario's folder or YAML file, as in scenarios/engine_bay");
  app.add_option("--session", arguments.session.name, "name by which people join")->capture_default_str();
  app.add_option("--domain", arguments.session.domain, "DDS domain, 0 to 230")->check(CLI::Range(0, 230));
  app.add_option("--detail", arguments.load.detail, "of generated parts, 0 to 1; 1 is 1.8 million triangles")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--cache", arguments.load.cache, "folder for generated parts and haptic structures");
  app.add_option("--wait-for", arguments.session.wait_for,
                 "hands and roles that must be here before the first step (default: the trainee's hands)")
      ->delimiter(',');
  app.add_option("--workers", arguments.session.exercise.environment.workers,
                 "threads that compute contacts; never changes the result")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option(
         "--budget", arguments.session.exercise.environment.work.points,
         "points of shells tested in a tick at most, at the start; what does not fit is left out from "
         "the finest level on; 0: no limit")
      ->capture_default_str();
  app.add_option("--critical-load", arguments.session.exercise.environment.work.critical_load,
                 "load of a pair, in percent, from which on it leaves out a level while there is a budget")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  app.add_option_function<double>(
         "--tick-goal", [&arguments](double ms) { arguments.session.tick_goal = 1e-3 * ms; },
         "milliseconds that a tick by the clock should take at most: the budget is cut when ticks are slower "
         "and grows again when they are not; 0: never")
      ->check(CLI::Range(0.0, 1.0))
      ->default_str("0.7");
  app.add_option("--journal", arguments.session.journal,
                 "keep everything that each tick consumed in this file");
  app.add_flag("--lockstep", arguments.session.lockstep,
               "a tick waits for its inputs instead of the clock: repeatable to the last bit");
  app.add_option("--rerun", arguments.rerun,
                 "run a journal or recording again and compare the state after every tick; opens no session");
  app.add_flag("--anyway", arguments.anyway,
               "re-run although scenario or structures have changed since, to see where it differs");
  app.footer("Exit code: 0 when everything was mounted (or the re-run was equal), 1 otherwise.");
}

void sayOn(const std::string& text) {
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

int complain(const std::string& what) {
  std::fprintf(stderr, "tenon serve: %s\n", what.c_str());
  return 1;
}

/// One line that renews itself on a terminal; a line per object elsewhere.
void showLoading(std::string_view doing, double share) {
  static const bool is_terminal = isatty(STDERR_FILENO) != 0;
  if (is_terminal) std::fprintf(stderr, "\r\033[K%3.0f %%  %s", 100.0 * share, std::string(doing).c_str());
  if (is_terminal && share >= 1.0) std::fprintf(stderr, "\r\033[K");
}

/// Says what is not as it was; true when a re-run would compare two different things.
bool hasChanged(const Arguments& arguments, const tenon::Fingerprint& then,
                const tenon::LoadedScene& loaded) {
  const auto changes = tenon::changesSince(then, loaded);
  if (changes.empty()) return false;
  complain(fmt::format("the scenario has changed since {} was recorded: {}", arguments.rerun,
                       fmt::join(changes, ", ")));
  if (!arguments.anyway) complain("not run again; --anyway does it nevertheless");
  return !arguments.anyway;
}

int runAgain(const Arguments& arguments, const tenon::LoadedScene& loaded) {
  const auto made_of = tenon::madeOf(arguments.rerun);
  if (!made_of) return complain(made_of.error().what);
  if (hasChanged(arguments, *made_of, loaded)) return 1;
  tenon::Exercise exercise(loaded.scenario, loaded.scene, arguments.session.exercise);
  const auto report = tenon::rerun(arguments.rerun, exercise);
  if (!report) return complain(report.error().what);
  sayOn(fmt::format("ticks {} to {}: {} compared, {} gaps", report->first, report->last, report->compared,
                    report->gaps));
  if (!report->problem.empty()) sayOn(report->problem);
  if (report->first_difference) {
    sayOn(fmt::format("first difference: tick {}", *report->first_difference));
    return 1;
  }
  sayOn(fmt::format("final state hash: {:016x}", report->final_hash));
  return 0;
}

int serve(Arguments& arguments) {
  if (arguments.scenario.empty() && !arguments.rerun.empty()) {
    const auto origin = tenon::originOf(arguments.rerun);
    if (!origin) return complain(origin.error().what);
    arguments.scenario = origin->scenario;
    arguments.load.detail = origin->detail;
  }
  if (arguments.scenario.empty()) return complain("name a scenario, as in: tenon serve scenarios/engine_bay");
  const auto loaded = tenon::loadScene(arguments.scenario, arguments.load, showLoading);
  if (!loaded) return complain(loaded.error().what);
  if (!arguments.rerun.empty()) return runAgain(arguments, *loaded);

  arguments.session.say = sayOn;
  arguments.session.detail = arguments.load.detail;
  auto server = tenon::SessionServer::open(*loaded, arguments.session);
  if (!server) return complain(server.error().what);
  const auto report = (*server)->run(stop_asked);
  if (!report) return complain(report.error().what);
  sayOn(fmt::format("{} after {:.1f} s; late ticks: {}; refused inputs: {}", report->run.reason,
                    static_cast<double>(report->run.tick) * tenon::kTickSeconds, report->late_ticks,
                    report->refused_inputs));
  sayOn(fmt::format("final state hash: {:016x}", report->run.final_hash));
  return report->run.phase == tenon::RunPhase::kSucceeded ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs a training session: computes every contact and tells everybody over DDS.",
               "tenon serve");
  Arguments arguments;
  declare(app, arguments);
  CLI11_PARSE(app, argc, argv);
  std::signal(SIGINT, askToStop);
  std::signal(SIGTERM, askToStop);
  return serve(arguments);
}
