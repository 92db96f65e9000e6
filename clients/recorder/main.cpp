#include <atomic>
#include <csignal>
#include <cstdio>

#include <CLI/CLI.hpp>

#include "clients/recorder/recorder_program.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

int run(int argc, char** argv) {
  CLI::App app{"tenon-record: records a session, everything on its bus, into an MCAP file; ends with it"};
  tenon::RecorderOptions options;
  unsigned wait = 10;
  app.add_option("-o,--output", options.file, "the recording, as in session.mcap")->required();
  app.add_option("--session", options.session, "its name; the first one announced when left out");
  app.add_option("--domain", options.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  app.add_flag("--lockstep", options.lockstep, "only a session that runs in lockstep");
  app.add_option("--wait", wait, "seconds to look for a server")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  options.patience = std::chrono::seconds(wait);
  options.say = [](const std::string& text) {
    std::printf("%s\n", text.c_str());
    std::fflush(stdout);
  };
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const auto recorded = tenon::record(options, stop);
  if (!recorded) {
    std::fprintf(stderr, "tenon-record: %s\n", recorded.error().what.c_str());
    return 1;
  }
  options.say(recorded->file + ": " + std::to_string(recorded->messages) + " messages, " +
              std::to_string(recorded->lost) + " ticks missing");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon-record: %s\n", problem.what());
    return 1;
  }
}
