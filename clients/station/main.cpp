#include <cstdio>
#include <exception>
#include <string>

#include <unistd.h>

#include "clients/haptic/station_program.h"
#include "clients/station/command_line.h"
#include "clients/station/device_station.h"
#include "idl/threads/line_printer.h"
#include "idl/types/printable_text.h"

namespace {

constexpr std::size_t kLongestLine = 1000;  // [bytes]

void print(const std::string& text) { std::fprintf(stderr, "tenon-join: %s\n", text.c_str()); }

int run(int argc, char** argv) {
  tenon::station::CommandLine line = tenon::station::readCommandLine(argc, argv);
  if (!line.arguments) return line.exit_code;
  auto station = tenon::station::DeviceStation::open(line.arguments->station);
  if (!station) {
    print(station.error().what);
    return 1;
  }
  for (const tenon::station::StationDevice& device : line.arguments->station.devices) {
    if (device.name == tenon::devices::kRemoteHand)
      print("a remote hand may connect to " + device.configuration.address);
  }
  tenon::haptic::StationProgramOptions& program = line.arguments->program;
  program.read_keys = isatty(STDIN_FILENO) != 0;
  // the thread that prints also hears the emergency stop, whose text comes from whoever is on the bus
  tenon::threads::LinePrinter printer(tenon::threads::LinePrinter::kError);
  program.print = [&printer](const std::string& text) {
    printer.print("tenon-join: " + tenon::printable(tenon::shortened(text, kLongestLine)));
  };
  const auto ended = tenon::haptic::runStation(**station, program, tenon::haptic::stopSignal());
  if (!ended) program.print(ended.error().what);
  return ended ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    print(problem.what());
    return 1;
  }
}
