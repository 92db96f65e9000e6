#include "server/collision/contact_refinement.h"

#include <algorithm>
#include <memory>

#include <gtest/gtest.h>

#include "server/bake/surface_import.h"
#include "server/structures/outer_surface.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/exact_distance.h"
#include "tests/support/realtime_guard.h"
#include "tests/support/test_meshes.h"

namespace tenon::collision {
namespace {

using test::baked;
using test::SeededRandom;

std::vector<structures::SurfaceTree::Triangle> trianglesOf(const bake::TriangleMesh& mesh) {
  std::vector<structures::SurfaceTree::Triangle> triangles;
  for (const auto& [a, b, c] : mesh.triangles) {
    triangles.push_back({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
  }
  return triangles;
}

TEST(SurfaceTree, ReturnsTheNearestPointOfAllTriangles) {
  const bake::TriangleMesh mesh =
      test::together(test::torusMesh(0.03, 0.006, 48, 20), test::ballMesh(0.02, 3));
  const structures::SurfaceTree tree(trianglesOf(mesh));
  const test::ExactDistance exact(mesh.vertices, mesh.triangles);
  test::SeededRandom random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vector3 p = 0.05 * random.vector();
    std::uint32_t budget = 1'000'000;
    const auto truth = exact.nearest(p);
    const auto found = tree.nearest(p, 0.2, budget);
    ASSERT_TRUE(found.found);
    ASSERT_NEAR(found.distance, truth.distance, 1e-12);
    ASSERT_NEAR((found.p_MQ - p).norm(), truth.distance, 1e-12);
    EXPECT_FALSE(tree.nearest(p, 0.99 * truth.distance, budget).found);
  }
}

TEST(SurfaceTree, ReportsNotFoundWhenTheBudgetIsExhausted) {
  const structures::SurfaceTree tree(trianglesOf(test::ballMesh(0.02, 4)));
  std::uint32_t budget = 100;
  EXPECT_FALSE(tree.nearest(Vector3::Zero(), 0.1, budget).found);  // all triangles are at the same distance
  EXPECT_EQ(budget, 0U);
}

//   +-------+        the faces where the boxes overlap are not surface of the union
//   |   |   |
//   +-------+
TEST(OuterSurface, ExcludesInteriorTriangles) {
  const bake::TriangleMesh mesh = test::together(test::boxMesh({-0.02, -0.02, -0.02}, {0.006, 0.02, 0.02}),
                                                 test::boxMesh({-0.006, -0.02, -0.02}, {0.02, 0.02, 0.02}));
  const auto structures = test::baked(mesh, 0.002, 500);
  double area = 0.0;
  for (const auto& t : structures::outerTriangles(trianglesOf(mesh), structures->field)) {
    const Vector3f middle = (t[0] + t[1] + t[2]) / 3.0F;
    EXPECT_GT(middle.cwiseAbs().maxCoeff(), 0.0193F);
    area += 0.5 * static_cast<double>((t[1] - t[0]).cross(t[2] - t[0]).norm());
  }
  // in the overlap both boxes have the four sides
  const double whole = 6.0 * 0.04 * 0.04 + 4.0 * 0.04 * 0.012;
  EXPECT_NEAR(area, whole, 0.02 * whole);
}

/// A small box whose edge penetrates an edge of a large one.
class EdgeOnEdge : public ::testing::Test {
 protected:
  EdgeOnEdge() {
    query_.sum_penalty = true;
    query_.margin = 0.0005;
    queryPair(query_, *field_);
    refined_ = std::make_unique<PairQueryResult>(*field_);
  }

  RefinementCounts refine(const RefinementBudget& budget) {
    return refineContacts(query_, surface_, budget, *refined_);
  }

  bake::TriangleMesh mesh_ = test::boxMesh({-0.02, -0.02, -0.02}, {0.02, 0.02, 0.02});
  std::shared_ptr<const structures::HapticStructures> large_ = test::baked(mesh_, 0.002, 2000);
  std::shared_ptr<const structures::HapticStructures> small_ =
      test::baked(test::boxMesh({-0.008, -0.008, -0.008}, {0.008, 0.008, 0.008}), 0.001, 3000);
  structures::SurfaceTree surface_{structures::outerTriangles(trianglesOf(mesh_), large_->field)};
  // 1.1 mm deep from both faces
  PairQuery query_{&small_->shell, &large_->field,
                   Pose(Vector3(0.0189 + 0.008, 0.0189 + 0.008, 0.003), Quaternion::Identity()), Pose()};
  std::unique_ptr<PairQueryResult> field_ = std::make_unique<PairQueryResult>();
  std::unique_ptr<PairQueryResult> refined_;
};

TEST_F(EdgeOnEdge, RefinedDepthsAreThoseOfTheFacesThatMeetAtTheEdge) {
  ASSERT_GT(field_->contacts.size(), 10U);
  const RefinementCounts counts = refine({});
  EXPECT_GT(counts.contacts, 10U);
  double largest_error = 0.0;
  std::uint32_t inside = 0;
  double sum = 0.0;
  for (std::size_t i = 0; i < refined_->contacts.size(); ++i) {
    const Contact& contact = refined_->contacts[i];
    if (contact.gap >= 0.0) continue;
    ++inside;
    const double truth = std::max(contact.p_WP.x(), contact.p_WP.y()) - 0.02;
    EXPECT_NEAR(contact.gap, truth, 2e-6);
    EXPECT_GT(contact.n_W.head<2>().maxCoeff(), 0.9999);
    largest_error = std::max(largest_error, std::abs(field_->contacts[i].gap - truth));
    sum += penaltyForce(contact, 1.0);
  }
  EXPECT_GT(largest_error, 0.2e-3) << "the field alone is accurate here: the test shows nothing";
  EXPECT_EQ(refined_->counts.points_colliding, inside);
  EXPECT_NEAR(refined_->penalty_Ao_W.force.head<2>().lpNorm<1>(), sum, 1e-9);
  EXPECT_NEAR(refined_->deepest, 0.0011, 1e-5);
}

TEST_F(EdgeOnEdge, WorkIsLimitedByTheBudgetAndDeepestContactsComeFirst) {
  EXPECT_EQ(refine({.contacts = 5, .triangles = 100'000}).contacts, 5U);
  const auto few = std::make_unique<PairQueryResult>(*refined_);
  *refined_ = *field_;
  EXPECT_GT(refine({}).contacts, 5U);
  double deepest_unrefined = 1.0;
  double shallowest_refined = -1.0;
  for (std::size_t i = 0; i < field_->contacts.size(); ++i) {
    const double field_gap = field_->contacts[i].gap;
    if (refined_->contacts[i].gap == field_gap) continue;
    if (few->contacts[i].gap == field_gap) {
      deepest_unrefined = std::min(deepest_unrefined, field_gap);
    } else {
      shallowest_refined = std::max(shallowest_refined, field_gap);
    }
  }
  EXPECT_LT(deepest_unrefined, 0.0) << "some are not refined";
  EXPECT_GT(shallowest_refined, -0.01) << "some are";
  EXPECT_LE(shallowest_refined, deepest_unrefined);

  *refined_ = *field_;
  EXPECT_LE(refine({.contacts = 100, .triangles = 60}).triangles, 60U);
}

TEST_F(EdgeOnEdge, AllocatesNothingAndIsRepeatable) {
  (void)refine({});
  const auto first = std::make_unique<PairQueryResult>(*refined_);
  *refined_ = *field_;
  const test::RealtimeGuard guard;
  (void)refine({});
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
  EXPECT_EQ(refined_->penalty_Ao_W.force, first->penalty_Ao_W.force);
  EXPECT_EQ(refined_->smallest_gap, first->smallest_gap);
}

}  // namespace
}  // namespace tenon::collision
