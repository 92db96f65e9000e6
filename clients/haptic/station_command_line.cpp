#include "clients/haptic/station_command_line.h"

#include <chrono>
#include <cstdio>
#include <exception>

#include <unistd.h>

#include "clients/haptic/seat_file.h"

namespace tenon::haptic {

namespace {

void addCommonOptions(CLI::App& app, StationProgramOptions& program, std::uint64_t& seed) {
  wire::MembershipOptions& membership = program.membership;
  app.add_option("--session", membership.session, "name of the session; default: the first one announced");
  app.add_option("--domain", membership.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  app.add_option("--seed", seed, "seed of the simulated person and device")->capture_default_str();
  app.add_flag("--lockstep", membership.lockstep,
               "require a lockstep session: one step for each received tick");
  app.add_option("--person", membership.person, "name shown to the other participants")
      ->capture_default_str();
  app.add_option("--language", program.language, "language of the printed instructions")
      ->capture_default_str();
  app.add_option_function<unsigned>(
         "--wait", [&membership](unsigned seconds) { membership.timeout = std::chrono::seconds(seconds); },
         "seconds to search for a server, at start and after a loss of the connection")
      ->default_str("10");
  app.add_option(
      "--seat", program.seat_file,
      "file that keeps the secret key of the seat, so that a restarted station gets its hands back");
  app.add_option("--key", membership.key_file,
                 "file of the session's key, which instructors and admins need (default: the one of your own "
                 "servers)");
  app.add_flag("--arm", program.armed,
               "the devices may display forces at once: the person is at the station");
}

int run(int argc, char** argv, const StationMainOptions& main) {
  CLI::App app(main.name + ": " + main.description);
  StationProgramOptions program;
  program.membership.person = main.person;
  main.add_options(app);
  addCommonOptions(app, program, main.seed);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  program.read_keys = isatty(STDIN_FILENO) != 0;
  program.print = [&main](const std::string& text) {
    std::fprintf(stderr, "%s: %s\n", main.name.c_str(), text.c_str());
  };
  if (!mayBeSeatFile(program.seat_file)) {
    program.print(program.seat_file.string() + ": is not the file of a seat; name another one with --seat");
    return 1;
  }
  auto station = main.open();
  if (!station) {
    program.print(station.error().what);
    return 1;
  }
  const auto ended = runStation(**station, program, stopSignal());
  if (!ended) program.print(ended.error().what);
  return ended ? 0 : 1;
}

}  // namespace

int runStationMain(int argc, char** argv, const StationMainOptions& main) {
  try {
    return run(argc, argv, main);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "%s: %s\n", main.name.c_str(), problem.what());
    return 1;
  }
}

}  // namespace tenon::haptic
