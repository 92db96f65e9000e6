#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "clients/instructor/instructor_station.h"
#include "clients/rehearse/rehearsal.h"
#include "clients/trainee/trainee_station.h"
#include "devices/catalog.h"

namespace {

struct RehearseArguments {
  std::string scenario;
  tenon::session::LoadOptions load{.cache = tenon::session::defaultCache()};
  tenon::rehearse::RehearsalOptions rehearsal;
  bool alone = false;
  bool no_collisions = false;
  bool quiet = false;
  bool follow = false;
  int misplaced_mount = -1;
  std::string device = "sigma7-sim";
};

void declare(CLI::App& app, RehearseArguments& arguments) {
  app.set_help_flag("-h,--help", "print this help");
  app.add_option("scenario", arguments.scenario, "a scenario's folder or YAML file")->required();
  app.add_option("--seed", arguments.rehearsal.seed, "seed of the simulated people and devices")
      ->capture_default_str();
  app.add_option("--workers", arguments.rehearsal.workers,
                 "threads that compute contacts; the result does not depend on them")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--seconds", arguments.rehearsal.seconds, "limit of the session time [s]")
      ->check([](const std::string& text) {
        const double number = std::strtod(text.c_str(), nullptr);
        return std::isfinite(number) && number > 0.0 ? "" : "must be a number greater than 0";
      })
      ->capture_default_str();
  app.add_option("--detail", arguments.load.detail, "level of detail of generated parts, 0 to 1")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--cache", arguments.load.cache, "folder for generated parts and haptic structures");
  app.add_option("--device", arguments.device, "the instructor's device")
      ->check([](const std::string& name) {
        const auto known = tenon::devices::checkDeviceName(name);
        return known ? std::string() : known.error().what;
      })
      ->capture_default_str();
  app.add_option(
         "--misplace-mount", arguments.misplaced_mount,
         "the simulated trainee inserts the N-th mount, from 0, at a wrong pose and does not correct it")
      ->option_text("N");
  app.add_option_function<std::string>("--stubborn",
                                       [](const std::string&) {
                                         std::fputs("tenon rehearse: --stubborn is now --misplace-mount\n",
                                                    stderr);
                                         throw CLI::RuntimeError(2);
                                       })
      ->expected(0, 1)
      ->group("");
  app.add_flag("--no-instructor", arguments.alone, "without the instructor");
  app.add_flag("--no-collisions", arguments.no_collisions, "disable collisions with the scene");
  app.add_flag("--follow", arguments.follow,
               "print activity, errors and force of the trainee twice per second");
  app.add_flag("--quiet", arguments.quiet, "print the outcome only");
  app.footer(
      "Exit code: 0 if the session succeeded, 1 if not, 2 for wrong usage. Last line: the final state hash.");
}

int printError(const std::string& what) {
  std::fprintf(stderr, "tenon rehearse: %s\n", what.c_str());
  return 1;
}

/// Prints a line on the trainee twice per second of session time.
void followTrainee(RehearseArguments& arguments, const tenon::trainee::TraineeStation& trainee) {
  arguments.rehearsal.on_tick = [&trainee](const tenon::session::TickInput&,
                                           const tenon::session::TickOutput& output) {
    if (output.tick % 500 != 0) return;
    double force = 0.0;
    double depth = 0.0;
    for (const tenon::HandManifold& hand : output.manifolds)
      force = std::max(force, hand.F_Ho_W.force.norm());
    for (const tenon::session::PairState& pair : output.pairs) depth = std::max(depth, pair.contact.depth);
    std::printf("%8.3f s  %-22s %7.1f mm %6.2f deg  force %5.1f N  contact %5.2f s  depth %.2f mm\n",
                static_cast<double>(output.tick) * tenon::kTickSeconds, trainee.activity(),
                1e3 * output.step.position_error, output.step.angle_error * 57.29578, force,
                output.step.contact_seconds, 1e3 * depth);
  };
}

/// Stations of the simulated trainee and, if the scenario has a hand for one, of the instructor.
tenon::Result<std::vector<std::unique_ptr<tenon::haptic::Station>>> openStations(
    RehearseArguments& arguments, const tenon::game_control::ScenarioFile& scenario) {
  std::vector<std::unique_ptr<tenon::haptic::Station>> stations;
  tenon::trainee::TraineeOptions trainee;
  trainee.person.seed = arguments.rehearsal.seed;
  trainee.person.misplaced_mount = arguments.misplaced_mount;
  auto opened = tenon::trainee::TraineeStation::open(trainee);
  if (!opened) return tenon::fail(opened.error().what);
  if (arguments.follow) followTrainee(arguments, **opened);
  stations.push_back(std::move(*opened));
  if (arguments.alone || !scenario.handNamed("instructor").valid()) return stations;

  tenon::instructor::InstructorOptions instructor;
  instructor.device = arguments.device;
  instructor.person.seed = arguments.rehearsal.seed;
  auto opened_instructor = tenon::instructor::InstructorStation::open(instructor);
  if (!opened_instructor) return tenon::fail(opened_instructor.error().what);
  stations.push_back(std::move(*opened_instructor));
  return stations;
}

int run(RehearseArguments& arguments) {
  const auto loaded = tenon::session::loadScene(arguments.scenario, arguments.load);
  if (!loaded) return printError(loaded.error().what);
  auto stations = openStations(arguments, *loaded->scenario);
  if (!stations) return printError(stations.error().what);
  arguments.rehearsal.collisions = !arguments.no_collisions;
  if (!arguments.quiet)
    arguments.rehearsal.on_event = [](const tenon::EventLog& event) {
      std::printf("%8.3f s  %-12s %s\n", static_cast<double>(event.tick) * tenon::kTickSeconds,
                  event.kind.c_str(), event.text.c_str());
    };
  const auto report = tenon::rehearse::runRehearsal(*loaded, std::move(*stations), arguments.rehearsal);
  if (!report) return printError(report.error().what);
  std::printf("%s after %.3f s\nfinal state hash: %016llx\n", report->reason.c_str(),
              static_cast<double>(report->ticks) * tenon::kTickSeconds,
              static_cast<unsigned long long>(report->final_hash));
  return report->phase == tenon::RunPhase::kSucceeded ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs a session with simulated people in one process, on a virtual clock.", "tenon rehearse");
  RehearseArguments arguments;
  declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return run(arguments);
}
