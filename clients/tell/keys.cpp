#include <cstdio>

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "clients/tell/tell_program.h"

namespace tenon {

namespace {

/// A terminal that gives each key at once and does not echo it; what it was before, at the end. Input that
/// is no terminal stays as it is.
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

enum class Input { kNothing, kKey, kEnd };

Input readKey(char& key) {
  pollfd entry{STDIN_FILENO, POLLIN, 0};
  if (poll(&entry, 1, 0) <= 0) return Input::kNothing;
  return read(STDIN_FILENO, &key, 1) == 1 ? Input::kKey : Input::kEnd;
}

void show(const std::string& line) {
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

std::string nameOf(const Saying& saying) {
  for (const Word& word : words())
    if (word.command == saying.command)
      return std::string(word.word) + (saying.text.empty() ? "" : " " + saying.text);
  return "this";
}

}  // namespace

int tellOnce(Teller& teller, const std::vector<std::string>& said, const std::atomic<bool>& stop) {
  const auto saying = sayingOf(said);
  const Result<void> told = saying ? teller.tell(*saying, stop) : fail(saying.error().what);
  if (told) {
    show(nameOf(*saying) + ": accepted");
    return 0;
  }
  std::fprintf(stderr, "tenon tell: %s\n", told.error().what.c_str());
  return 1;
}

int tellByKeys(Teller& teller, const std::vector<std::string>& signals, const std::atomic<bool>& stop) {
  const KeyTerminal terminal;
  show(keysLegend(signals));
  teller.say = show;
  while (!stop) {
    if (!teller.listen(std::chrono::milliseconds(20))) return 0;
    char key = 0;
    const Input input = readKey(key);
    if (input == Input::kNothing) continue;
    if (input == Input::kEnd || key == 'q') return 0;
    if (key == '?') show(keysLegend(signals));
    const auto saying = sayingOf(key, signals);
    if (!saying) continue;
    const auto told = teller.tell(*saying, stop);
    show(nameOf(*saying) + ": " + (told ? "accepted" : told.error().what));
  }
  return 0;
}

}  // namespace tenon
