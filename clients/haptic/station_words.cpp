#include "clients/haptic/station_words.h"

#include <chrono>
#include <cstdio>
#include <exception>

namespace tenon {

namespace {

void declareCommon(CLI::App& app, StationProgramOptions& program, std::uint64_t& seed) {
  MembershipWishes& link = program.link;
  app.add_option("--session", link.session, "its name; the first one announced when left out");
  app.add_option("--domain", link.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  app.add_option("--seed", seed, "of the simulated person and device")->capture_default_str();
  app.add_flag("--lockstep", link.lockstep, "insist on a session in lockstep: a step for each tick heard");
  app.add_option("--person", link.person, "the name others see")->capture_default_str();
  app.add_option("--language", program.language, "of the instructions shown here")->capture_default_str();
  app.add_option_function<unsigned>(
         "--wait", [&link](unsigned seconds) { link.patience = std::chrono::seconds(seconds); },
         "seconds to look for a server, or for one that was lost")
      ->default_str("10");
  app.add_option("--seat", program.seat,
                 "file that keeps the seat: started again with it, a station gets its hands back");
}

int run(int argc, char** argv, const StationMain& main) {
  CLI::App app(main.name + ": " + main.what);
  StationProgramOptions program;
  program.link.person = main.person;
  main.declare(app);
  declareCommon(app, program, main.seed);
  CLI11_PARSE(app, argc, argv);
  program.say = [&main](const std::string& text) {
    std::fprintf(stderr, "%s: %s\n", main.name.c_str(), text.c_str());
  };
  auto station = main.open();
  if (!station) {
    program.say(station.error().what);
    return 1;
  }
  const auto ended = runStation(**station, program, stopSignal());
  if (!ended) program.say(ended.error().what);
  return ended ? 0 : 1;
}

}  // namespace

int runStationMain(int argc, char** argv, const StationMain& main) {
  try {
    return run(argc, argv, main);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "%s: %s\n", main.name.c_str(), problem.what());
    return 1;
  }
}

}  // namespace tenon
