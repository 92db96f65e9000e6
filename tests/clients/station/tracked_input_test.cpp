#include "clients/station/tracked_input.h"

#include <gtest/gtest.h>

namespace tenon::station {
namespace {

constexpr double kTick = 1e-3;  // [s]

TEST(TrackedInput, HasTheVelocityOfItsMotion) {
  DeviceInput input;
  setTrackedPose(input, Pose(Vector3(0, 0, 1)), kTick);
  EXPECT_TRUE(input.active);
  EXPECT_EQ(input.sample.V_WH.linear, Vector3::Zero().eval()) << "of its first reading nothing is known";
  setTrackedPose(input, Pose(Vector3(0.002, 0, 1), Quaternion(Eigen::AngleAxisd(0.01, Vector3::UnitZ()))),
                 kTick);
  EXPECT_LT((input.sample.V_WH.linear - Vector3(2, 0, 0)).norm(), 1e-9);
  EXPECT_LT((input.sample.V_WH.angular - Vector3(0, 0, 10)).norm(), 1e-9);
}

TEST(TrackedInput, AJumpHasNoVelocity) {
  DeviceInput input;
  setTrackedPose(input, Pose(Vector3(0, 0, 1)), kTick);
  setTrackedPose(input, Pose(Vector3(0.06, 0, 1)), kTick);
  EXPECT_EQ(input.sample.V_WH.linear, Vector3::Zero().eval());
  EXPECT_EQ(input.sample.X_WH.translation(), Vector3(0.06, 0, 1));
  setTrackedPose(input, Pose(Vector3(0.06, 0, 1), Quaternion(Eigen::AngleAxisd(0.5, Vector3::UnitX()))),
                 kTick);
  EXPECT_EQ(input.sample.V_WH.angular, Vector3::Zero().eval());
  setTrackedPose(input, Pose(Vector3(0.061, 0, 1), Quaternion(Eigen::AngleAxisd(0.5, Vector3::UnitX()))),
                 kTick);
  EXPECT_NEAR(input.sample.V_WH.linear.x(), 1.0, 1e-9) << "and moves on from there";
}

}  // namespace
}  // namespace tenon::station
