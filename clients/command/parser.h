#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/messages/commands.h"
#include "idl/types/result.h"

namespace tenon::command {

/// A command of `tenon command`: its word on the command line and its key with --keys.
struct CommandWord {
  std::string_view word;
  /// As in a usage line; in brackets: optional, any number of words; with dots: one or more words.
  std::string_view arguments;
  std::string_view effect;             ///< for --help
  char key = 0;                        ///< 0: no key, as it needs arguments
  std::optional<CommandKind> command;  ///< none: emergency stop, which is a topic of its own
};

/// All commands, in the order in which help lists them.
[[nodiscard]] std::span<const CommandWord> commandWords();

/// A command with its arguments.
struct ParsedCommand {
  std::optional<CommandKind> command;  ///< none: emergency stop
  std::string text;                    ///< name or reason; of `collision` both objects, separated by a space
  /// [-] of `collision`: 1 on, 0 off; of `clear`: NewestRaise::number, of which who gives it was told; none:
  /// of what is heard when it is sent.
  std::optional<double> value;
};

/// Parses the words of a command line, as in {"signal", "bell"}. Fails with a sentence that has the usage.
[[nodiscard]] Result<ParsedCommand> parseCommand(const std::vector<std::string>& arguments);

/// Parses a key; '1' to '9' send `signals[0]` to `signals[8]`. None when the key has no command.
[[nodiscard]] std::optional<ParsedCommand> parseCommand(char key, const std::vector<std::string>& signals);

/// Whether a key alone must not give this command: it ends the run, starts it or a step again, or
/// may end it (skip, in the last step).
[[nodiscard]] bool needsConsent(const ParsedCommand& command);

/// For --help: every command with its effect.
[[nodiscard]] std::string commandHelp();
/// For a terminal: every key with its effect.
[[nodiscard]] std::string keyLegend(const std::vector<std::string>& signals);

}  // namespace tenon::command
