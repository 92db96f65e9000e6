#include <gtest/gtest.h>

#include "tests/server/collision/baked_pair.h"
#include "tests/support/test_meshes.h"

namespace tenon::collision {
namespace {

using test::baked;
using test::SeededRandom;
using BakedPtr = std::shared_ptr<const structures::HapticStructures>;

struct BakedPair {
  const char* name;
  BakedPtr a, b;
};

/// Overlapping solids, inconsistent triangle orientation, thin ribs, a refined region.
std::vector<BakedPair> bakedPairs() {
  const bake::TriangleMesh solids = test::randomlyFlipped(
      test::together(test::together(test::boxMesh({-0.03, -0.03, -0.01}, {0.03, 0.03, 0.01}),
                                    test::ballMesh(0.02, 3, {0.02, 0.01, 0.01})),
                     test::torusMesh(0.03, 0.006, 48, 20)),
      5);
  const BakedPtr tool = test::baked(test::boxMesh({-0.02, -0.01, -0.01}, {0.02, 0.01, 0.01}), 0.002, 2000);
  const BakedPtr bracket = test::baked(test::meshOf(test::partNamed("bracket", 0.1)), 0.003, 3000);
  const BakedPtr box = test::baked(test::meshOf(test::partNamed("control_box", 0.05)), 0.004, 3000);
  const BakedPtr hole =
      test::baked(test::meshOf(test::partNamed("box_with_hole", 0.1)), 0.005, 2000,
                  {bake::RefineBox{{Vector3(-0.04, -0.04, -0.1), Vector3(0.04, 0.04, 0.1)}}});
  const BakedPtr peg = test::baked(test::meshOf(test::partNamed("peg", 0.1)), 0.003, 2000);
  return {{"tool and solids", tool, test::baked(solids, 0.002, 2000)},
          {"bracket and control box", bracket, box},
          {"control box and bracket", box, bracket},
          {"peg and refined hole", peg, hole}};
}

TEST(BakedQuery, ListsTheSameContactsAsTestingEveryPoint) {
  test::SeededRandom random(41);
  const auto pruned = std::make_unique<PairQueryResult>();
  const auto unpruned = std::make_unique<PairQueryResult>();
  for (const BakedPair& pair : bakedPairs()) {
    std::size_t found = 0;
    for (int trial = 0; trial < 1000; ++trial) {
      const Pose X_BA = test::randomContactPose(*pair.a, *pair.b, 0.002 * random.symmetric(), 1.0, random);
      PairQuery query{&pair.a->shell, &pair.b->field, X_BA, Pose(), 0.001};
      query.sum_penalty = true;
      query.correct_ridges = trial % 2 == 0;
      queryPair(query, *pruned);
      query.prune = false;
      queryPair(query, *unpruned);
      ASSERT_EQ(pruned->counts.points_colliding, unpruned->counts.points_colliding)
          << pair.name << ", trial " << trial;
      ASSERT_EQ(pruned->contacts.size(), unpruned->contacts.size()) << pair.name << ", trial " << trial;
      for (std::size_t i = 0; i < unpruned->contacts.size(); ++i) {
        ASSERT_EQ(pruned->contacts[i].point, unpruned->contacts[i].point);
        ASSERT_EQ(pruned->contacts[i].gap, unpruned->contacts[i].gap);
      }
      ASSERT_EQ(pruned->penalty_Ao_W.force, unpruned->penalty_Ao_W.force);
      ASSERT_EQ(pruned->penalty_Ao_W.torque, unpruned->penalty_Ao_W.torque);
      // beyond the margin both are lower bounds, which may differ
      if (unpruned->smallest_gap <= query.margin) {
        ASSERT_EQ(pruned->smallest_gap, unpruned->smallest_gap);
      }
      found += unpruned->contacts.size();
    }
    EXPECT_GT(found, 1000U) << pair.name;
  }
}

}  // namespace
}  // namespace tenon::collision
