#include "server/collision/feature_query.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/structures/shell_builder.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/analytic_structures.h"
#include "tests/support/test_meshes.h"

namespace tenon::collision {
namespace {

/// Bars of 60 mm along x (A, an edge down) and along y (B, an edge up), 10 mm square.
class FeatureQuery : public ::testing::Test {
 protected:
  FeatureQuery() {
    a_ = bar(Vector3::UnitX());
    b_ = bar(Vector3::UnitY());
  }

  static std::shared_ptr<const structures::HapticStructures> bar(const Vector3& along) {
    const Vector3 half = Vector3::Constant(0.005) + 0.025 * along;
    bake::TriangleMesh mesh = test::boxMesh(-half, half);
    const Quaternion q = expRotation(along * 0.7853981633974483);
    for (Vector3f& p : mesh.vertices) p = (q * p.cast<double>()).cast<float>();
    return test::baked(mesh, 0.001, 2000);
  }

  /// A's lowest edge is `gap` [m] above B's highest.
  void query(double gap, const Vector3& off = Vector3::Zero()) {
    query_ = {&a_->shell, &b_->field, Pose(Vector3(0.0, 0.0, 2.0 * kEdge + gap) + off), Pose(), 0.001};
    queryPair(query_, *result_);
    queryFeatures(query_, features_, *scratch_, *result_);
  }
  [[nodiscard]] std::vector<Contact> crossings() const {
    std::vector<Contact> list;
    std::copy_if(
        result_->contacts.begin(), result_->contacts.end(), std::back_inserter(list),
        [](const Contact& one) { return one.kind == ContactKind::kCrossing && one.gap < kDormantGap; });
    return list;
  }

  static constexpr double kEdge = 0.0070710678118654752;  // [m] from a bar's axis
  std::shared_ptr<const structures::HapticStructures> a_, b_;
  PairFeatures features_;
  PairQuery query_;
  std::unique_ptr<PairQueryResult> result_ = std::make_unique<PairQueryResult>();
  std::unique_ptr<FeatureScratch> scratch_ = std::make_unique<FeatureScratch>();

  void SetUp() override { features_ = {&a_->features, &b_->features, &a_->field, 0.0}; }
};

TEST_F(FeatureQuery, FindsTheOneCrossingOfTwoEdges) {
  for (const double gap : {0.0007, 0.0, -0.0002}) {
    query(gap, {0.0011, -0.0007, 0.0});
    const auto found = crossings();
    ASSERT_EQ(found.size(), 1U) << gap;
    EXPECT_NEAR(found[0].gap, gap, 1e-7);
    EXPECT_NEAR(found[0].n_W.z(), 1.0, 1e-6) << "from B into A";
    EXPECT_NEAR((found[0].p_WP - Vector3(0.0, -0.0007, kEdge + gap)).norm(), 0.0, 1e-6);
    EXPECT_LE(result_->smallest_gap, gap + 1e-7);
  }
}

TEST_F(FeatureQuery, ResamplingFollowsTheCrossing) {
  query(0.0004);
  query_.X_WA.translation() += Vector3(0.0002, 0.0003, -0.0003);
  resampleFeatures(query_, features_, 0.0006, *scratch_, *result_);
  const auto found = crossings();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].gap, 0.0001, 1e-7);
  EXPECT_NEAR(found[0].p_WP.y(), 0.0003, 1e-6);
}

TEST_F(FeatureQuery, BoundsWhatItDoesNotList) {
  for (const double gap : {0.002, 0.004, 0.01, 0.05}) {
    query(gap);
    EXPECT_TRUE(crossings().empty());
    EXPECT_LE(result_->smallest_gap, gap + 1e-6) << "a bound";
    EXPECT_GE(result_->smallest_gap, std::min(query_.margin, gap - 0.004) - 1e-6) << "not needlessly low";
  }
}

TEST_F(FeatureQuery, EdgesBesideFacesDoNotCross) {
  // A's bar lies with a face on B's edge: points hold it, and no edge of A crosses within the face
  query_ = {&a_->shell, &b_->field,
            Pose(Vector3(0.0, 0.0, kEdge + 0.005 + 0.0002), expRotation({0.7853981633974483, 0.0, 0.0})),
            Pose(), 0.001};
  queryPair(query_, *result_);
  queryFeatures(query_, features_, *scratch_, *result_);
  for (const Contact& one : crossings()) EXPECT_NEAR(one.gap, 0.0002, 1e-6) << "at the face's borders";
}

// A shell of one level with many clusters is descended by blocks of them.
TEST(BlocksOfClusters, ListTheSameContactsAsTestingEveryPoint) {
  const auto samples = test::boxSamples({0.6, 0.5, 0.4}, 0.006);
  std::vector<std::uint32_t> order;
  const structures::Pointshell shell =
      structures::makeShell(structures::buildFlatShell(samples, 0.006, order));
  ASSERT_FALSE(shell.blockSpheres().empty());
  const auto ball = test::sphereStructures(0.05, 0.004, 0.01);
  const auto pruned = std::make_unique<PairQueryResult>();
  const auto unpruned = std::make_unique<PairQueryResult>();
  test::SeededRandom random(7);
  std::size_t contacts = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Vector3 p(0.3 * random.symmetric(), 0.25 * random.symmetric(), 0.25 + 0.02 * random.symmetric());
    PairQuery query{&shell, &ball->field, Pose(), Pose(p), 0.001};
    queryPair(query, *pruned);
    query.prune = false;
    queryPair(query, *unpruned);
    ASSERT_EQ(pruned->contacts.size(), unpruned->contacts.size()) << trial;
    for (std::size_t i = 0; i < unpruned->contacts.size(); ++i)
      ASSERT_EQ(pruned->contacts[i].point, unpruned->contacts[i].point);
    EXPECT_LE(pruned->smallest_gap, unpruned->smallest_gap);
    EXPECT_LT(pruned->counts.points_visited, unpruned->counts.points_visited);
    EXPECT_LE(pruned->counts.spheres_visited, pruned->counts.spheres_total);
    contacts += unpruned->contacts.size();
  }
  EXPECT_GT(contacts, 100U);
}

}  // namespace
}  // namespace tenon::collision
