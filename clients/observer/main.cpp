#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/observer/observer_program.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

int run(int argc, char** argv) {
  CLI::App app{"tenon-observer: follows a session: steps, contacts, events; ends with it, exit 0 on success"};
  tenon::ObserverOptions shown;
  tenon::MembershipWishes program{.person = "observer"};
  unsigned wait = 10;
  app.add_flag("--json", shown.json, "a JSON object a line instead of sentences");
  app.add_option("--session", program.session, "its name; the first one announced when left out");
  app.add_option("--domain", program.domain, "DDS domain")->capture_default_str();
  app.add_option("--person", program.person, "the name others see")->capture_default_str();
  app.add_option("--language", shown.language, "of titles and instructions")->capture_default_str();
  app.add_option("--wait", wait, "seconds to look for a server")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  program.patience = std::chrono::seconds(wait);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  tenon::Observer observer(shown);
  if (const auto ended = tenon::observe(observer, program, stop); !ended) {
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
