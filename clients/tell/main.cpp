#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "clients/tell/tell_program.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

struct Arguments {
  tenon::MembershipWishes wishes{.role = tenon::Role::kInstructor};
  std::vector<std::string> said;
  std::vector<std::string> signals;
  bool keys = false;
};

void declare(CLI::App& app, Arguments& arguments) {
  const std::vector<std::pair<std::string, tenon::Role>> roles{{"admin", tenon::Role::kAdmin},
                                                               {"instructor", tenon::Role::kInstructor},
                                                               {"trainee", tenon::Role::kTrainee}};
  app.add_option("words", arguments.said, "what to tell: see below");
  app.add_flag("--keys", arguments.keys, "a key is a command, until q: for a person who runs the session");
  app.add_option("--signal", arguments.signals, "with --keys: the signal of key 1, of key 2, ...");
  app.add_option("--role", arguments.wishes.role, "admin, instructor or trainee (default: instructor)")
      ->transform(CLI::CheckedTransformer(roles))
      ->option_text("ROLE");
  app.add_option("--session", arguments.wishes.session, "its name; the first one announced when left out");
  app.add_option("--domain", arguments.wishes.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  app.add_option("--person", arguments.wishes.person, "the name others see")->capture_default_str();
  app.add_option_function<unsigned>(
         "--wait",
         [&arguments](unsigned seconds) { arguments.wishes.patience = std::chrono::seconds(seconds); },
         "seconds to look for a server")
      ->default_str("10");
  app.footer(tenon::wordsHelp());
}

int run(int argc, char** argv) {
  CLI::App app("Tells a running session what to do.", "tenon tell");
  Arguments arguments;
  arguments.wishes.person = "somebody at a shell";
  declare(app, arguments);
  CLI11_PARSE(app, argc, argv);
  const auto complain = [](const std::string& what) {
    std::fprintf(stderr, "tenon tell: %s\n", what.c_str());
    return 1;
  };
  if (!arguments.keys)
    if (const auto saying = tenon::sayingOf(arguments.said); !saying) return complain(saying.error().what);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  auto teller = tenon::Teller::open(arguments.wishes, stop);
  if (!teller) return complain(teller.error().what);
  return arguments.keys ? tenon::tellByKeys(**teller, arguments.signals, stop)
                        : tenon::tellOnce(**teller, arguments.said, stop);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon tell: %s\n", problem.what());
    return 1;
  }
}
