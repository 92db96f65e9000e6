#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/haptic/station_program.h"

namespace tenon {

/// A station as a program of its own, but for what all of them have in common.
struct StationMain {
  std::string name;    ///< of the program
  std::string what;    ///< it is, as a clause
  std::string person;  ///< others see, unless the command line names another
  std::uint64_t& seed;
  std::function<void(CLI::App&)> declare;  ///< its own words
  std::function<Result<std::unique_ptr<Station>>()> open;
};

/// Reads the command line, opens the station and runs it in a session; the exit code.
///
/// Threads: main. Real-time: no.
[[nodiscard]] int runStationMain(int argc, char** argv, const StationMain& main);

}  // namespace tenon
