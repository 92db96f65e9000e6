#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/haptic/station_program.h"

namespace tenon::haptic {

/// Description of a station's executable. The command-line options common to all stations are added to it.
struct StationMainOptions {
  std::string name;                                        ///< of the executable
  std::string description;                                 ///< for --help
  std::string person;                                      ///< default name of the participant
  std::uint64_t& seed;                                     ///< of simulated person and device; set by --seed
  std::function<void(CLI::App&)> add_options;              ///< adds the options of this station
  std::function<Result<std::unique_ptr<Station>>()> open;  ///< called after parsing
};

/// Parses the command line, opens the station and runs it in a session; returns the exit code.
///
/// Threads: main. Real-time: no.
[[nodiscard]] int runStationMain(int argc, char** argv, const StationMainOptions& main);

}  // namespace tenon::haptic
