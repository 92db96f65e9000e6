#include <atomic>
#include <csignal>
#include <cstdio>

#include <CLI/CLI.hpp>

#include "clients/recorder/recorder_program.h"
#include "idl/threads/line_printer.h"
#include "idl/types/output_files.h"
#include "idl/wire/key_option.h"
#include "idl/wire/network.h"
#include "idl/wire/session_name.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

int run(int argc, char** argv) {
  CLI::App app{"tenon-record: records a session to an MCAP file until it ends"};
  tenon::recorder::RecorderOptions options;
  unsigned wait = 10;
  bool overwrite = false;
  app.add_option("-o,--output", options.file, "file to write, e.g. session.mcap")->required();
  tenon::wire::addSessionOption(app, options.session, tenon::wire::kJoinedSessionHelp);
  app.add_option("--domain", options.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  tenon::wire::addNetworkOption(app);
  tenon::wire::addKeyOption(
      app, options.key_file,
      "file of the session's key, which a server beyond loopback may ask for (default: yours)");
  app.add_option("--assets", options.assets_url,
                 "where display models are fetched that the cache does not have: a console at the server")
      ->option_text("http://HOST:PORT");
  app.add_flag("--all", options.all,
               "also the streams of 1 kHz, sample by sample: about three times as large a file");
  app.add_flag("--lockstep", options.lockstep, "refuse a session that does not run in lockstep");
  app.add_flag("--overwrite", overwrite, tenon::kOverwriteHelp);
  app.add_option("--wait", wait, "seconds to search for a server")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (const auto refusal = tenon::refuseOutputs({.outputs = {options.file}, .overwrite = overwrite})) {
    std::fprintf(stderr, "tenon-record: %s\n", refusal->what.c_str());
    return refusal->exit_code;
  }
  if (const auto key = tenon::wire::checkKeyOption(options.key_file); !key) {
    std::fprintf(stderr, "tenon-record: %s\n", key.error().what.c_str());
    return 1;
  }
  options.timeout = std::chrono::seconds(wait);
  // a terminal that stands still does not stop the recording
  tenon::threads::LinePrinter printer(tenon::threads::LinePrinter::kOutput);
  options.report = [&printer](const std::string& text) { printer.print(text); };
  // a limit on the size of files is an error of the write, as a full disk is
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const auto recorded = tenon::recorder::recordSession(options, stop);
  if (!recorded) {
    std::fprintf(stderr, "tenon-record: %s\n", recorded.error().what.c_str());
    return 1;
  }
  const tenon::RecorderStatus& status = recorded->status;
  options.report(status.file + ": " + std::to_string(status.messages) + " messages, " +
                 std::to_string(status.lost) + " published samples missing");
  for (const tenon::recorder::TopicCount& count : recorded->counts)
    options.report("  " + count.topic + ": " + std::to_string(count.recorded) + " of " +
                   std::to_string(count.published) + " samples");
  if (!recorded->boxes.empty())
    options.report(status.file + ": public viewers show " + std::to_string(recorded->boxes.size()) +
                   " objects as boxes, for their display models are not on this machine: --assets "
                   "http://HOST:PORT names a console at the server, which has them");
  if (const std::uint64_t missing = recorded->missingTicks(); missing > 0) {
    std::fprintf(
        stderr,
        "tenon-record: %s: the inputs of %llu ticks are missing: it cannot be re-simulated beyond them\n",
        status.file.c_str(), static_cast<unsigned long long>(missing));
    return 1;
  }
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
