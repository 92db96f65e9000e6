#include "server/simulation/work_budget.h"

#include <gtest/gtest.h>

#include "tests/server/simulation/small_scene.h"

namespace tenon {
namespace {

using test::cubeShape;

struct Rig {
  Rig() {
    const ObjectId fine = small.object("fine", test::boxStructures({0.1, 0.1, 0.1}, 0.005, 0.002), {0, 0, 0});
    const ObjectId coarse =
        small.object("coarse", test::boxStructures({0.1, 0.1, 0.1}, 0.005, 0.01), {1, 0, 0});
    const ObjectId little = small.object("little", cubeShape(), {0, 1, 0});
    const ObjectId floor = small.object("floor", test::floorShape(), {0, 0, -1});
    small.pair(fine, floor);
    small.pair(coarse, floor);
    small.pair(fine, little);
    scene = small.build();
    for (std::size_t i = 0; i < scene->pairs.size(); ++i) pairs.emplace_back(*scene, i);
  }
  test::SmallScene small;
  std::shared_ptr<const Scene> scene;
  std::vector<CollPair> pairs;
  ContactRooms rooms{3};
};

TEST(WorkBudget, TheWorstCaseIsTheSkinThatFitsIntoTheOther) {
  const Rig rig;
  const WorkBudget budget(*rig.scene, 3);
  const auto points = [&](std::size_t pair) {
    return static_cast<double>(
        rig.scene->objects[rig.scene->pairs[pair].a.value].structures->shell.points().size());
  };
  EXPECT_GT(budget.worstCase(0), 20.0 * budget.worstCase(1)) << "25 times as many points on the same skin";
  // the little cube is less wide, though its field reaches a little beyond it
  EXPECT_LT(budget.worstCase(2), 0.8 * points(2));
  EXPECT_GT(budget.worstCase(2), 0.1 * points(2));
}

TEST(WorkBudget, SharesNeverExceedWhatThereIs) {
  const Rig rig;
  WorkBudget budget(*rig.scene, 3);
  const std::vector<std::uint32_t> due{0, 1, 2};
  WorkLimits limits;
  limits.points = 10'000;
  budget.share(limits, due, rig.pairs);
  EXPECT_LE(budget.of(0) + budget.of(1) + budget.of(2), 10'000U);
  EXPECT_GE(budget.of(0) + budget.of(1) + budget.of(2), 9'990U);
  EXPECT_GT(budget.of(0), 10 * budget.of(1));
  budget.share({}, due, rig.pairs);
  EXPECT_EQ(budget.of(0), WorkBudget::kUnlimited);
}

TEST(WorkBudget, WhoHardlyTouchesLeavesItsShareToTheOthers) {
  Rig rig;
  WorkBudget budget(*rig.scene, 3);
  const std::vector<std::uint32_t> due{0, 2};
  WorkLimits limits;
  limits.points = 10'000;
  budget.share(limits, due, rig.pairs);
  const std::uint32_t before = budget.of(1);
  // the first is far from the floor now, and was looked at
  rig.pairs[0].moveIn(rig.rooms.take());
  rig.pairs[0].query(Pose(Vector3(0.0, 0.0, 1.0)), Pose(), 0.001);
  budget.share(limits, due, rig.pairs);
  EXPECT_GT(budget.of(1), 2 * before);
  EXPECT_GT(budget.of(0), 0U) << "enough to notice a touch";
}

}  // namespace
}  // namespace tenon
