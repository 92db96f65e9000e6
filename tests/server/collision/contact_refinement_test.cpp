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

namespace tenon {
namespace {

using test::baked;
using test::Chance;

std::vector<SurfaceTree::Triangle> trianglesOf(const TriangleMesh& mesh) {
  std::vector<SurfaceTree::Triangle> triangles;
  for (const auto& [a, b, c] : mesh.triangles) {
    triangles.push_back({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
  }
  return triangles;
}

TEST(SurfaceTree, FindsTheNearestPointOfAllTriangles) {
  const TriangleMesh mesh = test::together(test::torusMesh(0.03, 0.006, 48, 20), test::ballMesh(0.02, 3));
  const SurfaceTree tree(trianglesOf(mesh));
  const test::ExactDistance exact(mesh.vertices, mesh.triangles);
  Chance chance(3);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vector3 p = 0.05 * chance.vector();
    std::uint32_t budget = 1'000'000;
    const auto truth = exact.nearest(p);
    const auto found = tree.nearest(p, 0.2, budget);
    ASSERT_TRUE(found.found);
    ASSERT_NEAR(found.distance, truth.distance, 1e-12);
    ASSERT_NEAR((found.p_MQ - p).norm(), truth.distance, 1e-12);
    EXPECT_FALSE(tree.nearest(p, 0.99 * truth.distance, budget).found);
  }
}

TEST(SurfaceTree, GivesUpWhenItsBudgetIsSpentInsteadOfGuessing) {
  const SurfaceTree tree(trianglesOf(test::ballMesh(0.02, 4)));
  std::uint32_t budget = 100;
  EXPECT_FALSE(tree.nearest(Vector3::Zero(), 0.1, budget).found);  // all are as near
  EXPECT_EQ(budget, 0U);
}

//   +-------+        the wall between both boxes is no surface of the whole
//   |   |   |
//   +-------+
TEST(OuterSurface, LeavesOutWhatLiesInside) {
  const TriangleMesh mesh = test::together(test::boxMesh({-0.02, -0.02, -0.02}, {0.006, 0.02, 0.02}),
                                           test::boxMesh({-0.006, -0.02, -0.02}, {0.02, 0.02, 0.02}));
  const auto structures = baked(mesh, 0.002, 500);
  double area = 0.0;
  for (const auto& t : outerTriangles(trianglesOf(mesh), structures->field)) {
    const Vector3f middle = (t[0] + t[1] + t[2]) / 3.0F;
    EXPECT_GT(middle.cwiseAbs().maxCoeff(), 0.0193F);
    area += 0.5 * static_cast<double>((t[1] - t[0]).cross(t[2] - t[0]).norm());
  }
  // both boxes have the middle's four sides
  const double whole = 6.0 * 0.04 * 0.04 + 4.0 * 0.04 * 0.012;
  EXPECT_NEAR(area, whole, 0.02 * whole);
}

/// A small box with an edge in the edge of a large one.
class EdgeOnEdge : public ::testing::Test {
 protected:
  EdgeOnEdge() {
    query_.sum = true;
    query_.margin = 0.0005;
    queryPair(query_, *field_);
    refined_ = std::make_unique<PairQueryResult>(*field_);
  }

  RefinementCounts refine(const RefinementBudget& budget) {
    return refineContacts(query_, surface_, budget, *refined_);
  }

  TriangleMesh mesh_ = test::boxMesh({-0.02, -0.02, -0.02}, {0.02, 0.02, 0.02});
  std::shared_ptr<const HapticStructures> large_ = baked(mesh_, 0.002, 2000);
  std::shared_ptr<const HapticStructures> small_ =
      baked(test::boxMesh({-0.008, -0.008, -0.008}, {0.008, 0.008, 0.008}), 0.001, 3000);
  SurfaceTree surface_{outerTriangles(trianglesOf(mesh_), large_->field)};
  // 1.1 mm under both sides
  PairQuery query_{&small_->shell, &large_->field,
                   Pose(Vector3(0.0189 + 0.008, 0.0189 + 0.008, 0.003), Quaternion::Identity()), Pose()};
  std::unique_ptr<PairQueryResult> field_ = std::make_unique<PairQueryResult>();
  std::unique_ptr<PairQueryResult> refined_;
};

TEST_F(EdgeOnEdge, DepthsAreThoseOfThePlanesThatMeetThere) {
  ASSERT_GT(field_->contacts.size(), 10U);
  const RefinementCounts counts = refine({});
  EXPECT_GT(counts.contacts, 10U);
  double off = 0.0;
  std::uint32_t inside = 0;
  double sum = 0.0;
  for (std::size_t i = 0; i < refined_->contacts.size(); ++i) {
    const Contact& contact = refined_->contacts[i];
    if (contact.gap >= 0.0) continue;
    ++inside;
    const double truth = std::max(contact.p_WP.x(), contact.p_WP.y()) - 0.02;
    EXPECT_NEAR(contact.gap, truth, 2e-6);
    EXPECT_GT(contact.n_W.head<2>().maxCoeff(), 0.9999);
    off = std::max(off, std::abs(field_->contacts[i].gap - truth));
    sum += penaltyForce(contact, 1.0);
  }
  EXPECT_GT(off, 0.2e-3) << "the field alone was right, nothing was shown";
  EXPECT_EQ(refined_->counts.points_colliding, inside);
  EXPECT_NEAR(refined_->push_Ao_W.force.head<2>().lpNorm<1>(), sum, 1e-9);
  EXPECT_NEAR(refined_->deepest, 0.0011, 1e-5);
}

TEST_F(EdgeOnEdge, WorkStaysWithinItsBudgetAndTheDeepestComeFirst) {
  EXPECT_EQ(refine({.contacts = 5, .triangles = 100'000}).contacts, 5U);
  const auto few = std::make_unique<PairQueryResult>(*refined_);
  *refined_ = *field_;
  EXPECT_GT(refine({}).contacts, 5U);
  double deepest_left = 1.0;
  double shallowest_done = -1.0;
  for (std::size_t i = 0; i < field_->contacts.size(); ++i) {
    const double by_field = field_->contacts[i].gap;
    if (refined_->contacts[i].gap == by_field) continue;
    if (few->contacts[i].gap == by_field) {
      deepest_left = std::min(deepest_left, by_field);
    } else {
      shallowest_done = std::max(shallowest_done, by_field);
    }
  }
  EXPECT_LE(shallowest_done, deepest_left);

  *refined_ = *field_;
  EXPECT_LE(refine({.contacts = 100, .triangles = 60}).triangles, 60U);
}

TEST_F(EdgeOnEdge, AllocatesNothingAndGivesTheSameAgain) {
  (void)refine({});
  const auto first = std::make_unique<PairQueryResult>(*refined_);
  *refined_ = *field_;
  const test::RealtimeGuard guard;
  (void)refine({});
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
  EXPECT_EQ(refined_->push_Ao_W.force, first->push_Ao_W.force);
  EXPECT_EQ(refined_->smallest_gap, first->smallest_gap);
}

}  // namespace
}  // namespace tenon
