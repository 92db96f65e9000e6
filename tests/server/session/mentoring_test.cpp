#include "server/session/mentoring.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

using test::kInstructorHand;
using test::kLeftHand;
using test::kRightHand;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr ClientId kTrainee{1}, kInstructor{2}, kDesk{3};

class MentoringTest : public ::testing::Test {
 protected:
  MentoringTest() {
    controllers_.resize(loaded_.scenario->hands.size());
    controllers_[kRightHand.value] = kTrainee;
    controllers_[kInstructorHand.value] = kInstructor;
    const std::size_t hands = controllers_.size();
    output_.manifolds.resize(hands);
    output_.present.assign(hands, true);
    output_.ages.assign(hands, 0);
    output_.phase = RunPhase::kRunning;
    for (HandManifold& manifold : output_.manifolds) manifold.object = ObjectId{0};
    output_.manifolds[kInstructorHand.value].X_WO = Pose(Vector3(0.1, 0.2, 0.3));
    output_.manifolds[kRightHand.value].X_WO = Pose(Vector3(0.4, 0.5, 0.6));
  }
  std::string decide(const std::string& words, ClientId client = kDesk, Role role = Role::kInstructor) {
    const auto done = mentoring_.decide(words, client, role, controllers_);
    why_ = done ? Refusal::kNone : done.error().why;
    return done ? "" : done.error().what;
  }
  std::vector<Guidance> step() {
    output_.tick += Mentoring::kPeriod;
    return mentoring_.step(output_, controllers_, ended_);
  }

  LoadedScene loaded_ = test::smallSession();
  Mentoring mentoring_{*loaded_.scenario, 7};
  std::vector<ClientId> controllers_;
  TickOutput output_;
  std::vector<std::string> ended_;
  Refusal why_ = Refusal::kNone;  ///< of the last decide
};

TEST_F(MentoringTest, ShowsATraineesHandToTheInstructorsHand) {
  EXPECT_THAT(step(), IsEmpty());
  ASSERT_EQ(decide("show right"), "");
  const auto fixtures = step();
  ASSERT_EQ(fixtures.size(), 1U);
  EXPECT_EQ(fixtures[0].hand, kRightHand);
  EXPECT_EQ(fixtures[0].guide, kInstructorHand);
  EXPECT_EQ(fixtures[0].mode, GuidanceMode::kLead);
  EXPECT_EQ(fixtures[0].X_WF.translation(), Vector3(0.1, 0.2, 0.3));
  EXPECT_EQ(fixtures[0].server_epoch, 7U);
}

TEST_F(MentoringTest, TiesBothHandsToEachOtherMoreSoftly) {
  mentoring_.setRoundTrip(kTrainee, 0.002);
  mentoring_.setRoundTrip(kInstructor, 0.001);
  ASSERT_EQ(decide("together right"), "");
  const auto fixtures = step();
  ASSERT_EQ(fixtures.size(), 2U);
  EXPECT_EQ(fixtures[1].hand, kInstructorHand);
  EXPECT_EQ(fixtures[1].X_WF.translation(), Vector3(0.4, 0.5, 0.6));
  EXPECT_EQ(fixtures[1].stiffness, Mentoring::kMutualStiffness);
}

TEST_F(MentoringTest, TiesThemTheMoreSoftlyTheLongerTheWay) {
  mentoring_.setRoundTrip(kTrainee, 0.099);
  mentoring_.setRoundTrip(kInstructor, 0.001);
  mentoring_.setRoundTrip(kInstructor, -1.0);
  ASSERT_EQ(decide("together right"), "");
  for (const Guidance& fixture : step()) EXPECT_NEAR(fixture.stiffness, 30.0, 1e-9);
  ASSERT_EQ(decide("show right"), "");
  EXPECT_EQ(step()[0].stiffness, Mentoring::kStiffness) << "one way needs none of it";
}

TEST_F(MentoringTest, HandsOffIsSaidForAWhile) {
  ASSERT_EQ(decide("show right"), "");
  ASSERT_EQ(decide("off right"), "");
  const auto fixtures = step();
  ASSERT_EQ(fixtures.size(), 1U);
  EXPECT_EQ(fixtures[0].mode, GuidanceMode::kOff);
  for (int i = 0; i < 50; ++i) (void)step();
  EXPECT_THAT(step(), IsEmpty());
  EXPECT_THAT(decide("off right"), HasSubstr("hand 'right' is not guided"));
  EXPECT_EQ(why_, Refusal::kAlready);
}

TEST_F(MentoringTest, ATraineeMayEndItAndNobodyWithoutTheRightBeginsIt) {
  EXPECT_THAT(decide("show right", kTrainee, Role::kTrainee), HasSubstr("not permitted for the trainee"));
  EXPECT_THAT(decide("show right", kDesk, Role::kObserver), HasSubstr("not permitted for the observer"));
  EXPECT_EQ(why_, Refusal::kNotPermitted);
  ASSERT_EQ(decide("show right"), "");
  EXPECT_THAT(decide("off", kDesk, Role::kObserver), HasSubstr("not permitted"));
  EXPECT_EQ(decide("off", kTrainee, Role::kTrainee), "");
}

TEST_F(MentoringTest, AHandIsGuidedByOneOther) {
  game_control::ScenarioFile scenario = *loaded_.scenario;
  scenario.hands.push_back(scenario.hands[kInstructorHand.value]);
  scenario.hands.back().name = "second";
  controllers_.push_back(ClientId{9});
  Mentoring mentoring(scenario, 7);
  const auto decide = [&](const std::string& words) {
    const auto done = mentoring.decide(words, kDesk, Role::kInstructor, controllers_);
    return done ? std::string() : done.error().what;
  };
  EXPECT_THAT(decide("show right"), HasSubstr("add 'by instructor'"));
  EXPECT_THAT(decide("record"), HasSubstr("add 'instructor'")) << "as in: guide record instructor";
  EXPECT_EQ(decide("show right by instructor"), "");
  EXPECT_EQ(decide("together right by instructor"), "") << "the same hand changes what it does";
  EXPECT_THAT(decide("show right by second"), HasSubstr("guided by hand 'instructor' already"));
  controllers_[kLeftHand.value] = kTrainee;
  EXPECT_THAT(decide("show left by instructor"), HasSubstr("guides hand 'right' already"));
}

TEST_F(MentoringTest, RefusesByWords) {
  EXPECT_THAT(decide("lift right"), HasSubstr("expected: guide show"));
  EXPECT_THAT(decide("show right sideways"), HasSubstr("expected: guide show"));
  EXPECT_THAT(decide(""), HasSubstr("expected: guide show"));
  EXPECT_THAT(decide("show nobody"), HasSubstr("'nobody' is no hand of a trainee"));
  EXPECT_EQ(why_, Refusal::kUnknownName);
  EXPECT_THAT(decide("show instructor"), HasSubstr("'instructor' is no hand of a trainee"));
  EXPECT_THAT(decide("show left"), HasSubstr("nobody moves hand 'left'"));
  EXPECT_EQ(why_, Refusal::kNobodyThere);
  EXPECT_THAT(decide("show right by right"), HasSubstr("'right' is no hand of an instructor"));
  controllers_[kInstructorHand.value] = {};
  EXPECT_THAT(decide("show right"), HasSubstr("no instructor moves a hand"));
}

TEST_F(MentoringTest, IsOffWhileTheInstructorsHandIsSilentOrHeldStill) {
  ASSERT_EQ(decide("show right"), "");
  output_.ages[kInstructorHand.value] = Mentoring::kSilent + 1;
  EXPECT_EQ(step()[0].mode, GuidanceMode::kOff);
  output_.ages[kInstructorHand.value] = 0;
  EXPECT_EQ(step()[0].mode, GuidanceMode::kLead);
  output_.manifolds[kInstructorHand.value].frozen = true;
  EXPECT_EQ(step()[0].mode, GuidanceMode::kOff);
  EXPECT_THAT(ended_, IsEmpty());
}

TEST_F(MentoringTest, EndsForGoodWhenTheInstructorLeavesOrAStopIsEngaged) {
  ASSERT_EQ(decide("show right"), "");
  controllers_[kInstructorHand.value] = {};
  EXPECT_EQ(step()[0].mode, GuidanceMode::kOff);
  EXPECT_THAT(ended_,
              ElementsAre("hand 'right' is guided no more: whoever moved hand 'instructor' has left"));
  controllers_[kInstructorHand.value] = kInstructor;
  EXPECT_EQ(step()[0].mode, GuidanceMode::kOff) << "a hand that is back has to be chosen again";
  ASSERT_EQ(decide("show right"), "");
  output_.emergency_stop = true;
  EXPECT_EQ(step()[0].mode, GuidanceMode::kOff);
  output_.emergency_stop = false;
  EXPECT_EQ(step()[0].mode, GuidanceMode::kOff);
}

TEST_F(MentoringTest, EndsWhenAStationComesBackAsTheSameClientBeforeTheNextTick) {
  ASSERT_EQ(decide("show right"), "");
  mentoring_.left(kTrainee);
  EXPECT_EQ(step()[0].mode, GuidanceMode::kOff);
  EXPECT_EQ(ended_.size(), 1U);
}

TEST_F(MentoringTest, LeadsAlongARecordedPathAndWaitsForTheHand) {
  EXPECT_THAT(decide("path right"), HasSubstr("has recorded no path"));
  ASSERT_EQ(decide("record"), "");
  Vector3& p_WI = output_.manifolds[kInstructorHand.value].X_WO.translation();
  Vector3& p_WH = output_.manifolds[kRightHand.value].X_WO.translation();
  p_WH = p_WI;
  const Vector3 begin = p_WI;
  for (int i = 0; i < 100; ++i) {
    (void)step();
    p_WI.x() += 0.001;
  }
  ASSERT_EQ(decide("path right"), "");
  EXPECT_EQ(step()[0].X_WF.translation(), begin);
  for (int i = 0; i < 200; ++i) (void)step();
  EXPECT_NEAR(step()[0].X_WF.translation().x(), begin.x() + Mentoring::kLeash, 0.0011)
      << "the hand stays behind";
  EXPECT_THAT(decide("record"), HasSubstr("is led along the path"));
  for (int i = 0; i < 200; ++i) p_WH = step()[0].X_WF.translation();
  EXPECT_NEAR(p_WH.x(), begin.x() + 0.099, 1e-9) << "the path's end";
  controllers_[kInstructorHand.value] = {};
  (void)step();
  controllers_[kInstructorHand.value] = kInstructor;
  EXPECT_THAT(decide("path right"), HasSubstr("has recorded no path")) << "it was another person's";
}

TEST_F(MentoringTest, AnotherChoiceIsAnotherFixture) {
  ASSERT_EQ(decide("show right"), "");
  const std::uint32_t first = step()[0].choice;
  ASSERT_EQ(decide("show right pose"), "");
  const auto fixtures = step();
  ASSERT_EQ(fixtures.size(), 1U);
  EXPECT_NE(fixtures[0].choice, first);
  EXPECT_GT(fixtures[0].rotational_stiffness, 0.0);
}

}  // namespace
}  // namespace tenon::session
