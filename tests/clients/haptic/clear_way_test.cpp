#include "clients/haptic/clear_way.h"

#include <vector>

#include <gtest/gtest.h>

namespace tenon {
namespace {

constexpr double kMargin = 0.05;

/// A box of 0.4 m on the floor at the origin, seen as a big thing.
std::vector<SceneObject> room() {
  SceneObject bay;
  bay.object = ObjectId{0};
  bay.kind = "scene";
  bay.size = Vector3(0.4, 0.4, 0.4);
  bay.centre = Vector3(0, 0, 0.2);
  SceneObject part = bay;
  part.object = ObjectId{1};
  part.kind = "part";
  part.X_WO = Pose(Vector3(2, 0, 0));
  return {bay, part};
}

class ClearWayTest : public ::testing::Test {
 protected:
  ClearWayTest() { way_.begin(objects_); }
  std::vector<SceneObject> objects_ = room();
  ClearWay way_;
};

TEST_F(ClearWayTest, IsStraightWhereNothingIsBetween) {
  const Waypoints way = way_.plan({-1, 1, 0.2}, {1, 1, 0.2}, kMargin);
  ASSERT_EQ(way.size(), 1U);
  EXPECT_EQ(way[0], Vector3(1, 1, 0.2));
}

//        2 ---------> 3
//        |  +-----+   |
//   from o  | bay |   v 4
TEST_F(ClearWayTest, GoesUpAcrossAndDownPastABigThing) {
  const Vector3 from(-1, 0, 0.35);
  const Vector3 to(1, 0, 0.3);
  const Waypoints way = way_.plan(from, to, kMargin);
  ASSERT_EQ(way.size(), 3U);
  EXPECT_EQ(way[0].head<2>(), from.head<2>());
  EXPECT_EQ(way[1].head<2>(), to.head<2>());
  EXPECT_GE(way[0].z(), 0.4 + kMargin - 1e-12) << "above its edge";
  EXPECT_EQ(way[0].z(), way[1].z());
  EXPECT_EQ(way[2], to);
}

TEST_F(ClearWayTest, PartsAreNoObstaclesAndTheSameOpeningIsStraight) {
  EXPECT_EQ(way_.plan({1.5, 0, 0.2}, {2.5, 0, 0.2}, kMargin).size(), 1U) << "a part lies in between";
  EXPECT_EQ(way_.plan({0, 0, 0.5}, {0.01, 0, 0.2}, kMargin).size(), 1U) << "straight down into it";
  EXPECT_EQ(way_.plan({0, 0, 0.2}, {0.03, 0, 0.2}, kMargin).size(), 1U) << "within one pocket";
}

}  // namespace
}  // namespace tenon
