#include "clients/haptic/workspace.h"

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr double kShiftStep = 1e-3;

//     ( C_w )---o C_h       C_h inside the sphere: C_w rests; outside: C_w follows by eq. 1
//       r_w
TEST(Workspace, FollowsAHandOutsideItsSphereByEquationOne) {
  Workspace workspace({.radius = 0.2, .gain = 1.5});
  const Vector3 p_WC(1.0, 2.0, 3.0);
  workspace.setCentre(p_WC);
  const Vector3 p_DH(0.3, -0.1, 0.05);
  workspace.step(p_DH, false, kShiftStep);
  const double r_h = p_DH.norm();
  const Vector3 C_h = p_WC + p_DH;
  const Vector3 expected = p_WC + 1.5 * kShiftStep * (1.0 - 0.2 / r_h) * (C_h - p_WC);
  EXPECT_LT((workspace.centre() - expected).norm(), 1e-15);
  EXPECT_LT((workspace.velocity() - (expected - p_WC) / kShiftStep).norm(), 1e-9);
}

// a servo that stood still: explicit Euler over the whole time would carry the centre far beyond the hand
TEST(Workspace, ALongStepCountsAsTenMilliseconds) {
  Workspace workspace({.radius = 0.03, .gain = 14.0});
  workspace.setCentre(Vector3::Zero());
  workspace.step(Vector3(0.05, 0.0, 0.0), false, 0.5);
  EXPECT_NEAR(workspace.centre().x(), 14.0 * 0.01 * 0.02, 1e-12);
  workspace.setCentre(Vector3::Zero());
  workspace.shift(Vector3(0.0, 0.05, 0.0));
  for (int i = 0; i < 300; ++i) workspace.step(Vector3::Zero(), false, 2.0);
  EXPECT_GE(workspace.centre().y(), 0.0) << "the shift returns to where it began, not beyond";
}

TEST(Workspace, RestsWhileTheHandIsInsideTheSphere) {
  Workspace workspace({.radius = 0.2, .gain = 1.5});
  workspace.setCentre(Vector3(1.0, 0.0, 0.0));
  for (int i = 0; i < 1000; ++i) workspace.step(Vector3(0.0, 0.2, 0.0), false, kShiftStep);
  EXPECT_EQ(workspace.centre(), Vector3(1.0, 0.0, 0.0));
  EXPECT_FALSE(workspace.moving());
}

TEST(Workspace, RestsInContactAndForTheSettlingTimeAfterIt) {
  Workspace workspace({.radius = 0.2, .gain = 1.5, .settle_ticks = 50});
  workspace.setCentre(Vector3::Zero());
  for (int i = 0; i < 1000; ++i) workspace.step(Vector3(0.4, 0.0, 0.0), true, kShiftStep);
  EXPECT_EQ(workspace.centre(), Vector3::Zero());
  for (int i = 0; i < 49; ++i) workspace.step(Vector3(0.4, 0.0, 0.0), false, kShiftStep);
  EXPECT_EQ(workspace.centre(), Vector3::Zero());
  workspace.step(Vector3(0.4, 0.0, 0.0), false, kShiftStep);
  EXPECT_GT(workspace.centre().x(), 0.0);
}

TEST(Workspace, MovesToAPositionSmoothlyAndReachesItExactly) {
  Workspace workspace({.move_speed = 0.4});
  workspace.setCentre(Vector3::Zero());
  const Vector3 target(0.6, 0.8, 0.0);
  workspace.moveTo(target);
  double max_speed = 0.0;
  double max_speed_change = 0.0;
  Vector3 before = Vector3::Zero();
  for (int i = 0; i < 10000 && workspace.moveInProgress(); ++i) {
    workspace.step(Vector3::Zero(), false, kShiftStep);
    max_speed = std::max(max_speed, workspace.velocity().norm());
    max_speed_change = std::max(max_speed_change, (workspace.velocity() - before).norm());
    before = workspace.velocity();
  }
  EXPECT_LT((workspace.centre() - target).norm(), 1e-12);
  EXPECT_NEAR(max_speed, 0.4, 1e-3);
  EXPECT_LT(max_speed_change, 1e-3);  // [m/s] from one millisecond to the next
}

TEST(Workspace, PausesAMoveInContactAndRestartsItFromRest) {
  Workspace workspace({.move_speed = 0.4});
  workspace.setCentre(Vector3::Zero());
  workspace.moveTo(Vector3(1.0, 0.0, 0.0));
  for (int i = 0; i < 800; ++i) workspace.step(Vector3::Zero(), false, kShiftStep);
  const Vector3 stopped = workspace.centre();
  for (int i = 0; i < 100; ++i) workspace.step(Vector3::Zero(), true, kShiftStep);
  EXPECT_EQ(workspace.centre(), stopped);
  for (int i = 0; i < 51; ++i) workspace.step(Vector3::Zero(), false, kShiftStep);
  EXPECT_LT(workspace.velocity().norm(), 0.001);
  for (int i = 0; i < 10000; ++i) workspace.step(Vector3::Zero(), false, kShiftStep);
  EXPECT_LT((workspace.centre() - Vector3(1.0, 0.0, 0.0)).norm(), 1e-12);
}

//   C_w <--o device     o hand in the scene stays       contact or not
TEST(Workspace, MovesAgainstADeclutchedDeviceAndKeepsThatPlace) {
  Workspace workspace({.radius = 0.035, .gain = 10.0});
  workspace.setCentre(Vector3::Zero());
  workspace.shift(Vector3(0.0, 0.002, 0.0));
  const Vector3 p_WH(0.0, 0.002, -0.056);
  for (int i = 1; i <= 800; ++i) {
    const Vector3 p_DH(0.0, 0.0, -0.056 + 1e-4 * i);
    workspace.stepDeclutched(p_WH, p_DH, Vector3(0.0, 0.0, 0.1));
    ASSERT_LT((workspace.centre() + p_DH - p_WH).norm(), 1e-15);
    ASSERT_EQ(workspace.velocity().z(), -0.1);
  }
  EXPECT_NEAR(workspace.centre().z(), -0.080, 1e-12);
  EXPECT_EQ(workspace.shifted(), Vector3::Zero()) << "nothing takes back what the person has placed";
  const Vector3 placed = workspace.centre();
  for (int i = 0; i < 3000; ++i) workspace.step(Vector3(0.0, 0.0, 0.024), false, kShiftStep);
  EXPECT_EQ(workspace.centre(), placed);
}

TEST(Workspace, MapsPosesToTheWorldAndBack) {
  Workspace workspace({});
  workspace.setCentre(Vector3(1.0, 2.0, 3.0));
  const Pose X_DH(Vector3(0.1, 0.2, 0.3), expRotation(Vector3(0.3, -0.2, 0.1)));
  EXPECT_EQ(workspace.toWorld(X_DH).translation(), Vector3(1.1, 2.2, 3.3));
  EXPECT_LT((workspace.toDevice(workspace.toWorld(X_DH)).translation() - X_DH.translation()).norm(), 1e-15);
}

}  // namespace
}  // namespace tenon::haptic
