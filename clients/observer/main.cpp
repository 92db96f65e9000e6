#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/observer/observer_program.h"
#include "idl/wire/joining_names.h"
#include "idl/wire/key_option.h"
#include "idl/wire/network.h"
#include "idl/wire/session_name.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

int run(int argc, char** argv) {
  CLI::App app{
      "tenon-observer: prints steps, contacts and events of a session until it ends; exit 0 if it succeeded"};
  tenon::observer::ObserverOptions options;
  tenon::wire::MembershipOptions membership{.person = "observer"};
  unsigned wait = 10;
  app.add_flag("--allow-skips", options.allow_skips, "exit 0 although steps were skipped");
  app.add_flag("--json", options.json, "print one JSON object per line");
  tenon::wire::addSessionOption(app, membership.session, tenon::wire::kJoinedSessionHelp);
  app.add_option("--domain", membership.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  tenon::wire::addNetworkOption(app);
  tenon::wire::addKeyOption(
      app, membership.key_file,
      "file of the session's key, which a server beyond loopback may ask for (default: yours)");
  tenon::wire::addNameOption(app, "--name", membership.person, "name shown to the other participants")
      ->capture_default_str();
  app.add_option("--language", options.language, "language of titles and instructions")
      ->capture_default_str();
  app.add_option("--wait", wait, "seconds to search for a server")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (const auto key = tenon::wire::checkKeyOption(membership.key_file); !key) {
    std::fprintf(stderr, "tenon-observer: %s\n", key.error().what.c_str());
    return 1;
  }
  membership.timeout = std::chrono::seconds(wait);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  tenon::observer::Observer observer(options);
  if (const auto ended = tenon::observer::observeSession(observer, membership, stop); !ended) {
    std::fprintf(stderr, "tenon-observer: %s\n", ended.error().what.c_str());
    return 1;
  }
  return observer.exitCode();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon-observer: %s\n", problem.what());
    return 1;
  }
}
