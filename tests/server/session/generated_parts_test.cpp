#include "server/session/generated_parts.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/game_control/scenario_text.h"

namespace tenon::session {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(GeneratedParts, TheListOfTheGeneratorIsRead) {
  const auto sets =
      parseSetList("drawer\n  knob              a knob\n  rail              of steel\nlamp\n  bulb  glass\n");
  ASSERT_EQ(sets.size(), 2U);
  EXPECT_EQ(sets[0].name, "drawer");
  EXPECT_THAT(sets[0].parts, ElementsAre("knob", "rail"));
  EXPECT_EQ(sets[1].name, "lamp");
  EXPECT_THAT(sets[1].parts, ElementsAre("bulb"));
}

/// The small scenario names the parts bay, part, pointer and cube.
class GeneratedSetTest : public ::testing::Test {
 protected:
  static Result<std::string> setFor(const std::vector<GeneratedSet>& sets,
                                    const std::string& folder = "small", const std::string& parts = "") {
    const std::string title = parts.empty() ? "title: Small" : "title: Small\nparts: " + parts;
    const auto scenario = game_control::parseScenario(
        test::with(test::smallScenario(), "title: Small", title), folder + "/scenario.yaml");
    if (!scenario) return fail(scenario.error().what);
    return generatedSetOf(*scenario, sets);
  }
  static const GeneratedSet kSmall, kLarge, kOther;
};

const GeneratedSet GeneratedSetTest::kSmall{"small", {"bay", "part", "pointer", "cube"}};
const GeneratedSet GeneratedSetTest::kLarge{"large", {"bay", "part", "pointer", "cube", "lid"}};
const GeneratedSet GeneratedSetTest::kOther{"other", {"pointer", "cube", "gear"}};

TEST_F(GeneratedSetTest, IsTheOneThatHasAllParts) {
  EXPECT_EQ(setFor({kOther, kSmall}, "my copy").value(), "small");
  EXPECT_EQ(setFor({kOther, kSmall}, "other").value(), "small") << "the folder's name alone says nothing";
}

TEST_F(GeneratedSetTest, OfTheFolderComesFirst) {
  EXPECT_EQ(setFor({kLarge, kSmall}, "small").value(), "small");
  EXPECT_EQ(setFor({kSmall, kLarge}, "large").value(), "large");
}

TEST_F(GeneratedSetTest, IsStatedWhenSeveralWouldDo) {
  const auto none = setFor({kSmall, kLarge}, "my copy");
  ASSERT_FALSE(none);
  EXPECT_THAT(
      none.error().what,
      HasSubstr("my copy/scenario.yaml:3: several sets of generated parts have 'bay' (small, large)"));
  EXPECT_EQ(setFor({kSmall, kLarge}, "my copy", "large").value(), "large");
  EXPECT_EQ(setFor({kSmall, kLarge}, "small", "large").value(), "large");
}

TEST_F(GeneratedSetTest, ThatIsUnknownOrLacksAPartIsAnErrorWithItsLine) {
  EXPECT_THAT(
      setFor({kSmall, kOther}, "small", "tiny").error().what,
      HasSubstr("small/scenario.yaml:2: 'parts' is 'tiny', expected a set of generated parts: small, other"));
  EXPECT_THAT(
      setFor({kSmall, kOther}, "small", "other").error().what,
      HasSubstr(
          "small/scenario.yaml:4: the parts of 'other' have no 'bay', expected one of: pointer, cube, gear"));
  EXPECT_THAT(setFor({kOther}).error().what, HasSubstr("scenario.yaml:3: there is no generated part 'bay'"));
  EXPECT_THAT(setFor({kOther, {"rest", {"bay", "part"}}}).error().what,
              HasSubstr("scenario.yaml:3: no set of generated parts has all parts of this scenario"));
}

TEST_F(GeneratedSetTest, IsNotNeededWithoutParts) {
  const auto scenario = game_control::parseScenario(
      "objects: [{name: p, kind: pointer, meshes: [{sphere: {radius: 1 cm}}]}]\n"
      "hands: [{name: right, object: p}]\nstates: [{name: wait, conditions: [{command: fulfilled}]}]\n",
      "s/scenario.yaml");
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_EQ(generatedSetOf(*scenario, {}).value(), "");
}

}  // namespace
}  // namespace tenon::session
