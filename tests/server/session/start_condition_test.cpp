#include "server/session/start_condition.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/registry_session.h"

namespace tenon::session {
namespace {

using test::kInstructorHand;
using test::kLeftHand;
using test::kRightHand;

class StartConditionTest : public RegistrySession {};

TEST_F(StartConditionTest, IsMadeOfNamesOfHandsAndRoles) {
  struct Row {
    std::vector<std::string> names;
    std::vector<HandId> hands;
    std::vector<Role> roles;
  };
  const std::vector<Row> rows{
      {{}, traineeHands(*loaded_.scenario), {}},
      {{"right"}, {kRightHand}, {}},
      {{"left", "right"}, {kLeftHand, kRightHand}, {}},
      {{"recorder", "observer"}, {}, {Role::kRecorder, Role::kObserver}},
      {{"left", "recorder"}, {kLeftHand}, {Role::kRecorder}},
      {{"instructor"}, {kInstructorHand}, {}},  // a hand of that name goes before the role
      {{"trainee"}, {}, {Role::kTrainee}},
  };
  for (const Row& row : rows) {
    const auto condition = StartCondition::make(*loaded_.scenario, row.names);
    ASSERT_TRUE(condition) << condition.error().what;
    EXPECT_EQ(condition->hands, row.hands);
    EXPECT_EQ(condition->roles, row.roles);
  }
  for (const std::string wrong : {"", "Right", "everybody"}) {
    const auto condition = StartCondition::make(*loaded_.scenario, {"right", wrong});
    ASSERT_FALSE(condition) << wrong;
    EXPECT_THAT(condition.error().what, testing::HasSubstr("cannot wait for '" + wrong + "'"));
  }
}

TEST_F(StartConditionTest, IsMetWhileAllHandsAreControlledAndAllRolesAreThere) {
  const auto condition = StartCondition::make(*loaded_.scenario, {"right", "left", "recorder"});
  ASSERT_TRUE(condition);
  EXPECT_FALSE(condition->isMet(registry_));
  const auto missing = [&] { return condition->missing(*loaded_.scenario, registry_); };
  EXPECT_THAT(missing(), testing::ElementsAre("right", "left", "recorder"));
  const ClientId both = join("trainee", Role::kTrainee, {"right", "left"}).client;
  EXPECT_FALSE(condition->isMet(registry_)) << "no recorder yet";
  EXPECT_THAT(missing(), testing::ElementsAre("recorder"));
  const ClientId recorder = join("recorder", Role::kRecorder).client;
  EXPECT_TRUE(condition->isMet(registry_));
  EXPECT_THAT(missing(), testing::IsEmpty());
  registry_.leave(recorder);
  EXPECT_FALSE(condition->isMet(registry_));
  (void)join("another recorder", Role::kRecorder);
  EXPECT_TRUE(condition->isMet(registry_));
  registry_.leave(both);
  EXPECT_FALSE(condition->isMet(registry_));
  EXPECT_TRUE(StartCondition{}.isMet(registry_)) << "nothing is waited for";
}

}  // namespace
}  // namespace tenon::session
