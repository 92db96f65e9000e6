#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/haptic/station_program.h"
#include "clients/trainee/trainee_station.h"

namespace {

int run(int argc, char** argv) {
  CLI::App app{
      "tenon-trainee: the trainee's station: two haptic arms, a tracked forearm with an arm band, a head"};
  tenon::TraineeOptions trainee;
  tenon::StationProgramOptions program;
  program.link.person = "trainee";
  unsigned wait = 10;
  std::string tactile = "intensity";
  app.add_option("--device", trainee.device, "a machine with two arms")->capture_default_str();
  app.add_option("--tactors", trainee.tactors, "the arm band")->capture_default_str();
  app.add_option("--session", program.link.session, "its name; the first one announced when left out");
  app.add_option("--domain", program.link.domain, "DDS domain")->capture_default_str();
  app.add_option("--seed", trainee.person.seed, "of the simulated person and device")->capture_default_str();
  app.add_flag("--lockstep", program.lockstep, "insist on a session in lockstep: a step for each tick heard");
  app.add_option("--person", program.link.person, "the name others see")->capture_default_str();
  app.add_option("--language", program.language, "of the instructions shown here")->capture_default_str();
  app.add_option("--wait", wait, "seconds to look for a server")->capture_default_str();
  app.add_option("--tactile", tactile, "how contacts of the forearm vibrate")
      ->check(CLI::IsMember({"intensity", "pattern"}))
      ->capture_default_str();
  app.add_flag("--swap-hands", trainee.swap_hands, "the right arm moves hand `left` and the other way round");
  app.add_option("--stubborn", trainee.person.stubborn_mount,
                 "the mount (0: the first) in which the simulated trainee is sure of a wrong place; -1: none")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  trainee.tactile = tactile == "pattern" ? tenon::TactileMode::kPattern : tenon::TactileMode::kIntensity;
  program.link.patience = std::chrono::seconds(wait);
  program.say = [](const std::string& text) { std::fprintf(stderr, "tenon-trainee: %s\n", text.c_str()); };

  auto station = tenon::TraineeStation::open(trainee);
  if (!station) {
    program.say(station.error().what);
    return 1;
  }
  const auto ended = tenon::runStation(**station, program, tenon::stopSignal());
  if (!ended) program.say(ended.error().what);
  return ended ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon-trainee: %s\n", problem.what());
    return 1;
  }
}
