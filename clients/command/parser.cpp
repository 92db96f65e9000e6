#include "clients/command/parser.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "idl/types/printable_text.h"

namespace tenon::command {

namespace {

constexpr std::array kCommands{
    CommandWord{"pause", "", "pauses the simulation", 'p', CommandKind::kPause},
    CommandWord{"resume", "", "resumes it", 'r', CommandKind::kResume},
    CommandWord{"fulfilled", "", "fulfils the condition that waits for confirmation by a person", 'f',
                CommandKind::kFulfilled},
    CommandWord{"signal", "NAME", "sends an external signal that the scenario waits for", 0,
                CommandKind::kSignal},
    CommandWord{"skip", "", "skips the current step", 'n', CommandKind::kSkipStep},
    CommandWord{"goto", "STEP", "goes to a step, by name or number: the scene is as at its begin", 0,
                CommandKind::kGoToStep},
    CommandWord{"back", "", "goes back to the step before", 'k', CommandKind::kBack},
    CommandWord{"repeat", "", "starts the current step again", 'a', CommandKind::kRepeatStep},
    CommandWord{"reset", "", "starts the exercise again", 'b', CommandKind::kReset},
    CommandWord{"swap", "", "swaps the objects that the trainee's two hands move", 'w',
                CommandKind::kSwapHands},
    CommandWord{"release", "HAND", "releases the object that this hand holds", 0, CommandKind::kRelease},
    CommandWord{"give", "OBJECT HAND", "lets a hand take an object where it is, from whoever holds it", 0,
                CommandKind::kHandOver},
    CommandWord{"note", "TEXT...", "leaves a note in the recording and the report", 0, CommandKind::kNote},
    CommandWord{"guide", "HOW HAND...",
                "an instructor's hand guides the trainee's HAND: show, resist, together, path; or off", 0,
                CommandKind::kGuide},
    CommandWord{"freeze", "on|off",
                "holds all hands still without a force while the steps go on, or lets them move again", 0,
                CommandKind::kFreezeForces},
    CommandWord{"kick", "NAME...",
                "removes a person from the session, by name or number; their hands are free then", 0,
                CommandKind::kKick},
    CommandWord{"collision", "OBJECT OBJECT on|off", "enables or disables collisions of two objects", 0,
                CommandKind::kSetCollision},
    CommandWord{"stop", "", "ends the session", 'e', CommandKind::kStop},
    CommandWord{"emergency", "[REASON]",
                "emergency stop: all devices display no force, at once; needs no server", ' ', std::nullopt},
    CommandWord{"clear", "[REASON]", "clears the emergency stop; the run stays paused until `resume`", 'c',
                CommandKind::kClearEmergencyStop},
};

std::string joined(const std::vector<std::string>& words, std::size_t from) {
  std::string text;
  for (std::size_t i = from; i < words.size(); ++i) text += (i > from ? " " : "") + words[i];
  return text;
}

Result<ParsedCommand> withArguments(const CommandWord& word, const std::vector<std::string>& arguments) {
  const std::size_t given = arguments.size() - 1;
  const auto usage = [&] {
    return fail(fmt::format("usage: {}{}{}", word.word, word.arguments.empty() ? "" : " ", word.arguments));
  };
  constexpr std::size_t kMaxText = 255;  // [bytes] of tenon::Command; an emergency stop is never too long
  if (const std::size_t bytes = joined(arguments, 1).size(); bytes > kMaxText && word.command)
    return fail(fmt::format("a {} has at most {} bytes, this one has {}", word.word, kMaxText, bytes));
  if (word.arguments.starts_with('[')) return ParsedCommand{word.command, joined(arguments, 1)};
  if (word.command == CommandKind::kSetCollision) {
    if (given != 3 || (arguments[3] != "on" && arguments[3] != "off")) return usage();
    return ParsedCommand{word.command, arguments[1] + " " + arguments[2], arguments[3] == "on" ? 1.0 : 0.0};
  }
  if (word.command == CommandKind::kFreezeForces) {
    if (given != 1 || (arguments[1] != "on" && arguments[1] != "off")) return usage();
    return ParsedCommand{word.command, arguments[1], arguments[1] == "on" ? 1.0 : 0.0};
  }
  if (word.arguments.ends_with("...")) {
    if (given == 0) return usage();
    return ParsedCommand{word.command, joined(arguments, 1)};
  }
  const auto spaces = static_cast<std::size_t>(std::count(word.arguments.begin(), word.arguments.end(), ' '));
  if (given != (word.arguments.empty() ? 0U : spaces + 1)) return usage();
  return ParsedCommand{word.command, joined(arguments, 1)};
}

}  // namespace

std::span<const CommandWord> commandWords() { return kCommands; }

Result<ParsedCommand> parseCommand(const std::vector<std::string>& arguments) {
  if (arguments.empty()) return fail("no command given; example: tenon command pause");
  const auto* const word =
      std::find_if(kCommands.begin(), kCommands.end(),
                   [&](const CommandWord& candidate) { return candidate.word == arguments[0]; });
  if (word == kCommands.end())
    return fail(
        fmt::format("unknown command '{}'; tenon command --help lists all", shortened(arguments[0], 40)));
  return withArguments(*word, arguments);
}

std::optional<ParsedCommand> parseCommand(char key, const std::vector<std::string>& signals) {
  if (key >= '1' && key <= '9') {
    const auto number = static_cast<std::size_t>(key - '1');
    if (number >= signals.size()) return std::nullopt;
    return ParsedCommand{CommandKind::kSignal, signals[number]};
  }
  for (const CommandWord& word : kCommands)
    if (word.key != 0 && word.key == key) return ParsedCommand{word.command, {}};
  return std::nullopt;
}

bool needsConsent(const ParsedCommand& command) {
  return command.command == CommandKind::kStop || command.command == CommandKind::kReset ||
         command.command == CommandKind::kSkipStep || command.command == CommandKind::kBack ||
         command.command == CommandKind::kRepeatStep;
}

std::string commandHelp() {
  std::string help = fmt::format("Commands:\n  {:<32}{}\n", "list",
                                 "prints people, hands, steps and objects by the names that commands take");
  for (const CommandWord& word : kCommands)
    help += fmt::format("  {:<32}{}\n", fmt::format("{} {}", word.word, word.arguments), word.effect);
  return help +
         "\nThe server checks whether the role may give the command. Exit code: 0 when it was accepted,\n"
         "1 when it was refused or not answered, 2 for wrong usage. Of an emergency stop 0 when the server\n"
         "of each announced session has confirmed it, or, where none is announced, a station has obeyed it\n"
         "and all that listen have it, else 1.";
}

std::string keyLegend(const std::vector<std::string>& signals) {
  std::string legend;
  for (const CommandWord& word : kCommands) {
    if (word.key == 0) continue;
    const std::string key = word.key == ' ' ? "space" : std::string(1, word.key);
    legend += fmt::format("  {:<6} {:<10} {}\n", key, word.word, word.effect);
  }
  for (std::size_t i = 0; i < signals.size() && i < 9; ++i)
    legend += fmt::format("  {:<6} {:<10} {}\n", i + 1, "signal", signals[i]);
  return legend + "  ?      shows these keys\n  q      leaves; the session continues\n";
}

}  // namespace tenon::command
