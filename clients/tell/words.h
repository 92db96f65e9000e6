#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/messages.h"
#include "idl/types/result.h"

namespace tenon {

/// What a person can tell a session, with the word for a shell and the key at a terminal.
struct Word {
  std::string_view word;
  std::string_view arguments;          ///< as a usage line shows them
  std::string_view what;               ///< it does
  char key = 0;                        ///< 0: needs arguments, no key
  std::optional<CommandKind> command;  ///< none: an emergency stop, which goes to everybody directly
};

/// All of them, in the order in which help shows them.
[[nodiscard]] std::span<const Word> words();

/// One thing to be told.
struct Saying {
  std::optional<CommandKind> command;  ///< none: an emergency stop
  std::string text;
  double value = 0.0;
};

/// Of the words of a command line, as in {"signal", "bell"}. Fails with a sentence.
[[nodiscard]] Result<Saying> sayingOf(const std::vector<std::string>& said);

/// Of a key; '1' to '9' are the given signals. None when the key says nothing.
[[nodiscard]] std::optional<Saying> sayingOf(char key, const std::vector<std::string>& signals);

/// For --help: every word with what it does.
[[nodiscard]] std::string wordsHelp();
/// For a terminal: every key with what it does.
[[nodiscard]] std::string keysLegend(const std::vector<std::string>& signals);

}  // namespace tenon
