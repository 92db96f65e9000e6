#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/game_control/scenario_fixture.h"

namespace tenon::game_control {
namespace {

using test::ScenarioFixture;
using test::smallScenario;
using test::with;
using ::testing::HasSubstr;

constexpr HandId kInstructor{1};

std::string withHelper(const std::string& helper) {
  return test::with(test::smallScenario(), "    hands: {right: part}",
                    "    hands: {right: part}\n    may_take: " + helper);
}

//   right o--[part]<--# instructor's cube; the test sets the gap between its side and the part's
class HelpingHandTest : public testing::Test {
 protected:
  HelpingHandTest() : fixture_(withHelper("{instructor: part}")) {
    fixture_.touchPart();
    part_ = fixture_.scenario().objectNamed("part");
    fixture_.environment().setHandPresent(kInstructor, true);
    moveInstructorTo(0.1);
  }
  void moveInstructorTo(double gap) {
    const Vector3 p_WPart = fixture_.object("part").X_WO.translation();
    fixture_.environment().setHandPose(kInstructor, Pose(p_WPart + Vector3(0.04 + gap, 0.0, 0.0)), {});
  }
  [[nodiscard]] const simulation::HandMotion& instructor() {
    return fixture_.environment().hands()[kInstructor.value];
  }

  test::ScenarioFixture fixture_;
  ObjectId part_;
};

TEST_F(HelpingHandTest, AHelperGrabsAHeldPartByTouchingItForOneSecond) {
  fixture_.step(50);
  ASSERT_EQ(fixture_.environment().hands()[0].object, part_);
  moveInstructorTo(-0.001);
  fixture_.step(900);
  EXPECT_NE(instructor().object, part_);
  fixture_.step(400);
  EXPECT_EQ(instructor().object, part_);
  EXPECT_EQ(fixture_.environment().hands()[0].object, part_) << "both hold it";
  EXPECT_EQ(fixture_.object("cube").status, ObjectStatus::kHidden);
}

TEST_F(HelpingHandTest, HelpersReleaseAtTheEndOfTheState) {
  moveInstructorTo(-0.001);
  fixture_.step(1500);
  ASSERT_EQ(instructor().object, part_);
  fixture_.step({GameCommand{.kind = CommandKind::kSkipStep}});
  fixture_.step(2);
  EXPECT_NE(instructor().object, part_);
  EXPECT_EQ(fixture_.object("cube").status, ObjectStatus::kHeld);
}

TEST_F(HelpingHandTest, TheContactTimeOfAHelperIsSavedAndRestored) {
  moveInstructorTo(-0.001);
  fixture_.step(600);
  const auto environment = fixture_.environment().save();
  const auto machine = fixture_.machine().save();
  fixture_.step(700);
  const std::uint64_t expected = fixture_.hash();
  ASSERT_EQ(instructor().object, part_);
  ASSERT_TRUE(fixture_.environment().restore(environment));
  ASSERT_TRUE(fixture_.machine().restore(machine));
  fixture_.step(700);
  EXPECT_EQ(fixture_.hash(), expected);
}

TEST(MayTake, ErrorsNameFileLineAndReason) {
  const auto error = [](const std::string& helper) {
    const auto scenario = parseScenario(withHelper(helper), "small/scenario.yaml");
    return scenario ? std::string() : scenario.error().what;
  };
  EXPECT_EQ(error("{instructor: part}"), "");
  EXPECT_THAT(error("[instructor]"), HasSubstr("'may_take' of state 'mount' must be a mapping"));
  EXPECT_THAT(error("{right: part}"), HasSubstr("'right' moves 'part' already"));
  EXPECT_THAT(error("{left: part}"), HasSubstr("small/scenario.yaml:"));
  EXPECT_THAT(error("{instructor: pointer}"), HasSubstr("'pointer' is the default object of hand 'right'"));
  EXPECT_THAT(error("{instructor: prat}"), HasSubstr("did you mean 'part'?"));
}

}  // namespace
}  // namespace tenon::game_control
