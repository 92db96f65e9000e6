#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "clients/command/command_program.h"
#include "clients/command/session_lists.h"
#include "idl/types/printable_text.h"
#include "idl/wire/joining_names.h"
#include "idl/wire/key_option.h"
#include "idl/wire/network.h"
#include "idl/wire/session_name.h"

namespace {

std::atomic<bool> stop{false};
void onSignal(int /*signal*/) { stop = true; }

struct CommandArguments {
  tenon::wire::MembershipOptions options{.role = tenon::Role::kInstructor};
  std::vector<std::string> words;
  std::vector<std::string> signals;
  std::optional<std::chrono::seconds> wait;  ///< none: not given
  bool keys = false;
};

void declare(CLI::App& app, CommandArguments& arguments) {
  static const std::map<std::string, tenon::Role> kRoles{{"admin", tenon::Role::kAdmin},
                                                         {"instructor", tenon::Role::kInstructor},
                                                         {"trainee", tenon::Role::kTrainee}};
  app.add_option("words", arguments.words, "a command and its arguments, see below");
  app.add_flag("--keys", arguments.keys, "interactive: each key sends a command, until q");
  app.add_option("--signal", arguments.signals, "with --keys: the signals that keys 1, 2, ... send");
  app.add_option_function<std::string>(
         "--role", [&arguments](const std::string& word) { arguments.options.role = kRoles.at(word); },
         "admin, instructor or trainee (default: instructor)")
      ->check(CLI::IsMember(kRoles))
      ->option_text("ROLE");
  // an empty name is no name: an emergency stop is not refused for it
  app.add_option("--session", arguments.options.session,
                 "name of the session; default: the first one announced, of the emergency stop all sessions")
      ->check([](const std::string& text) {
        const auto permitted = tenon::wire::checkSessionName(text);
        return text.empty() || permitted ? std::string() : permitted.error().what;
      });
  // likewise of no file
  app.add_option("--key", arguments.options.key_file,
                 "file of the session's key, which instructors and admins need (default: the one of your own "
                 "servers)");
  app.add_option("--domain", arguments.options.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  tenon::wire::addNetworkOption(app);
  app.add_option("--person", arguments.options.person, "name shown to the other participants")
      ->capture_default_str();
  app.add_option_function<unsigned>(
         "--wait",
         [&arguments](unsigned seconds) {
           arguments.options.timeout = *(arguments.wait = std::chrono::seconds(seconds));
         },
         "seconds to search for a server; of an emergency stop, for which it is repeated at most, 3 or more "
         "(default of that: until it is confirmed, without a terminal 30; 10 where nobody is found)")
      ->default_str("10");
  app.footer(tenon::command::commandHelp());
}

int report(const std::string& what, int exit_code = 1) {
  std::fprintf(stderr, "tenon command: %s\n", what.c_str());
  return exit_code;
}

int printLists(const CommandArguments& arguments) {
  const auto lists = tenon::command::readLists(arguments.options, stop);
  if (!lists) return report(lists.error().what);
  std::fputs(lists->text().c_str(), stdout);
  return 0;
}

/// Of an emergency stop: a person at a terminal ends it with Ctrl-C, a script continues after some time.
tenon::command::RaisePatience raisePatience(const CommandArguments& arguments) {
  constexpr std::chrono::seconds kLeast{3};
  constexpr std::chrono::seconds kOfAScript{30};
  tenon::command::RaisePatience patience;
  if (arguments.wait) {
    patience.to_find = std::max(kLeast, *arguments.wait);
    patience.in_all = patience.to_find;
  } else if (isatty(STDERR_FILENO) == 0) {
    patience.in_all = kOfAScript;
  }
  return patience;
}

int run(int argc, char** argv) {
  CLI::App app("Sends commands to a running session.", "tenon command");
  CommandArguments arguments;
  arguments.options.person = "command line";
  declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const bool lists = !arguments.words.empty() && arguments.words[0] == "list" && !arguments.keys;
  if (lists && arguments.words.size() > 1)
    return report("usage: list, without '" + tenon::shortened(tenon::printable(arguments.words[1]), 60) +
                      "': it prints people, hands, steps and objects",
                  2);
  if (arguments.keys && !arguments.words.empty())
    return report("--keys takes no command: each key sends one", 2);
  if (!arguments.keys && !lists) {
    const auto parsed = tenon::command::parseCommand(arguments.words);
    if (!parsed) return report(parsed.error().what, 2);
    if (!parsed->command)
      return tenon::command::emergencyOnce(arguments.options, *parsed, raisePatience(arguments), stop);
  }
  const std::filesystem::path& key_file = arguments.options.key_file;
  if (app.count("--key") > 0 && key_file.empty()) return report("--key: names no file", 2);
  if (app.count("--session") > 0 && arguments.options.session.empty())
    return report("--session: names no session", 2);
  if (const auto named = tenon::wire::checkPersonName(arguments.options.person); !named)
    return report("--person: " + named.error().what, 2);
  for (const std::string& signal : arguments.signals)
    if (const auto parsed = tenon::command::parseCommand({"signal", signal}); !parsed)
      return report("--signal: " + parsed.error().what, 2);
  const auto key = tenon::wire::checkKeyOption(key_file);
  if (arguments.keys) return tenon::command::commandByKeys(arguments.options, arguments.signals, key, stop);
  if (!key) return report(key.error().what);
  if (lists) return printLists(arguments);
  auto client = tenon::command::CommandClient::open(arguments.options, stop);
  if (!client) return report(client.error().what);
  return tenon::command::commandOnce(**client, arguments.words, stop);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon command: %s\n", problem.what());
    return 1;
  }
}
