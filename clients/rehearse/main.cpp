#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "clients/haptic/scene_copy.h"
#include "clients/rehearse/rehearsal.h"
#include "clients/rehearse/script.h"
#include "clients/rehearse/tick_log.h"
#include "clients/station/device_station.h"
#include "devices/catalog.h"
#include "idl/types/cache_folder.h"
#include "idl/types/number_range.h"
#include "idl/types/output_files.h"
#include "server/check/check.h"
#include "server/game_control/scenario.h"
#include "server/session/loading_display.h"
#include "server/simulation/compiled_scene.h"

namespace {

std::atomic<bool> stop_requested = false;

void onStopSignal(int) { stop_requested = true; }

constexpr int kCouldNot = 1;
constexpr int kWrongUsage = 2;
constexpr double kLongestSession = 1e6;  // [s]

/// Options of simulated people, which --input does without.
constexpr std::array kPeopleOptions{"--seed",          "--device", "--misplace-mount",
                                    "--no-instructor", "--follow", "--force-model"};

const std::map<std::string, tenon::haptic::ForceModelKind> kForceModels{
    {"manifold", tenon::haptic::ForceModelKind::kManifold},
    {"scene-copy", tenon::haptic::ForceModelKind::kSceneCopy}};

struct RehearseArguments {
  std::string scenario;
  tenon::session::LoadOptions load{.cache = tenon::defaultCache(), .read = {}, .stop = &stop_requested};
  tenon::rehearse::RehearsalOptions rehearsal;
  std::optional<double> seconds;
  std::vector<std::string> inputs;
  std::vector<std::string> takes;
  std::string log;
  bool overwrite = false;
  tenon::rehearse::TickLogOptions log_options;
  tenon::haptic::ForceModelKind force_model = tenon::haptic::ForceModelKind::kManifold;
  bool alone = false;
  bool no_collisions = false;
  bool quiet = false;
  bool follow = false;
  int misplaced_mount = -1;
  std::string device{tenon::devices::kInstructorDevice};
};

void declareScript(CLI::App& app, RehearseArguments& arguments) {
  const auto one = [](CLI::Option* option, const char* text) {
    return option->allow_extra_args(false)->option_text(text);
  };
  CLI::Option* input =
      one(app.add_option("--input", arguments.inputs, "HAND follows the poses in this CSV file"),
          "HAND=FILE.csv ...");
  one(app.add_option(
          "--take", arguments.takes,
          "HAND holds OBJECT from the start on, with the hand's frame at the object's: the file has "
          "the poses where the device wants the object, and the object starts at the first one"),
      "HAND=OBJECT ...")
      ->needs(input);
  CLI::Option* log =
      app.add_option("--log", arguments.log, "write ticks to this file, a line of JSON each")->needs(input);
  app.add_flag("--overwrite", arguments.overwrite, tenon::kOverwriteHelp)->needs(log);
  app.add_option("--every", arguments.log_options.every, "log every N-th tick only")
      ->option_text("N")
      ->check(CLI::Range(1, 1'000'000'000))
      ->needs(log);
  app.add_flag(
         "--timing", arguments.log_options.timing,
         "log what each tick took, as compute_us [us]: simulation, output, hash, checkpoint, journal entry")
      ->needs(log);
}

void declare(CLI::App& app, RehearseArguments& arguments) {
  app.set_help_flag("-h,--help", "print this help");
  app.add_option("scenario", arguments.scenario, "a scenario's folder or YAML file")->required();
  app.add_option("--seed", arguments.rehearsal.seed, "seed of the simulated people and devices")
      ->capture_default_str()
      ->check(tenon::numberFrom(0.0, 1e18));
  app.add_option("--workers", arguments.rehearsal.workers,
                 "threads that compute contacts; the result does not depend on them")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--seconds", arguments.seconds,
                 "limit of the session time [s]; default: 600, or the last row's time with --input");
  app.add_option("--detail", arguments.load.detail,
                 "mesh resolution of generated parts, 0 to 1; 1: that of the paper")
      ->check(tenon::numberFrom(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--cache", arguments.load.cache, "folder for generated parts and haptic structures");
  app.add_option("--device", arguments.device, "the instructor's device")
      ->check([](const std::string& name) {
        const auto known = tenon::devices::findDevice(name);
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
  app.add_option_function<std::string>(
         "--force-model",
         [&arguments](const std::string& word) { arguments.force_model = kForceModels.at(word); },
         "contacts that hands render: the server's (manifold), or of a copy of the scene at their\n"
         "station (scene-copy)")
      ->check(CLI::IsMember(kForceModels))
      ->option_text("MODEL");
  app.add_flag("--no-instructor", arguments.alone, "without the instructor");
  app.add_flag("--no-collisions", arguments.no_collisions, "disable collisions with the scene");
  app.add_flag("--follow", arguments.follow,
               "print activity, errors and force of the trainee twice per second");
  app.add_flag("--quiet", arguments.quiet, "print the outcome only");
  declareScript(app, arguments);
  app.footer(
      "With --input, hands follow files instead of people: CSV with the header t,x,y,z,qw,qx,qy,qz, the\n"
      "device's pose in the world in seconds and metres; linear between rows (orientations by slerp), the\n"
      "first row held before its time, the last one after it. Hands without a file are absent, and the\n"
      "scenario need not have states.\n"
      "Exit code: 0 if the session succeeded, or has no states and ran to its limit; 1 if not; 2 for wrong\n"
      "usage. Last line: the final state hash.");
}

int printError(const std::string& what, int exit_code = kCouldNot) {
  std::fprintf(stderr, "tenon rehearse: %s\n", stop_requested ? "stopped" : what.c_str());
  return exit_code;
}

bool isSessionTime(double seconds) { return seconds >= tenon::kTickSeconds && seconds <= kLongestSession; }

/// Why the options do not fit together; empty: they do.
std::string wrongUsage(const CLI::App& app, const RehearseArguments& arguments) {
  if (arguments.seconds && !isSessionTime(*arguments.seconds))
    return fmt::format("--seconds {}: expected {} to {:.0f}", *arguments.seconds, tenon::kTickSeconds,
                       kLongestSession);
  for (const char* option : kPeopleOptions)
    if (!arguments.inputs.empty() && app.count(option) > 0)
      return fmt::format("{} is an option of simulated people; with --input there are none", option);
  return {};
}

/// Prints a line on the trainee twice per second of session time.
void followTrainee(RehearseArguments& arguments, const tenon::station::DeviceStation& trainee) {
  arguments.rehearsal.on_tick = [&trainee](const tenon::session::SessionSimulation&,
                                           const tenon::session::TickInput&,
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
  using tenon::station::DeviceStation;
  tenon::simulated_person::PersonOptions person;
  person.seed = arguments.rehearsal.seed;
  person.misplaced_mount = arguments.misplaced_mount;
  auto opened = DeviceStation::open(tenon::station::defaultStation(tenon::Role::kTrainee, person));
  if (!opened) return tenon::fail(opened.error().what);
  if (arguments.follow) followTrainee(arguments, **opened);
  stations.push_back(std::move(*opened));
  if (arguments.alone || !scenario.handNamed("instructor").valid()) return stations;

  auto instructor = tenon::station::defaultStation(tenon::Role::kInstructor, person);
  instructor.devices.front().name = arguments.device;
  auto opened_instructor = DeviceStation::open(instructor);
  if (!opened_instructor) return tenon::fail(opened_instructor.error().what);
  stations.push_back(std::move(*opened_instructor));
  return stations;
}

void setOptions(RehearseArguments& arguments) {
  arguments.rehearsal.collisions = !arguments.no_collisions;
  arguments.rehearsal.stop_when = [] { return stop_requested.load(); };
  if (arguments.seconds) arguments.rehearsal.seconds = *arguments.seconds;
  if (arguments.quiet) return;
  arguments.rehearsal.on_event = [](const tenon::EventLog& event) {
    std::printf("%8.3f s  %-12s %s\n", static_cast<double>(event.tick) * tenon::kTickSeconds,
                event.kind.c_str(), event.text.c_str());
  };
}

void printOutcome(const tenon::rehearse::RehearsalReport& report) {
  std::printf("%s after %.3f s\n", report.reason.c_str(),
              static_cast<double>(report.ticks) * tenon::kTickSeconds);
  if (report.crowded_ticks > 0)
    std::printf("in %llu ticks a pair had more contacts than its list takes; the farthest were skipped\n",
                static_cast<unsigned long long>(report.crowded_ticks));
  std::printf("final state hash: %016llx\n", static_cast<unsigned long long>(report.final_hash));
}

/// Says what is wrong with the scenario, as `tenon check` does.
void printProblems(const RehearseArguments& arguments, const tenon::session::LoadedScene& loaded) {
  if (arguments.quiet) return;
  const tenon::check::CheckOptions options{.instructor_device = arguments.device};
  for (const std::string& line : tenon::check::problems(*loaded.scenario, *loaded.scene, options))
    std::printf("%s\n", line.c_str());
}

/// Loads the scenario; says on a terminal what is generated and baked.
tenon::Result<tenon::session::LoadedScene> load(const RehearseArguments& arguments) {
  return tenon::session::loadScene(arguments.scenario, arguments.load, tenon::session::showOnTerminal);
}

void printThinWalls(const RehearseArguments& arguments, const tenon::session::LoadedScene& loaded) {
  if (arguments.quiet) return;
  for (const std::string& sentence : tenon::session::thinWallReport(*loaded.scene))
    std::printf("%s\n", sentence.c_str());
}

/// The scene as stations have it that fetch it from the server.
tenon::Result<std::shared_ptr<const tenon::simulation::Scene>> compiledScene(
    const tenon::simulation::Scene& scene) {
  const auto bytes = tenon::simulation::sceneBytes(scene);
  if (!bytes) return tenon::fail(bytes.error().what);
  return tenon::simulation::readScene(*bytes);
}

int rehearsePeople(RehearseArguments& arguments) {
  const auto loaded = load(arguments);
  if (!loaded) return printError(loaded.error().what);
  printThinWalls(arguments, *loaded);
  printProblems(arguments, *loaded);
  auto stations = openStations(arguments, *loaded->scenario);
  if (!stations) return printError(stations.error().what);
  if (arguments.force_model == tenon::haptic::ForceModelKind::kSceneCopy) {
    const auto compiled = compiledScene(*loaded->scene);
    if (!compiled) return printError(compiled.error().what);
    for (const auto& station : *stations) {
      station->setCopies(tenon::haptic::copiesOf(*compiled, station->handDevices().size()));
      station->setForceModel(arguments.force_model);
    }
  }
  setOptions(arguments);
  const auto report = tenon::rehearse::runRehearsal(*loaded, std::move(*stations), arguments.rehearsal);
  if (!report) return printError(report.error().what);
  if (stop_requested) return printError({});
  printOutcome(*report);
  return report->completed ? 0 : kCouldNot;
}

int rehearseScript(RehearseArguments& arguments) {
  // what was typed and the files are checked before parts are baked
  const auto names = tenon::game_control::readScenario(arguments.scenario, {.only_names = true});
  if (!names) return printError(names.error().what);
  auto script = tenon::rehearse::makeScript(arguments.inputs, arguments.takes, *names);
  if (!script) return printError(script.error().what, kWrongUsage);
  if (const auto read = tenon::rehearse::readTrajectories(*script); !read)
    return printError(read.error().what);
  if (!arguments.seconds) arguments.seconds = tenon::rehearse::endOf(*script);
  if (!isSessionTime(*arguments.seconds))
    return printError(fmt::format("the last row is at t = {}: give --seconds", *arguments.seconds),
                      kWrongUsage);
  std::optional<tenon::rehearse::TickLog> log;
  if (!arguments.log.empty()) {
    tenon::ProgramFiles files{{arguments.log}, {arguments.scenario}, arguments.overwrite};
    for (const tenon::rehearse::ScriptedHand& hand : script->hands) files.inputs.push_back(hand.file);
    if (const auto refusal = tenon::refuseOutputs(files))
      return printError(refusal->what, refusal->exit_code);
    auto opened = tenon::rehearse::TickLog::open(arguments.log, arguments.log_options);
    if (!opened) return printError(opened.error().what);
    log = std::move(*opened);
    arguments.rehearsal.on_tick = [&log](const auto& simulation, const auto&, const auto& output) {
      log->write(simulation, output);
    };
  }
  arguments.load.read = script->readOptions();
  const auto loaded = load(arguments);
  if (!loaded) return printError(loaded.error().what);
  printThinWalls(arguments, *loaded);
  setOptions(arguments);
  const auto report = tenon::rehearse::runScript(*script, *loaded, arguments.rehearsal);
  if (log)
    if (const auto closed = log->close(); !closed) return printError(closed.error().what);
  if (!report) return printError(report.error().what);
  if (stop_requested) return printError({});
  printOutcome(*report);
  const bool endless = loaded->scenario->states.front().line == 0;
  return endless || report->completed ? 0 : kCouldNot;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Runs a session in one process, on a virtual clock: with simulated people, or with hands that\n"
      "follow files.",
      "tenon rehearse");
  RehearseArguments arguments;
  declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongUsage;
  }
  if (const std::string wrong = wrongUsage(app, arguments); !wrong.empty())
    return printError(wrong, kWrongUsage);
  std::signal(SIGINT, onStopSignal);
  std::signal(SIGTERM, onStopSignal);
  return arguments.inputs.empty() ? rehearsePeople(arguments) : rehearseScript(arguments);
}
