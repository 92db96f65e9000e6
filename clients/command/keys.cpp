#include <cstdio>
#include <optional>
#include <utility>

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "clients/command/command_program.h"

namespace tenon::command {

namespace {

/// Puts the terminal into unbuffered input without echo, and restores it in the end. Standard input that is
/// no terminal is not changed.
class KeyTerminal {
 public:
  KeyTerminal() {
    is_terminal_ = tcgetattr(STDIN_FILENO, &before_) == 0;
    if (!is_terminal_) return;
    termios raw = before_;
    raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  }
  ~KeyTerminal() {
    if (is_terminal_) tcsetattr(STDIN_FILENO, TCSANOW, &before_);
  }
  KeyTerminal(const KeyTerminal&) = delete;
  KeyTerminal& operator=(const KeyTerminal&) = delete;

 private:
  termios before_{};
  bool is_terminal_ = false;
};

enum class KeyInput { kNone, kKey, kEnd };

KeyInput readKey(char& key) {
  pollfd entry{STDIN_FILENO, POLLIN, 0};
  if (poll(&entry, 1, 0) <= 0) return KeyInput::kNone;
  return read(STDIN_FILENO, &key, 1) == 1 ? KeyInput::kKey : KeyInput::kEnd;
}

void show(const std::string& line) {
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

std::string nameOf(const ParsedCommand& command) {
  for (const CommandWord& word : commandWords())
    if (word.command == command.command)
      return std::string(word.word) + (command.text.empty() ? "" : " " + command.text);
  return "command";
}

}  // namespace

int commandOnce(CommandClient& client, const std::vector<std::string>& arguments,
                const std::atomic<bool>& stop) {
  const auto command = parseCommand(arguments);
  const Result<void> sent = command ? client.send(*command, stop) : fail(command.error().what);
  if (sent) {
    show(nameOf(*command) + ": accepted");
    return 0;
  }
  std::fprintf(stderr, "tenon command: %s\n", sent.error().what.c_str());
  return 1;
}

int commandByKeys(CommandClient& client, const std::vector<std::string>& signals,
                  const std::atomic<bool>& stop) {
  const KeyTerminal terminal;
  show(keyLegend(signals));
  client.report = show;
  std::optional<ParsedCommand> asked;
  bool said_lost = false;
  while (!stop && !client.isOver()) {
    client.dispatch(std::chrono::milliseconds(20));
    if (client.lost() && !std::exchange(said_lost, true))
      show(*client.lost() + "; space still stops every device, q leaves");
    char key = 0;
    const KeyInput input = readKey(key);
    if (input == KeyInput::kNone) continue;
    if (input == KeyInput::kEnd || key == 'q') return 0;
    if (key == '?') show(keyLegend(signals));
    auto command = key == 'y' ? std::exchange(asked, std::nullopt) : parseCommand(key, signals);
    const bool asks = key != 'y' && command && needsConsent(*command);
    asked = asks ? command : std::nullopt;
    if (asks) show(nameOf(*command) + ": press y to do it, any other key not to");
    if (!command || asks) continue;
    const auto sent = client.send(*command, stop);
    show(nameOf(*command) + ": " + (sent ? "accepted" : sent.error().what));
  }
  return 0;
}

}  // namespace tenon::command
