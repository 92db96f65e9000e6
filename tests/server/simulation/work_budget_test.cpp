#include "server/simulation/work_budget.h"

#include <memory>

#include <gtest/gtest.h>

#include "tests/server/simulation/small_scene.h"

namespace tenon::simulation {
namespace {

using test::cubeShape;

struct BudgetScene {
  BudgetScene() {
    const ObjectId fine = small.object("fine", test::boxStructures({0.1, 0.1, 0.1}, 0.005, 0.002), {0, 0, 0});
    const ObjectId coarse =
        small.object("coarse", test::boxStructures({0.1, 0.1, 0.1}, 0.005, 0.01), {1, 0, 0});
    const ObjectId little = small.object("little", test::cubeShape(), {0, 1, 0});
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
  ContactListPool contact_lists{3};
  std::unique_ptr<collision::FeatureScratch> scratch = std::make_unique<collision::FeatureScratch>();
};

TEST(WorkBudget, WorstCaseCountsPointsOnTheSurfaceThatFitsIntoTheOtherBox) {
  const BudgetScene setup;
  const WorkBudget budget(*setup.scene, 3);
  const auto points = [&](std::size_t pair) {
    return static_cast<double>(
        setup.scene->objects[setup.scene->pairs[pair].a.value].structures->shell.points().size());
  };
  EXPECT_GT(budget.worstCase(0), 20.0 * budget.worstCase(1)) << "25 times as many points on the same surface";
  // the small cube is smaller than the fine one; its field extends slightly beyond it
  EXPECT_LT(budget.worstCase(2), 0.8 * points(2));
  EXPECT_GT(budget.worstCase(2), 0.1 * points(2));
}

TEST(WorkBudget, BudgetsAddUpToTheBudgetOfTheTick) {
  const BudgetScene setup;
  WorkBudget budget(*setup.scene, 3);
  const std::vector<std::uint32_t> due{0, 1, 2};
  WorkLimits limits;
  limits.points = 10'000;
  budget.distribute(limits, due, setup.pairs);
  EXPECT_LE(budget.pointsFor(0) + budget.pointsFor(1) + budget.pointsFor(2), 10'000U);
  EXPECT_GE(budget.pointsFor(0) + budget.pointsFor(1) + budget.pointsFor(2), 9'990U);
  EXPECT_GT(budget.pointsFor(0), 10 * budget.pointsFor(1));
  budget.distribute({}, due, setup.pairs);
  EXPECT_EQ(budget.pointsFor(0), WorkBudget::kUnlimited);
}

TEST(WorkBudget, APairWithSmallLoadLeavesBudgetToTheOthers) {
  BudgetScene setup;
  WorkBudget budget(*setup.scene, 3);
  const std::vector<std::uint32_t> due{0, 2};
  WorkLimits limits;
  limits.points = 10'000;
  budget.distribute(limits, due, setup.pairs);
  const std::uint32_t before = budget.pointsFor(1);
  // the first pair has been queried far from the floor: its load is small
  setup.pairs[0].attachList(setup.contact_lists.acquire());
  setup.pairs[0].query(Pose(Vector3(0.0, 0.0, 1.0)), Pose(), 0.001, *setup.scratch);
  budget.distribute(limits, due, setup.pairs);
  EXPECT_GT(budget.pointsFor(1), 2 * before);
  EXPECT_GT(budget.pointsFor(0), 0U) << "enough to detect new contact";
}

}  // namespace
}  // namespace tenon::simulation
