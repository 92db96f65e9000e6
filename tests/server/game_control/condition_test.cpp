#include "server/game_control/condition.h"

#include <initializer_list>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::game_control {
namespace {

/// A SceneView with one pose, force and contact flag for all objects, set by the test.
struct SceneStub final : SceneView {
  Pose X_WO;
  Vector3 p_OQ_O = Vector3::Zero();
  Vector3 F_W = Vector3::Zero();
  bool contact = false;

  [[nodiscard]] Pose pose(ObjectId) const noexcept override { return X_WO; }
  [[nodiscard]] Vector3 centre(ObjectId) const noexcept override { return p_OQ_O; }
  [[nodiscard]] Vector3 force(ObjectId) const noexcept override { return F_W; }
  [[nodiscard]] bool inContact(ObjectId, ObjectId) const noexcept override { return contact; }
  [[nodiscard]] bool inAnyContact(ObjectId) const noexcept override { return contact; }
};

Condition group(ConditionKind kind, bool latched = false) {
  Condition condition;
  condition.kind = kind;
  condition.latched = latched;
  return condition;
}

Condition leaf(ConditionKind kind) {
  Condition condition;
  condition.kind = kind;
  condition.object = ObjectId{0};
  condition.other = ObjectId{1};
  condition.within = 0.002;
  condition.angle = 0.035;
  return condition;
}

class Conditions : public ::testing::Test {
 protected:
  bool step(std::initializer_list<GameCommand> commands = {}) {
    return progress_.step(tree_, scene_, std::vector<GameCommand>(commands));
  }
  /// Steps until met; the number of steps, or -1 after `most`.
  int stepsUntilMet(int most) {
    for (int i = 1; i <= most; ++i) {
      if (step()) return i;
    }
    return -1;
  }

  std::vector<Condition> tree_;
  SceneStub scene_;
  ConditionProgress progress_;
};

TEST_F(Conditions, APoseIsMetWithinBothTolerances) {
  tree_ = {leaf(ConditionKind::kPose)};
  scene_.X_WO = Pose(Vector3(0.0019, 0, 0));
  EXPECT_TRUE(step());
  EXPECT_DOUBLE_EQ(progress_.reading(0).value, 0.0019);
  scene_.X_WO = Pose(Vector3(0.0021, 0, 0));
  EXPECT_FALSE(step());
  scene_.X_WO = Pose(Vector3::Zero(), expRotation(Vector3(0.036, 0, 0)));
  EXPECT_FALSE(step()) << "position met, orientation not";
  scene_.X_WO = Pose(Vector3::Zero(), expRotation(Vector3(0, -0.034, 0)));
  EXPECT_TRUE(step());
  scene_.X_WO.rotation().coeffs() *= -1.0;
  EXPECT_TRUE(step()) << "q and -q are one orientation";
}

// a peg 0.94 degrees from its target about its own centre, with the frame's origin 0.94 m away: that is 15 mm
// off
TEST_F(Conditions, APoseIsThatOfTheObjectsCentre) {
  tree_ = {leaf(ConditionKind::kPose)};
  scene_.p_OQ_O = Vector3(0.94, 0, 0);
  tree_[0].X_WG = Pose(-scene_.p_OQ_O);
  const Vector3 off(0.00049, 0, 0);
  const Quaternion q_WO = expRotation(Vector3(0, 0, 0.0164));
  scene_.X_WO = Pose(off - q_WO * scene_.p_OQ_O, q_WO);
  EXPECT_TRUE(step());
  EXPECT_NEAR(progress_.reading(0).value, 0.00049, 1e-12);
  scene_.X_WO.translation() += Vector3(0.002, 0, 0);
  EXPECT_FALSE(step());
}

TEST_F(Conditions, DwellRestartsAfterAnInterruption) {
  tree_ = {leaf(ConditionKind::kPose)};
  tree_[0].dwell = 10;
  for (int i = 0; i < 9; ++i) EXPECT_FALSE(step());
  scene_.X_WO = Pose(Vector3(1, 0, 0));
  EXPECT_FALSE(step());
  scene_.X_WO = Pose();
  EXPECT_EQ(stepsUntilMet(100), 10);
}

TEST_F(Conditions, AForceIsMetWithinItsBoundsOrNearItsTarget) {
  tree_ = {leaf(ConditionKind::kForce)};
  tree_[0].above = 2.0;
  tree_[0].below = 5.0;
  scene_.F_W = Vector3(0, 3, 0);
  EXPECT_TRUE(step());
  scene_.F_W = Vector3(0, 0, 6);
  EXPECT_FALSE(step());
  scene_.F_W = Vector3(1, 0, 0);
  EXPECT_FALSE(step());
  tree_ = {leaf(ConditionKind::kForceTarget)};
  tree_[0].F_W = Vector3(0, 0, 10);
  tree_[0].within = 1.0;
  scene_.F_W = Vector3(0, 0, 9.5);
  EXPECT_TRUE(step());
  scene_.F_W = Vector3(0, 0, -10);
  EXPECT_FALSE(step()) << "the direction counts";
}

TEST_F(Conditions, AContactToleratesGapsUpToItsLapse) {
  tree_ = {leaf(ConditionKind::kContact)};
  tree_[0].limit_ticks = 100;
  tree_[0].lapse = 5;
  scene_.contact = true;
  for (int i = 0; i < 60; ++i) EXPECT_FALSE(step());
  scene_.contact = false;
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(step());
  scene_.contact = true;
  EXPECT_EQ(stepsUntilMet(1000), 40) << "the gap is tolerated, but not counted";
  scene_.contact = false;
  for (int i = 0; i < 6; ++i) step();
  scene_.contact = true;
  EXPECT_EQ(stepsUntilMet(1000), 100) << "too long a gap resets the time";
}

TEST_F(Conditions, ContactTimeAccumulates) {
  tree_ = {leaf(ConditionKind::kContactTime)};
  tree_[0].limit_ticks = 10;
  for (int i = 0; i < 9; ++i) {
    scene_.contact = true;
    EXPECT_FALSE(step());
    scene_.contact = false;
    for (int k = 0; k < 100; ++k) EXPECT_FALSE(step());
  }
  scene_.contact = true;
  EXPECT_TRUE(step());
  EXPECT_DOUBLE_EQ(progress_.reading(0).value, 0.01);
}

TEST_F(Conditions, ACommandLastsOneTick) {
  tree_ = {leaf(ConditionKind::kFulfilled)};
  EXPECT_FALSE(step());
  EXPECT_TRUE(step({GameCommand{}}));
  EXPECT_FALSE(step());
  tree_ = {leaf(ConditionKind::kSignal)};
  tree_[0].signal = 3;
  EXPECT_FALSE(step({GameCommand{.kind = CommandKind::kSignal, .signal = 2}}));
  EXPECT_TRUE(step({GameCommand{.kind = CommandKind::kSignal, .signal = 3}}));
}

TEST_F(Conditions, ATogetherGroupNeedsAllInOneTickALatchedGroupEachOnce) {
  for (const bool latched : {false, true}) {
    progress_.reset();
    tree_ = {group(ConditionKind::kAll, latched), leaf(ConditionKind::kFulfilled),
             leaf(ConditionKind::kContactTime)};
    tree_[2].limit_ticks = 3;
    scene_.contact = true;
    EXPECT_FALSE(step({GameCommand{}}));
    EXPECT_EQ(stepsUntilMet(50), latched ? 2 : -1);
    EXPECT_TRUE(step({GameCommand{}})) << "both in one tick meet either kind of group";
  }
}

TEST_F(Conditions, AnAnyGroupNeedsOneChildAndGroupsNest) {
  // any: [all: [pose, contact], command]
  tree_ = {group(ConditionKind::kAny), group(ConditionKind::kAll), leaf(ConditionKind::kPose),
           leaf(ConditionKind::kContact), leaf(ConditionKind::kFulfilled)};
  tree_[2].parent = 1;
  tree_[3].parent = 1;
  EXPECT_FALSE(step()) << "pose met, contact not";
  scene_.contact = true;
  EXPECT_TRUE(step());
  scene_.X_WO = Pose(Vector3(1, 0, 0));
  EXPECT_FALSE(step());
  EXPECT_TRUE(step({GameCommand{}}));
}

TEST_F(Conditions, AGroupCanDwell) {
  tree_ = {group(ConditionKind::kAll), leaf(ConditionKind::kPose), leaf(ConditionKind::kContact)};
  tree_[0].dwell = 20;
  scene_.contact = true;
  EXPECT_EQ(stepsUntilMet(100), 20);
}

}  // namespace
}  // namespace tenon::game_control
