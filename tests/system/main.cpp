#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "clients/instructor/instructor_station.h"
#include "clients/trainee/trainee_station.h"
#include "tests/system/rehearsal.h"

namespace {

struct Arguments {
  std::string scenario;
  tenon::LoadOptions load{.cache = tenon::defaultCache()};
  tenon::RehearsalOptions rehearsal;
  bool alone = false;
  bool no_collisions = false;
  bool quiet = false;
  bool follow = false;
  int stubborn = -1;
  std::string device = "sigma7-sim";
};

void declare(CLI::App& app, Arguments& arguments) {
  app.set_help_flag("-h,--help", "what this program does and how to call it");
  app.add_option("scenario", arguments.scenario, "a scenario's folder or YAML file")->required();
  app.add_option("--seed", arguments.rehearsal.seed, "who the simulated people are")->capture_default_str();
  app.add_option("--workers", arguments.rehearsal.workers,
                 "threads that compute contacts; never changes the result")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--seconds", arguments.rehearsal.seconds, "of session time, at most")->capture_default_str();
  app.add_option("--detail", arguments.load.detail, "of generated parts, 0 to 1")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--cache", arguments.load.cache, "folder for generated parts and haptic structures");
  app.add_option("--device", arguments.device, "the instructor's device")->capture_default_str();
  app.add_option("--stubborn", arguments.stubborn,
                 "the n-th mount (from 0) that the trainee aims at a wrong place");
  app.add_flag("--no-instructor", arguments.alone, "the trainee is alone");
  app.add_flag("--no-collisions", arguments.no_collisions,
               "nothing touches the scene: the same people try the same");
  app.add_flag("--follow", arguments.follow, "print twice a second what the trainee does and how far it is");
  app.add_flag("--quiet", arguments.quiet, "print the outcome only");
  app.footer("Exit code: 0 when everything was mounted, 1 otherwise. Last line: the final state hash.");
}

int complain(const std::string& what) {
  std::fprintf(stderr, "tenon rehearse: %s\n", what.c_str());
  return 1;
}

/// Has two lines a second printed on what the trainee does.
void followTrainee(Arguments& arguments, const tenon::TraineeStation& trainee) {
  arguments.rehearsal.ticked = [&trainee](const tenon::TickInput&, const tenon::TickOutput& output) {
    if (output.tick % 500 != 0) return;
    double force = 0.0;
    double depth = 0.0;
    for (const tenon::HandManifold& hand : output.manifolds)
      force = std::max(force, hand.F_Ho_W.force.norm());
    for (const tenon::PairState& pair : output.pairs) depth = std::max(depth, pair.contact.depth);
    std::printf("%8.3f s  %-22s %7.1f mm %6.2f deg  force %5.1f N  contact %5.2f s  depth %.2f mm\n",
                static_cast<double>(output.tick) * tenon::kTickSeconds, trainee.doing(),
                1e3 * output.step.position_error, output.step.angle_error * 57.29578, force,
                output.step.contact_seconds, 1e3 * depth);
  };
}

/// The people that the scenario has hands for.
tenon::Result<std::vector<std::unique_ptr<tenon::Station>>> people(Arguments& arguments,
                                                                   const tenon::ScenarioFile& scenario) {
  std::vector<std::unique_ptr<tenon::Station>> stations;
  tenon::TraineeOptions trainee;
  trainee.person.seed = arguments.rehearsal.seed;
  trainee.person.stubborn_mount = arguments.stubborn;
  auto opened = tenon::TraineeStation::open(trainee);
  if (!opened) return tenon::fail(opened.error().what);
  if (arguments.follow) followTrainee(arguments, **opened);
  stations.push_back(std::move(*opened));
  if (arguments.alone || !scenario.handNamed("instructor").valid()) return stations;

  tenon::InstructorOptions instructor;
  instructor.device = arguments.device;
  instructor.person.seed = arguments.rehearsal.seed;
  auto helper = tenon::InstructorStation::open(instructor);
  if (!helper) return tenon::fail(helper.error().what);
  stations.push_back(std::move(*helper));
  return stations;
}

int rehearse(Arguments& arguments) {
  const auto loaded = tenon::loadScene(arguments.scenario, arguments.load);
  if (!loaded) return complain(loaded.error().what);
  auto stations = people(arguments, *loaded->scenario);
  if (!stations) return complain(stations.error().what);
  arguments.rehearsal.collisions = !arguments.no_collisions;
  if (!arguments.quiet)
    arguments.rehearsal.heard = [](const tenon::EventLog& event) {
      std::printf("%8.3f s  %-12s %s\n", static_cast<double>(event.tick) * tenon::kTickSeconds,
                  event.kind.c_str(), event.text.c_str());
    };
  const auto report = tenon::rehearse(*loaded, std::move(*stations), arguments.rehearsal);
  if (!report) return complain(report.error().what);
  std::printf("%s after %.3f s\nfinal state hash: %016llx\n", report->reason.c_str(),
              static_cast<double>(report->ticks) * tenon::kTickSeconds,
              static_cast<unsigned long long>(report->final_hash));
  return report->phase == tenon::RunPhase::kSucceeded ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs a whole session in one process with simulated people, as fast as it computes.",
               "tenon rehearse");
  Arguments arguments;
  declare(app, arguments);
  CLI11_PARSE(app, argc, argv);
  return rehearse(arguments);
}
