#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/console/gateway.h"
#include "idl/types/cache_folder.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

int run(int argc, char** argv) {
  CLI::App app{
      "tenon-console: shows a session in the browser, and to viewers of the Foxglove WebSocket protocol, "
      "until it is "
      "stopped"};
  tenon::console::GatewayOptions options;
  options.page = tenon::console::defaultPage();
  options.cache = tenon::defaultCache();
  app.add_option("session", options.session, "name of the session; default: the first one announced");
  app.add_option("--session", options.session, "the same");
  app.add_option("--domain", options.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  app.add_option("--port", options.web.port, "port on this machine's loopback interface; 0: any that is free")
      ->capture_default_str();
  app.add_option(
      "--allow-origin", options.web.origins,
      "a viewer's page from elsewhere that may connect, as in https://viewer.example; repeat it for more");
  app.add_option("--cache", options.cache, "folder in which the server keeps the models of parts");
  app.footer("Exit code: 0 when it was stopped, 1 when it could not serve, 2 for wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  options.print = [](const std::string& text) {
    std::printf("%s\n", text.c_str());
    std::fflush(stdout);
  };
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  if (const auto served = tenon::console::runGateway(options, stop); !served) {
    std::fprintf(stderr, "tenon-console: %s\n", served.error().what.c_str());
    return 1;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon-console: %s\n", problem.what());
    return 1;
  }
}
