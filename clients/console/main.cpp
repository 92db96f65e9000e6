#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "clients/console/gateway.h"
#include "idl/threads/line_printer.h"
#include "idl/types/cache_folder.h"
#include "idl/wire/key_option.h"
#include "idl/wire/network.h"
#include "idl/wire/session_name.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

int run(int argc, char** argv) {
  CLI::App app{
      "tenon-console: shows sessions or a recording in the browser, and to viewers of the Foxglove WebSocket "
      "protocol, until it is stopped"};
  tenon::console::GatewayOptions options;
  options.page = tenon::console::defaultPage();
  options.cache = tenon::defaultCache();
  std::string shown, role;
  std::vector<std::string> certificate;
  app.add_option("shown", shown,
                 "name of a session, or a recording, FILE.mcap; default: all sessions there are")
      ->option_text("SESSION|FILE.mcap");
  tenon::wire::addSessionOption(app, options.session, "name of a session");
  app.add_option("--role", role,
                 "instructor or trainee: prints an address that gives this role to whoever has it, with the "
                 "key of your sessions")
      ->check(CLI::IsMember({"instructor", "trainee"}));
  tenon::wire::addKeyOption(app, options.key_file, "the key of the sessions; default: yours");
  app.add_option("--domain", options.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  tenon::wire::addNetworkOption(app);
  app.add_option("--port", options.web.port, "0: any that is free")->capture_default_str();
  app.add_option(
         "--listen", options.web.address,
         "address of the interface on which it is reached: that of a network card, or 0.0.0.0 for all; "
         "beyond this machine with --tls")
      ->capture_default_str();
  auto* const tls = app.add_option("--tls", certificate,
                                   "the certificate and its key, PEM files, for https; tenon cert makes "
                                   "them")
                        ->option_text("CERT,KEY")
                        ->delimiter(',')
                        ->expected(2);
  app.add_flag("--without-tls", options.web.is_plain_permitted,
               "http beyond this machine: everybody on the network can read along, keys of seats as well")
      ->excludes(tls);
  app.add_option(
      "--allow-origin", options.web.origins,
      "a viewer's page from elsewhere that may connect, as in https://viewer.example; repeat it for more");
  app.add_option("--recordings-from", options.web.recordings_from,
                 "a server from which the page may open recordings by their addresses, as in "
                 "https://files.example; repeat it for more")
      ->option_text("ORIGIN");
  app.add_option("--cache", options.cache, "folder in which the server keeps the models of parts");
  app.add_option("--recordings", options.recordings,
                 "folder for recordings that instructors start in the browser; default: none can be started")
      ->option_text("FOLDER");
  app.footer("Exit code: 0 when it was stopped, 1 when it could not serve, 2 for wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (shown.ends_with(".mcap"))
    options.recording = shown;
  else if (!shown.empty())
    options.session = shown;
  if (const auto permitted = tenon::wire::checkSessionName(options.session);
      !options.session.empty() && !permitted) {
    std::fprintf(stderr, "tenon-console: %s\n", permitted.error().what.c_str());
    return 2;
  }
  if (!certificate.empty()) {
    options.web.certificate = certificate[0];
    options.web.key = certificate[1];
  }
  if (const auto key = tenon::wire::checkKeyOption(options.key_file); !key) {
    std::fprintf(stderr, "tenon-console: %s\n", key.error().what.c_str());
    return 1;
  }
  if (!role.empty()) options.role = role == "trainee" ? tenon::Role::kTrainee : tenon::Role::kInstructor;
  // a terminal that stands still does not stop the gateway
  tenon::threads::LinePrinter printer(tenon::threads::LinePrinter::kOutput);
  options.print = [&printer](const std::string& text) { printer.print(text); };
  options.progress = [](const std::string& text) {
    std::fprintf(stderr, "tenon-console: %s\n", text.c_str());
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
