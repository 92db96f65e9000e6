#include "clients/command/parser.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/names.h"

namespace tenon::command {
namespace {

using ::testing::HasSubstr;

TEST(CommandParser, EveryCommandKindHasAWord) {
  std::set<CommandKind> kinds;
  for (const CommandWord& word : commandWords())
    if (word.command) kinds.insert(*word.command);
  for (std::uint32_t i = 0; i <= static_cast<std::uint32_t>(CommandKind::kKick); ++i)
    EXPECT_TRUE(kinds.contains(static_cast<CommandKind>(i))) << "command " << i;
}

TEST(CommandParser, WordsAreThoseOfTheProtocol) {
  for (const CommandWord& word : commandWords()) {
    if (!word.command) continue;
    EXPECT_EQ(word.word, commandName(*word.command));
  }
}

TEST(CommandParser, WordsAndKeysAreUnique) {
  std::set<std::string_view> names;
  std::set<char> keys{'q', '?'};
  for (const CommandWord& word : commandWords()) {
    EXPECT_TRUE(names.insert(word.word).second) << word.word;
    EXPECT_TRUE(word.key == 0 || keys.insert(word.key).second) << word.word;
  }
}

TEST(CommandParser, ParsesACommandLine) {
  EXPECT_EQ(parseCommand({"pause"})->command, CommandKind::kPause);
  const auto signal = parseCommand({"signal", "bell"});
  ASSERT_TRUE(signal);
  EXPECT_EQ(signal->command, CommandKind::kSignal);
  EXPECT_EQ(signal->text, "bell");
  const auto off = parseCommand({"collision", "grid", "bay", "off"});
  ASSERT_TRUE(off);
  EXPECT_EQ(off->text, "grid bay");
  EXPECT_EQ(off->value, 0.0);
  EXPECT_EQ(parseCommand({"collision", "grid", "bay", "on"})->value, 1.0);
  EXPECT_EQ(parseCommand({"goto", "3"})->text, "3");
  EXPECT_EQ(parseCommand({"give", "box", "left"})->text, "box left");
  EXPECT_EQ(parseCommand({"freeze", "on"})->value, 1.0);
  EXPECT_EQ(parseCommand({"freeze", "off"})->value, 0.0);
  EXPECT_THAT(parseCommand({"freeze", "maybe"}).error().what, HasSubstr("usage: freeze on|off"));
  EXPECT_EQ(parseCommand({"kick", "Ada", "Lovelace"})->text, "Ada Lovelace");
  EXPECT_EQ(parseCommand({"note", "grip", "too", "high"})->text, "grip too high");
  const auto emergency = parseCommand({"emergency", "hand", "caught"});
  ASSERT_TRUE(emergency);
  EXPECT_FALSE(emergency->command) << "an emergency stop is not a Command";
  EXPECT_EQ(emergency->text, "hand caught");
}

TEST(CommandParser, WrongArgumentsFailWithTheUsage) {
  EXPECT_THAT(parseCommand({}).error().what, HasSubstr("tenon command pause"));
  EXPECT_THAT(parseCommand({"fly"}).error().what, HasSubstr("unknown command 'fly'"));
  EXPECT_THAT(parseCommand({"signal"}).error().what, HasSubstr("signal NAME"));
  EXPECT_THAT(parseCommand({"note"}).error().what, HasSubstr("note TEXT..."));
  EXPECT_THAT(parseCommand({"give", "box"}).error().what, HasSubstr("give OBJECT HAND"));
  EXPECT_THAT(parseCommand({"pause", "now"}).error().what, HasSubstr("usage: pause"));
  EXPECT_THAT(parseCommand({"collision", "a", "b", "maybe"}).error().what, HasSubstr("on|off"));
}

TEST(CommandParser, ParsesKeysAndDigitsAsSignals) {
  EXPECT_EQ(parseCommand('p', {})->command, CommandKind::kPause);
  EXPECT_FALSE(parseCommand(' ', {})->command) << "space bar: emergency stop";
  EXPECT_EQ(parseCommand('2', {"bell", "door"})->text, "door");
  EXPECT_FALSE(parseCommand('3', {"bell", "door"}));
  EXPECT_FALSE(parseCommand('x', {}));
}

TEST(CommandParser, HelpAndLegendListAllCommands) {
  for (const CommandWord& word : commandWords()) {
    EXPECT_THAT(commandHelp(), HasSubstr(std::string(word.effect)));
    if (word.key == 0) continue;
    EXPECT_THAT(keyLegend({"bell"}), HasSubstr(std::string(word.effect)));
  }
  EXPECT_THAT(keyLegend({"bell"}), HasSubstr("bell"));
}

TEST(CommandParser, TextsThatAreTooLongAreRefusedButAnEmergencyStopIsNever) {
  const std::string much(300, 'x');
  for (const char* word : {"signal", "goto", "clear", "note"})
    EXPECT_FALSE(parseCommand({word, much})) << word;
  EXPECT_TRUE(parseCommand({"emergency", much}));
}

}  // namespace
}  // namespace tenon::command
