#include "clients/simulated_person/path_planner.h"

#include <vector>

#include <gtest/gtest.h>

namespace tenon::simulated_person {
namespace {

constexpr double kMargin = 0.05;

/// A box of 0.4 m on the floor at the origin (kind `scene`), and a part beside it.
std::vector<SceneObject> sceneObjects() {
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

class PathPlannerTest : public ::testing::Test {
 protected:
  PathPlannerTest() { planner_.begin(objects_); }
  std::vector<SceneObject> objects_ = sceneObjects();
  PathPlanner planner_;
};

TEST_F(PathPlannerTest, StraightWithoutObstacle) {
  const Waypoints path = planner_.plan({-1, 1, 0.2}, {1, 1, 0.2}, kMargin);
  ASSERT_EQ(path.size(), 1U);
  EXPECT_EQ(path[0], Vector3(1, 1, 0.2));
}

//        2 ---------> 3
//        |  +-----+   |
//   from o  | bay |   v 4
TEST_F(PathPlannerTest, PassesAboveAnObstacle) {
  const Vector3 from(-1, 0, 0.35);
  const Vector3 to(1, 0, 0.3);
  const Waypoints path = planner_.plan(from, to, kMargin);
  ASSERT_EQ(path.size(), 3U);
  EXPECT_EQ(path[0].head<2>(), from.head<2>());
  EXPECT_EQ(path[1].head<2>(), to.head<2>());
  EXPECT_GE(path[0].z(), 0.4 + kMargin - 1e-12) << "above its top";
  EXPECT_EQ(path[0].z(), path[1].z());
  EXPECT_EQ(path[2], to);
}

TEST_F(PathPlannerTest, PartsAreNoObstaclesAndShortOrVerticalPathsAreStraight) {
  EXPECT_EQ(planner_.plan({1.5, 0, 0.2}, {2.5, 0, 0.2}, kMargin).size(), 1U) << "a part lies in between";
  EXPECT_EQ(planner_.plan({0, 0, 0.5}, {0.01, 0, 0.2}, kMargin).size(), 1U) << "vertically into it";
  EXPECT_EQ(planner_.plan({0, 0, 0.2}, {0.03, 0, 0.2}, kMargin).size(), 1U)
      << "a short path within one pocket";
}

}  // namespace
}  // namespace tenon::simulated_person
