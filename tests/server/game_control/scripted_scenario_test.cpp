#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/game_control/scenario.h"
#include "tests/server/game_control/scenario_text.h"

namespace tenon::game_control {
namespace {

using ::testing::HasSubstr;

constexpr HandId kRight{0};
constexpr ObjectId kBay{0}, kPart{1};

Result<ScenarioFile> parsedWith(const std::string& text, const ReadOptions& options) {
  return parseScenario(text, "small/scenario.yaml", options);
}

/// The small scenario without its states: no hand moves `part`.
std::string withoutStates() {
  const std::string text = test::smallScenario();
  return text.substr(0, text.find("states:"));
}

TEST(ScriptedScenario, AnObjectThatIsTakenHasPairsAlthoughNoStateMovesIt) {
  const auto untaken = parsedWith(withoutStates(), {.needs_states = false});
  ASSERT_FALSE(untaken);
  EXPECT_THAT(untaken.error().what, HasSubstr("small/scenario.yaml:11: 'between' of a pair: "));
  EXPECT_THAT(untaken.error().what, HasSubstr("never collide"));

  const auto taken = parsedWith(withoutStates(), {.taken = {{kRight, kPart}}, .needs_states = false});
  ASSERT_TRUE(taken) << taken.error().what;
  ASSERT_GE(taken->pairOf(kPart, kBay), 0);
  EXPECT_EQ(taken->pairs[static_cast<std::size_t>(taken->pairOf(kPart, kBay))].clearance, 4e-3);
}

TEST(ScriptedScenario, AScenarioWithoutStatesHasOneThatOnlyACommandEnds) {
  EXPECT_THAT(parsedWith(withoutStates(), {.taken = {{kRight, kPart}}}).error().what, HasSubstr("'states'"))
      << "people need states";
  const auto scenario = parsedWith(withoutStates(), {.taken = {{kRight, kPart}}, .needs_states = false});
  ASSERT_TRUE(scenario) << scenario.error().what;
  ASSERT_EQ(scenario->states.size(), 1U);
  const ScenarioState& state = scenario->states[0];
  EXPECT_EQ(state.line, 0) << "it is not in the file";
  EXPECT_EQ(state.timeout, 0U);
  EXPECT_TRUE(state.hands.empty());
  ASSERT_EQ(state.conditions.size(), 2U);
  EXPECT_EQ(state.conditions[0].kind, ConditionKind::kAll);
  EXPECT_EQ(state.conditions[1].kind, ConditionKind::kFulfilled);
}

TEST(ScriptedScenario, StatesOfTheFileAreReadAndAHandThatTakesTheObjectCanReachItsTarget) {
  // neither a state nor a hand of its own gives the part to a hand
  const std::string text = test::with(test::smallScenario(), "    hands: {right: part}\n", "");
  EXPECT_THAT(parsedWith(text, {.needs_states = false}).error().what, HasSubstr("no hand moves 'part'"));
  const auto scenario = parsedWith(text, {.taken = {{kRight, kPart}}, .needs_states = false});
  ASSERT_TRUE(scenario) << scenario.error().what;
  ASSERT_EQ(scenario->states.size(), 2U);
  EXPECT_EQ(scenario->states[0].conditions[1].object, scenario->objectNamed("pointer"))
      << "a touch is that of the hand's own object, whatever it has taken";
  EXPECT_EQ(scenario->states[1].name, "mount");
  EXPECT_EQ(scenario->states[1].hand, kRight);
}

TEST(ScriptedScenario, NamesAloneAreReadOfAScenarioWhosePairsDependOnWhatIsTaken) {
  const auto names = parsedWith(withoutStates(), {.only_names = true});
  ASSERT_TRUE(names) << names.error().what;
  EXPECT_EQ(names->objectNamed("part"), kPart);
  EXPECT_EQ(names->handNamed("right"), kRight);
  EXPECT_TRUE(names->pairs.empty());
}

TEST(ScriptedScenario, UnknownIdsOfTakenObjectsAreIgnored) {
  const auto scenario =
      parsedWith(test::smallScenario(), {.taken = {{kRight, ObjectId{99}}, {HandId{9}, kPart}, {{}, {}}}});
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_EQ(scenario->pairs.size(), parsedWith(test::smallScenario(), {})->pairs.size());
}

}  // namespace
}  // namespace tenon::game_control
