#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/haptic/station_program.h"
#include "clients/instructor/instructor_station.h"

namespace {

int run(int argc, char** argv) {
  CLI::App app{"tenon-instructor: the instructor's station: a desk device that moves the teaching assistant"};
  tenon::InstructorOptions instructor;
  tenon::StationProgramOptions program;
  program.link.person = "instructor";
  unsigned wait = 10;
  app.add_option("--device", instructor.device, "sigma7-sim, omega3-sim or falcon-sim")
      ->capture_default_str();
  app.add_option("--session", program.link.session, "its name; the first one announced when left out");
  app.add_option("--domain", program.link.domain, "DDS domain")->capture_default_str();
  app.add_option("--seed", instructor.person.seed, "of the simulated person and device")
      ->capture_default_str();
  app.add_flag("--lockstep", program.lockstep, "insist on a session in lockstep: a step for each tick heard");
  app.add_option("--person", program.link.person, "the name others see")->capture_default_str();
  app.add_option("--language", program.language, "of the instructions shown here")->capture_default_str();
  app.add_option("--wait", wait, "seconds to look for a server")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  program.link.patience = std::chrono::seconds(wait);
  program.say = [](const std::string& text) { std::fprintf(stderr, "tenon-instructor: %s\n", text.c_str()); };

  auto station = tenon::InstructorStation::open(instructor);
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
    std::fprintf(stderr, "tenon-instructor: %s\n", problem.what());
    return 1;
  }
}
