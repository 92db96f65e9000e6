#include "server/simulation/islands.h"

#include <array>
#include <memory>

#include <gtest/gtest.h>

#include "server/simulation/coll_pair.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::simulation {
namespace {

//   0 -- 1 -- (2 immovable) -- 3        4 -- 5
TEST(IslandPartition, AnImmovableBodyDoesNotConnectIslands) {
  IslandPartition partition(6);
  const std::array<std::uint8_t, 6> movable{1, 1, 0, 1, 1, 1};
  partition.reset(movable);
  const auto join = [&](std::uint32_t a, std::uint32_t b) { partition.join(ObjectId{a}, ObjectId{b}); };
  join(0, 1);
  join(1, 2);
  join(2, 3);
  join(4, 5);
  partition.assignIslands();
  EXPECT_EQ(partition.count(), 3U);
  EXPECT_EQ(partition.islandOf(ObjectId{0}), 0);
  EXPECT_EQ(partition.islandOf(ObjectId{1}), 0);
  EXPECT_EQ(partition.islandOf(ObjectId{2}), IslandPartition::kNone);
  EXPECT_EQ(partition.islandOf(ObjectId{3}), 1);
  EXPECT_EQ(partition.islandOf(ObjectId{4}), 2);
  EXPECT_EQ(partition.islandOf(ObjectId{5}), 2);
  EXPECT_EQ(partition.bodyIndexOf(ObjectId{5}), 1);
}

TEST(IslandPartition, NumberingIsIndependentOfTheOrderOfJoins) {
  constexpr std::array<std::array<std::uint32_t, 2>, 4> joins{{{0, 4}, {4, 2}, {1, 3}, {3, 5}}};
  const std::array<std::uint8_t, 6> movable{1, 1, 1, 1, 1, 1};
  for (std::size_t first = 0; first < joins.size(); ++first) {
    IslandPartition partition(6);
    partition.reset(movable);
    for (std::size_t i = 0; i < joins.size(); ++i) {
      const auto& join = joins[(first + i) % joins.size()];
      partition.join(ObjectId{join[i % 2]}, ObjectId{join[1 - i % 2]});
    }
    partition.assignIslands();
    ASSERT_EQ(partition.count(), 2U);
    for (std::uint32_t object = 0; object < 6; ++object) {
      EXPECT_EQ(partition.islandOf(ObjectId{object}), static_cast<std::int32_t>(object % 2));
      EXPECT_EQ(partition.bodyIndexOf(ObjectId{object}), static_cast<std::int32_t>(object / 2));
    }
  }
}

class CollPairTest : public testing::Test {
 protected:
  CollPairTest() {
    const ObjectId pointer = scene_.object("pointer", test::pointerShape(), {0.0, 0.0, 0.1});
    const ObjectId floor = scene_.object("floor", test::floorShape(), Vector3::Zero());
    scene_.pair(pointer, floor);
  }
  test::SmallScene scene_;
  ContactListPool contact_lists_{1};
  std::unique_ptr<collision::FeatureScratch> scratch_ = std::make_unique<collision::FeatureScratch>();
};

// The gap is 88 mm and must not go below 8 mm: 80 mm at 1 m/s are 80 ticks.
TEST_F(CollPairTest, IsNotDueWhileTheGapCannotHaveClosed) {
  const auto scene = scene_.build();
  CollPair pair(*scene, 0);
  pair.attachList(contact_lists_.acquire());
  EXPECT_TRUE(pair.due(1));
  pair.query(Pose(Vector3(0.0, 0.0, 0.1)), Pose(), 0.001, *scratch_);
  const double gap = pair.gap();
  ASSERT_GT(gap, 0.05);
  ASSERT_LT(gap, 0.0885);
  pair.schedule(10, 1.0, 0.008, 0.0);
  const auto ticks = static_cast<Tick>((gap - 0.008) / 1e-3);
  EXPECT_FALSE(pair.due(10 + ticks));
  EXPECT_TRUE(pair.due(10 + ticks + 1));
}

TEST_F(CollPairTest, IsPostponedByThePathNotMoved) {
  const auto scene = scene_.build();
  CollPair pair(*scene, 0);
  pair.attachList(contact_lists_.acquire());
  EXPECT_FALSE(pair.postpone(1, 1.0, 0.008, 0.0)) << "it has not been queried";
  pair.query(Pose(Vector3(0.0, 0.0, 0.1)), Pose(), 0.001, *scratch_);
  pair.schedule(10, 1.0, 0.008, 5.0);
  const Tick due = pair.dueTick();
  // a tenth of the possible path has been moved
  const double distance = pair.gap() - 0.008;
  ASSERT_TRUE(pair.postpone(due, 1.0, 0.008, 5.0 + 0.1 * distance));
  EXPECT_EQ(pair.dueTick(), due + static_cast<Tick>(0.9 * distance / 1e-3));
  EXPECT_FALSE(pair.postpone(pair.dueTick(), 1.0, 0.008, 5.0 + distance - 0.5e-3))
      << "the gap may close in the next tick";
}

TEST_F(CollPairTest, IsNeverDueForTwoImmovableObjects) {
  const auto scene = scene_.build();
  CollPair pair(*scene, 0);
  pair.attachList(contact_lists_.acquire());
  pair.query(Pose(), Pose(), 0.001, *scratch_);
  pair.schedule(10, 0.0, 0.008, 0.0);
  EXPECT_FALSE(pair.due(1000000000));
}

TEST_F(CollPairTest, ResetAndSwitchingMakeItDueAndDropItsContacts) {
  const auto scene = scene_.build();
  CollPair pair(*scene, 0);
  pair.attachList(contact_lists_.acquire());
  const auto query = [&] {
    pair.query(Pose(Vector3(0.0, 0.0, 0.01)), Pose(), 0.001, *scratch_);
    pair.schedule(10, 0.0, 0.008, 0.0);
    ASSERT_TRUE(pair.touching());
  };
  query();
  pair.reset();
  EXPECT_TRUE(pair.due(1));
  EXPECT_FALSE(pair.touching());
  EXPECT_EQ(pair.result(), nullptr);
  query();
  pair.setEnabled(false);
  pair.setEnabled(true);
  EXPECT_TRUE(pair.due(1));
  EXPECT_FALSE(pair.touching());
}

TEST(Scene, FindsObjectsHandsAndPairsInEitherOrder) {
  test::SmallScene small;
  const ObjectId a = small.object("a", nullptr, Vector3::Zero());
  const ObjectId b = small.object("b", nullptr, Vector3::Zero());
  const ObjectId c = small.object("c", nullptr, Vector3::Zero());
  const HandId right = small.hand("right", a);
  small.pair(b, a);
  const auto scene = small.build();
  EXPECT_EQ(scene->objectNamed("b"), b);
  EXPECT_FALSE(scene->objectNamed("d").valid());
  EXPECT_EQ(scene->handNamed("right"), right);
  EXPECT_FALSE(scene->handNamed("left").valid());
  EXPECT_EQ(scene->pairOf(a, b), 0);
  EXPECT_EQ(scene->pairOf(b, a), 0);
  EXPECT_EQ(scene->pairOf(a, c), -1);
}

}  // namespace
}  // namespace tenon::simulation
