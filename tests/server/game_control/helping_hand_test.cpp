#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/game_control/exercise.h"

namespace tenon {
namespace {

using test::Exercise;
using test::smallScenario;
using test::with;
using ::testing::HasSubstr;

constexpr HandId kInstructor{1};

std::string withHelper(const std::string& helper) {
  return with(smallScenario(), "    hands: {right: part}",
              "    hands: {right: part}\n    may_take: " + helper);
}

//   right o--[part]<--# instructor's cube, pressed lightly to the part's side
class HelpingHandTest : public testing::Test {
 protected:
  HelpingHandTest() : exercise_(withHelper("{instructor: part}")) {
    exercise_.touchPart();
    part_ = exercise_.scenario().objectNamed("part");
    exercise_.environment().setHandPresent(kInstructor, true);
    comeTo(0.1);
  }
  void comeTo(double gap) {
    const Vector3 p_WPart = exercise_.object("part").X_WO.translation();
    exercise_.environment().setHandPose(kInstructor, Pose(p_WPart + Vector3(0.04 + gap, 0.0, 0.0)), {});
  }
  [[nodiscard]] const HandMotion& instructor() { return exercise_.environment().hands()[kInstructor.value]; }

  Exercise exercise_;
  ObjectId part_;
};

TEST_F(HelpingHandTest, ASecondHandTakesAHeldPartByTouchingItForASecond) {
  exercise_.step(50);
  ASSERT_EQ(exercise_.environment().hands()[0].object, part_);
  comeTo(0.001);
  exercise_.step(900);
  EXPECT_NE(instructor().object, part_);
  exercise_.step(400);
  EXPECT_EQ(instructor().object, part_);
  EXPECT_EQ(exercise_.environment().hands()[0].object, part_) << "both hold it";
  EXPECT_EQ(exercise_.object("cube").status, ObjectStatus::kHidden);
}

TEST_F(HelpingHandTest, HelpEndsWithTheState) {
  comeTo(0.001);
  exercise_.step(1500);
  ASSERT_EQ(instructor().object, part_);
  exercise_.step({GameCommand{.kind = CommandKind::kSkipStep}});
  exercise_.step(2);
  EXPECT_NE(instructor().object, part_);
  EXPECT_EQ(exercise_.object("cube").status, ObjectStatus::kHeld);
}

TEST_F(HelpingHandTest, ASavedSecondOfTouchGoesOn) {
  comeTo(0.001);
  exercise_.step(600);
  const auto environment = exercise_.environment().save();
  const auto machine = exercise_.machine().save();
  exercise_.step(700);
  const std::uint64_t expected = exercise_.hash();
  ASSERT_EQ(instructor().object, part_);
  ASSERT_TRUE(exercise_.environment().restore(environment));
  ASSERT_TRUE(exercise_.machine().restore(machine));
  exercise_.step(700);
  EXPECT_EQ(exercise_.hash(), expected);
}

TEST(MayTake, WhatIsWrongIsSaidWithItsLine) {
  const auto error = [](const std::string& helper) {
    const auto scenario = parseScenario(withHelper(helper), "small/scenario.yaml");
    return scenario ? std::string() : scenario.error().what;
  };
  EXPECT_EQ(error("{instructor: part}"), "");
  EXPECT_THAT(error("[instructor]"), HasSubstr("'may_take' of state 'mount' must be a mapping"));
  EXPECT_THAT(error("{right: part}"), HasSubstr("'right' moves 'part' already"));
  EXPECT_THAT(error("{left: part}"), HasSubstr("small/scenario.yaml:"));
  EXPECT_THAT(error("{instructor: pointer}"), HasSubstr("'pointer' belongs to hand 'right'"));
  EXPECT_THAT(error("{instructor: prat}"), HasSubstr("did you mean 'part'?"));
}

}  // namespace
}  // namespace tenon
