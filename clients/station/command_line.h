#pragma once

#include <optional>
#include <string>

#include "clients/haptic/station_program.h"
#include "clients/station/device_station.h"

namespace tenon::station {

/// What `tenon join` was told.
struct JoinArguments {
  StationOptions station;
  haptic::StationProgramOptions program;
};

/// How reading the command line ended.
struct CommandLine {
  std::optional<JoinArguments> arguments;  ///< none: the program ends
  int exit_code = 0;                       ///< then
};

/// Reads the command line, and the files that it names. Prints help and errors.
///
/// Threads: any. Real-time: no.
[[nodiscard]] CommandLine readCommandLine(int argc, char** argv);

}  // namespace tenon::station
