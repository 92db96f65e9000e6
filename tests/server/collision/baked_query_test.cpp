#include <gtest/gtest.h>

#include "tests/server/collision/baked_pair.h"
#include "tests/support/test_meshes.h"

namespace tenon {
namespace {

using test::baked;
using test::Chance;
using StructuresPtr = std::shared_ptr<const HapticStructures>;

struct BakedPair {
  const char* name;
  StructuresPtr a, b;
};

/// Overlapping solids, triangles that face any way, thin ribs, a part of finer voxels.
std::vector<BakedPair> bakedPairs() {
  const TriangleMesh solids = test::randomlyFlipped(
      test::together(test::together(test::boxMesh({-0.03, -0.03, -0.01}, {0.03, 0.03, 0.01}),
                                    test::ballMesh(0.02, 3, {0.02, 0.01, 0.01})),
                     test::torusMesh(0.03, 0.006, 48, 20)),
      5);
  const StructuresPtr tool = baked(test::boxMesh({-0.02, -0.01, -0.01}, {0.02, 0.01, 0.01}), 0.002, 2000);
  const StructuresPtr bracket = baked(test::meshOf(test::partNamed("bracket", 0.1)), 0.003, 3000);
  const StructuresPtr box = baked(test::meshOf(test::partNamed("control_box", 0.05)), 0.004, 3000);
  const StructuresPtr hole = baked(test::meshOf(test::partNamed("box_with_hole", 0.1)), 0.005, 2000,
                                   {RefineBox{{Vector3(-0.04, -0.04, -0.1), Vector3(0.04, 0.04, 0.1)}}});
  const StructuresPtr peg = baked(test::meshOf(test::partNamed("peg", 0.1)), 0.003, 2000);
  return {{"tool and solids", tool, baked(solids, 0.002, 2000)},
          {"bracket and control box", bracket, box},
          {"control box and bracket", box, bracket},
          {"peg and refined hole", peg, hole}};
}

TEST(BakedQuery, FindsContactForContactWhatTheFlatLoopFinds) {
  Chance chance(41);
  const auto pruned = std::make_unique<PairQueryResult>();
  const auto flat = std::make_unique<PairQueryResult>();
  for (const BakedPair& pair : bakedPairs()) {
    std::size_t found = 0;
    for (int trial = 0; trial < 1000; ++trial) {
      const Pose X_BA = test::pressedSomewhere(*pair.a, *pair.b, 0.002 * chance.number(), 1.0, chance);
      PairQuery query{&pair.a->shell, &pair.b->field, X_BA, Pose(), 0.0004, 0.0006};
      query.sum = true;
      query.straighten = trial % 2 == 0;
      queryPair(query, *pruned);
      query.prune = false;
      queryPair(query, *flat);
      ASSERT_EQ(pruned->counts.points_colliding, flat->counts.points_colliding)
          << pair.name << ", trial " << trial;
      ASSERT_EQ(pruned->contacts.size(), flat->contacts.size()) << pair.name << ", trial " << trial;
      for (std::size_t i = 0; i < flat->contacts.size(); ++i) {
        ASSERT_EQ(pruned->contacts[i].point, flat->contacts[i].point);
        ASSERT_EQ(pruned->contacts[i].gap, flat->contacts[i].gap);
      }
      ASSERT_EQ(pruned->push_Ao_W.force, flat->push_Ao_W.force);
      ASSERT_EQ(pruned->push_Ao_W.torque, flat->push_Ao_W.torque);
      // beyond the margin both are bounds
      if (flat->smallest_gap <= query.margin) {
        ASSERT_EQ(pruned->smallest_gap, flat->smallest_gap);
      }
      found += flat->contacts.size();
    }
    EXPECT_GT(found, 1000U) << pair.name;
  }
}

}  // namespace
}  // namespace tenon
