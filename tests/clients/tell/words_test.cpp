#include "clients/tell/words.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tenon {
namespace {

using ::testing::HasSubstr;

TEST(Words, EveryCommandOfTheProtocolHasOne) {
  std::set<CommandKind> said;
  for (const Word& word : words())
    if (word.command) said.insert(*word.command);
  for (std::uint32_t i = 0; i <= static_cast<std::uint32_t>(CommandKind::kClearEmergencyStop); ++i)
    EXPECT_TRUE(said.contains(static_cast<CommandKind>(i))) << "command " << i;
}

TEST(Words, NoTwoShareAWordOrAKey) {
  std::set<std::string_view> spoken;
  std::set<char> keys{'q', '?'};
  for (const Word& word : words()) {
    EXPECT_TRUE(spoken.insert(word.word).second) << word.word;
    EXPECT_TRUE(word.key == 0 || keys.insert(word.key).second) << word.word;
  }
}

TEST(Words, ACommandLineBecomesACommand) {
  EXPECT_EQ(sayingOf({"pause"})->command, CommandKind::kPause);
  const auto signal = sayingOf({"signal", "bell"});
  ASSERT_TRUE(signal);
  EXPECT_EQ(signal->command, CommandKind::kSignal);
  EXPECT_EQ(signal->text, "bell");
  const auto off = sayingOf({"collision", "grid", "bay", "off"});
  ASSERT_TRUE(off);
  EXPECT_EQ(off->text, "grid bay");
  EXPECT_EQ(off->value, 0.0);
  EXPECT_EQ(sayingOf({"collision", "grid", "bay", "on"})->value, 1.0);
  const auto emergency = sayingOf({"emergency", "hand", "caught"});
  ASSERT_TRUE(emergency);
  EXPECT_FALSE(emergency->command) << "goes to the devices directly";
  EXPECT_EQ(emergency->text, "hand caught");
}

TEST(Words, WhatIsMissingOrTooMuchIsSaidWithTheUsage) {
  EXPECT_THAT(sayingOf({}).error().what, HasSubstr("tenon tell pause"));
  EXPECT_THAT(sayingOf({"fly"}).error().what, HasSubstr("no word 'fly'"));
  EXPECT_THAT(sayingOf({"signal"}).error().what, HasSubstr("signal NAME"));
  EXPECT_THAT(sayingOf({"pause", "now"}).error().what, HasSubstr("say: pause"));
  EXPECT_THAT(sayingOf({"collision", "a", "b", "maybe"}).error().what, HasSubstr("on|off"));
}

TEST(Words, AKeyIsACommandAndADigitASignal) {
  EXPECT_EQ(sayingOf('p', {})->command, CommandKind::kPause);
  EXPECT_FALSE(sayingOf(' ', {})->command) << "the largest key stops everything";
  EXPECT_EQ(sayingOf('2', {"bell", "door"})->text, "door");
  EXPECT_FALSE(sayingOf('3', {"bell", "door"}));
  EXPECT_FALSE(sayingOf('x', {}));
}

TEST(Words, HelpAndLegendTellThemAll) {
  for (const Word& word : words()) {
    EXPECT_THAT(wordsHelp(), HasSubstr(std::string(word.what)));
    if (word.key == 0) continue;
    EXPECT_THAT(keysLegend({"bell"}), HasSubstr(std::string(word.what)));
  }
  EXPECT_THAT(keysLegend({"bell"}), HasSubstr("bell"));
}

}  // namespace
}  // namespace tenon
