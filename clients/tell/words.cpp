#include "clients/tell/words.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace tenon {

namespace {

constexpr std::array kWords{
    Word{"pause", "", "everything stands still", 'p', CommandKind::kPause},
    Word{"resume", "", "goes on after a pause", 'r', CommandKind::kResume},
    Word{"fulfilled", "", "the condition that waits for a person's word is met", 'f',
         CommandKind::kFulfilled},
    Word{"signal", "NAME", "an external signal that the scenario waits for", 0, CommandKind::kSignal},
    Word{"skip", "", "to the next step", 'n', CommandKind::kSkipStep},
    Word{"reset", "", "the exercise begins again", 'b', CommandKind::kReset},
    Word{"swap", "", "the trainee's two hands change what they move", 'w', CommandKind::kSwapHands},
    Word{"release", "HAND", "that hand lets go of what it holds", 0, CommandKind::kRelease},
    Word{"collision", "OBJECT OBJECT on|off", "whether these two touch each other", 0,
         CommandKind::kSetCollision},
    Word{"stop", "", "ends the run", 'e', CommandKind::kStop},
    Word{"emergency", "[REASON]", "emergency stop: all devices stop pushing, at once", ' ', std::nullopt},
    Word{"clear", "[REASON]", "clears an emergency stop", 'c', CommandKind::kClearEmergencyStop},
};

std::string joined(const std::vector<std::string>& words, std::size_t from) {
  std::string text;
  for (std::size_t i = from; i < words.size(); ++i) text += (i > from ? " " : "") + words[i];
  return text;
}

Result<Saying> withArguments(const Word& word, const std::vector<std::string>& said) {
  const std::size_t given = said.size() - 1;
  const auto usage = [&] { return fail(fmt::format("say: {} {}", word.word, word.arguments)); };
  if (word.arguments.starts_with('[')) return Saying{word.command, joined(said, 1)};
  if (word.command == CommandKind::kSetCollision) {
    if (given != 3 || (said[3] != "on" && said[3] != "off")) return usage();
    return Saying{word.command, said[1] + " " + said[2], said[3] == "on" ? 1.0 : 0.0};
  }
  if (given != (word.arguments.empty() ? 0U : 1U)) return usage();
  return Saying{word.command, joined(said, 1)};
}

}  // namespace

std::span<const Word> words() { return kWords; }

Result<Saying> sayingOf(const std::vector<std::string>& said) {
  if (said.empty()) return fail("say what to tell, as in: tenon tell pause");
  const auto* const word = std::find_if(kWords.begin(), kWords.end(),
                                        [&](const Word& candidate) { return candidate.word == said[0]; });
  if (word == kWords.end())
    return fail(fmt::format("there is no word '{}': tenon tell --help lists them", said[0]));
  return withArguments(*word, said);
}

std::optional<Saying> sayingOf(char key, const std::vector<std::string>& signals) {
  if (key >= '1' && key <= '9') {
    const auto number = static_cast<std::size_t>(key - '1');
    if (number >= signals.size()) return std::nullopt;
    return Saying{CommandKind::kSignal, signals[number]};
  }
  for (const Word& word : kWords)
    if (word.key != 0 && word.key == key) return Saying{word.command, {}};
  return std::nullopt;
}

std::string wordsHelp() {
  std::string help = "Words:\n";
  for (const Word& word : kWords)
    help += fmt::format("  {:<32}{}\n", fmt::format("{} {}", word.word, word.arguments), word.what);
  return help +
         "\nThe server checks whether the role may say it. Exit code: 0 when it was accepted, 1 when it was\n"
         "refused or nobody answered.";
}

std::string keysLegend(const std::vector<std::string>& signals) {
  std::string legend;
  for (const Word& word : kWords) {
    if (word.key == 0) continue;
    const std::string key = word.key == ' ' ? "space" : std::string(1, word.key);
    legend += fmt::format("  {:<6} {:<10} {}\n", key, word.word, word.what);
  }
  for (std::size_t i = 0; i < signals.size() && i < 9; ++i)
    legend += fmt::format("  {:<6} {:<10} {}\n", i + 1, "signal", signals[i]);
  return legend + "  ?      these keys\n  q      leaves; the session goes on\n";
}

}  // namespace tenon
