#include <chrono>
#include <cstdio>
#include <deque>
#include <optional>
#include <thread>
#include <utility>

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "clients/command/command_program.h"
#include "clients/command/stop_raiser.h"
#include "idl/types/printable_text.h"

namespace tenon::command {

namespace {

using std::chrono::milliseconds;
constexpr milliseconds kPause{20};           // between looks at the keys
constexpr milliseconds kSoon{1000};          // for a server to repeat an emergency stop
constexpr milliseconds kBetweenRaises{100};  // of a space bar that is held down
constexpr milliseconds kBetweenTries{1000};  // to join again
constexpr std::size_t kMostKeys = 256;       // that wait
constexpr char kEmergencyKey = ' ';
constexpr char kLeaveKey = 'q';
constexpr const char* kWhatIsLeft = "space still stops every device, q leaves";

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
      return std::string(word.word) + (command.text.empty() ? "" : " " + printable(command.text));
  return "command";
}

/// A person at the keys. The space bar acts whenever it is pressed, also while a server is searched for or an
/// answer is awaited; other keys act one after the other. What was pressed before the space bar and has not
/// been sent is not sent any more, so that nothing clears the stop that came after it.
class KeyDesk {
 public:
  KeyDesk(const wire::MembershipOptions& options, const std::vector<std::string>& signals,
          const std::atomic<bool>& stop)
      : options_(options), signals_(signals), stop_(stop) {}

  int run(const Result<void>& why_not) {
    const KeyTerminal terminal;
    show(keyLegend(signals_));
    auto raiser = StopRaiser::open(options_.domain, options_.session, options_.person);
    if (!raiser) return report(raiser.error().what);
    raiser_ = std::move(*raiser);
    why_not ? join() : stayOutside(why_not.error().what);
    while (!ended_ && !(client_ && client_->isOver())) {
      if (client_ && client_->lost() && !is_outside_) comeBack();
      if (!keys_.empty()) {
        const Pressed pressed = std::move(keys_.front());
        keys_.pop_front();
        act(pressed);
        continue;
      }
      client_ ? client_->dispatch(kPause) : std::this_thread::sleep_for(kPause);
      listen();
    }
    while (!raised_.empty()) {
      raiser_->dispatch(kPause);
      tellOfRaises();
    }
    return client_ ? 0 : 1;
  }

 private:
  struct Pressed {
    char key = 0;
    std::uint32_t newest_raise = 0;  ///< of the emergency stop, that was told by then
  };

  static int report(const std::string& what) {
    std::fprintf(stderr, "tenon command: %s\n", what.c_str());
    return 1;
  }

  /// Reads the keys that were pressed; of these the emergency stop acts at once.
  void listen() {
    if (stop_) end();
    for (std::size_t read = 0; read < kMostKeys && !is_input_over_ && !ended_; ++read) {
      char key = 0;
      const KeyInput input = readKey(key);
      if (input == KeyInput::kNone) break;
      is_input_over_ = input == KeyInput::kEnd;
      if (is_input_over_) key = kLeaveKey;
      // what was pressed before it is done first, once there is a session
      const bool is_first = !client_ && keys_.empty() && !is_input_over_;
      if (key == kLeaveKey && (is_coming_back_ || is_first)) end();
      if (key == kEmergencyKey) {
        raise();
        is_interrupted_ = true;
        dropKeys("the emergency stop came after it");
        continue;
      }
      if (!is_coming_back_ && (keys_.size() < kMostKeys || is_input_over_))
        keys_.push_back({key, client_ ? client_->toldRaise() : 0});
      else if (parseCommand(key, signals_))
        show(is_coming_back_ ? "not sent: the server is gone" : "not sent: too many keys wait");
    }
    raiser_->dispatch(milliseconds(0));
    tellOfRaises();
  }

  void end() { ended_ = is_interrupted_ = true; }

  /// Keys that wait are not sent, but to leave is still done.
  void dropKeys(const std::string& why) {
    if (asked_) show(nameOf(*std::exchange(asked_, std::nullopt)) + ": not done: " + why);
    std::erase_if(keys_, [&](const Pressed& pressed) {
      if (const auto command = parseCommand(pressed.key, signals_))
        show(nameOf(*command) + ": not sent: " + why);
      return pressed.key != kLeaveKey;
    });
  }

  void raise() {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_raise_) return;
    next_raise_ = now + kBetweenRaises;
    const auto raised = raiser_->write("requested");
    raised ? raised_.push_back(*raised) : show("emergency: " + raised.error().what);
  }

  void tellOfRaises() {
    std::erase_if(raised_, [this](std::uint32_t raise) {
      auto heard = raiser_->heard(raise, kSoon);
      if (!heard) return false;
      heard->acknowledged = heard->isConfirmed() || raiser_->isAcknowledged();
      const auto outcome = outcomeOf(*heard, options_.domain, options_.session);
      show("emergency: " + (outcome ? *outcome : outcome.error().what));
      return true;
    });
  }

  void join() {
    auto client = CommandClient::open(options_, ended_, [this] { listen(); });
    if (!client && !ended_) stayOutside(client.error().what);
    if (!client) return;
    client_ = std::move(*client);
    client_->report = client_->report_raise = show;
    // a raise that stands is repeated by who has raised it, of all sessions before one was known
    const bool has_raised = next_raise_ != std::chrono::steady_clock::time_point{};
    if (!options_.session.empty() || has_raised) return;
    options_.session = client_->sessionName();
    if (auto own = StopRaiser::open(options_.domain, options_.session, options_.person); own)
      raiser_ = std::move(*own);
  }

  /// Without a seat, for good.
  void stayOutside(const std::string& why) {
    is_outside_ = true;
    why_outside_ = why;
    report(why);
    std::string left = "the emergency stop alone can be raised from here, which needs no key: ";
    show(left += kWhatIsLeft);
  }

  void comeBack() {
    const std::string lost = *client_->lost();
    if (!client_->serverIsGone()) return stayOutside(lost);
    show(lost + "; waiting for one that resumes the session, " + kWhatIsLeft);
    is_coming_back_ = true;
    dropKeys("the server is gone");
    std::string said;
    while (!ended_) {
      const auto back = client_->rejoin(ended_);
      if (back) {
        show("joined session '" + client_->sessionName() + "' again: keys are sent to it");
        break;
      }
      if (!ended_ && back.error().what != std::exchange(said, back.error().what)) show(back.error().what);
      const auto next = std::chrono::steady_clock::now() + kBetweenTries;
      while (!ended_ && std::chrono::steady_clock::now() < next) {
        std::this_thread::sleep_for(kPause);
        listen();
      }
    }
    is_coming_back_ = false;
  }

  /// The server has given the seat away, as after a silence that it alone has noticed.
  void joinAgain() {
    show("the server knows this seat no more; joining again, " + std::string(kWhatIsLeft));
    dropKeys("it was pressed before");
    client_.reset();
    join();
    if (client_) show("joined session '" + client_->sessionName() + "' again: press the key again");
  }

  void act(const Pressed& pressed) {
    const char key = pressed.key;
    if (key == kLeaveKey) return end();
    if (key == '?') show(keyLegend(signals_));
    auto command = key == 'y' ? std::exchange(asked_, std::nullopt) : parseCommand(key, signals_);
    const bool asks = key != 'y' && command && needsConsent(*command);
    asked_ = asks ? command : std::nullopt;
    if (asks) show(nameOf(*command) + ": press y to do it, any other key not to");
    if (!command || asks) return;
    if (command->command == CommandKind::kClearEmergencyStop) command->value = pressed.newest_raise;
    is_interrupted_ = ended_.load();
    const auto sent =
        is_outside_ ? fail("not sent: " + why_outside_) : client_->send(*command, is_interrupted_);
    show(nameOf(*command) + ": " + (sent ? "accepted" : sent.error().what));
    if (!is_outside_ && client_->refusal() == Refusal::kNotJoined && !client_->lost()) joinAgain();
  }

  wire::MembershipOptions options_;
  const std::vector<std::string>& signals_;
  const std::atomic<bool>& stop_;
  std::atomic<bool> ended_{false};           ///< by a key or `stop_`
  std::atomic<bool> is_interrupted_{false};  ///< likewise, or by the space bar: no answer is awaited
  std::unique_ptr<StopRaiser> raiser_;
  std::unique_ptr<CommandClient> client_;
  std::deque<Pressed> keys_;            ///< and not acted upon
  std::optional<ParsedCommand> asked_;  ///< waits for `y`
  std::vector<std::uint32_t> raised_;   ///< raises of which it is not told yet who has heard them
  std::chrono::steady_clock::time_point next_raise_;
  bool is_input_over_ = false;
  bool is_coming_back_ = false;
  bool is_outside_ = false;
  std::string why_outside_;
};

}  // namespace

int commandOnce(CommandClient& client, const std::vector<std::string>& arguments,
                const std::atomic<bool>& stop) {
  const auto command = parseCommand(arguments);
  const bool is_clear = command && command->command == CommandKind::kClearEmergencyStop;
  // what was not shown before is shown beside what becomes of it
  if (is_clear) client.report_raise = show;
  const Result<void> sent = command ? client.send(*command, stop) : fail(command.error().what);
  if (sent) {
    show(nameOf(*command) + ": accepted");
    return 0;
  }
  // of signals, which no list has, the server names those there are
  const bool is_listed =
      command && client.refusal() == Refusal::kUnknownName && command->command != CommandKind::kSignal;
  std::fprintf(stderr, "tenon command: %s%s\n", sent.error().what.c_str(),
               is_listed ? "; `tenon command list` prints all names" : "");
  return 1;
}

int commandByKeys(const wire::MembershipOptions& options, const std::vector<std::string>& signals,
                  const Result<void>& why_not, const std::atomic<bool>& stop) {
  return KeyDesk(options, signals, stop).run(why_not);
}

}  // namespace tenon::command
