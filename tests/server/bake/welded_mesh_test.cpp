#include "server/bake/welded_mesh.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

TriangleMesh without(TriangleMesh mesh, std::initializer_list<int> missing) {
  for (auto i = std::rbegin(missing); i != std::rend(missing); ++i) {
    mesh.triangles.erase(mesh.triangles.begin() + *i);
  }
  return mesh;
}

TEST(WeldedMesh, ClosesAHoleOfOneTriangle) {
  const TriangleMesh box = test::boxMesh(Vector3::Zero(), Vector3::Ones());
  for (int missing = 0; missing < 12; ++missing) {
    const WeldedMesh mesh(without(box, {missing}));
    EXPECT_EQ(mesh.closed, 1U);
    EXPECT_EQ(mesh.triangles.size(), 12U);
    EXPECT_TRUE(std::ranges::none_of(
        mesh.sharpEdges(), [](const auto& edge) { return edge.second == WeldedMesh::Edge::kNone; }));
  }
}

TEST(WeldedMesh, DoesNotCloseLargerOpenings) {
  const TriangleMesh box = test::boxMesh(Vector3::Zero(), Vector3::Ones());
  EXPECT_EQ(WeldedMesh(box).closed, 0U);
  EXPECT_EQ(WeldedMesh(without(box, {2, 3})).closed, 0U);  // no lid
  EXPECT_EQ(WeldedMesh(test::sheetMesh(0.05, 0.0, 4)).closed, 0U);
  TriangleMesh corner;  // three faces of a tetrahedron
  corner.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  corner.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
  EXPECT_EQ(WeldedMesh(corner).closed, 0U);
  corner.triangles = {{1, 2, 3}};
  EXPECT_EQ(WeldedMesh(corner).closed, 0U);
}

TEST(WeldedMesh, ClosesTheSameHolesForAnyWinding) {
  TriangleMesh ball = test::ballMesh(0.05, 4);
  std::size_t number = 0;
  std::erase_if(ball.triangles, [&](const auto&) { return ++number % 53 == 0; });
  const WeldedMesh plain(ball);
  const WeldedMesh flipped(test::randomlyFlipped(ball, 3));
  EXPECT_GT(plain.closed, 80U);
  EXPECT_EQ(plain.corners, flipped.corners);
}

std::size_t openEdges(const WeldedMesh& mesh) {
  return static_cast<std::size_t>(std::ranges::count_if(
      mesh.edges(), [](const auto& edge) { return edge.second == WeldedMesh::Edge::kNone; }));
}

/// Each triangle has vertices of its own, which differ from those of its neighbours by up to `by` [m].
TriangleMesh perturbed(const TriangleMesh& mesh, float by) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> any(-by, by);
  TriangleMesh apart;
  for (const auto& triangle : mesh.triangles) {
    const auto first = static_cast<std::uint32_t>(apart.vertices.size());
    for (const std::uint32_t v : triangle)
      apart.vertices.emplace_back(mesh.vertices[v] + Vector3f(any(random), any(random), any(random)));
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  return apart;
}

TEST(WeldedMesh, VerticesThatDifferByRoundingAreOne) {
  const TriangleMesh ball = test::ballMesh(0.05, 3);
  const WeldedMesh whole(ball);
  const WeldedMesh mesh(perturbed(ball, 1e-6F));
  EXPECT_EQ(mesh.triangles.size(), whole.triangles.size());
  EXPECT_EQ(openEdges(mesh), 0U);
  EXPECT_EQ(mesh.components().second, 1U);
  for (std::size_t i = 0; i < mesh.winding.size(); ++i) EXPECT_EQ(std::abs(mesh.winding[i]), 1);
  // what is farther apart stays so, but for chance
  EXPECT_LT(WeldedMesh(perturbed(ball, 1e-4F)).joined, 10U);
}

TEST(WeldedMesh, AFaceIsSplitWhereAVertexOfAnotherIsOnItsEdge) {
  TriangleMesh box = test::boxMesh(Vector3::Zero(), Vector3(0.03, 0.02, 0.01));
  // two vertices on each triangle's first edge and one on its second, without its neighbours
  std::vector<std::array<std::uint32_t, 3>> all;
  for (const auto& [a, b, c] : box.triangles) {
    const auto first = static_cast<std::uint32_t>(box.vertices.size());
    const Vector3f ab = box.vertices[b] - box.vertices[a];
    box.vertices.emplace_back(box.vertices[a] + 0.25F * ab);
    box.vertices.emplace_back(box.vertices[a] + 0.7F * ab);
    box.vertices.emplace_back(0.4F * box.vertices[b] + 0.6F * box.vertices[c]);
    all.push_back({a, first, c});
    all.push_back({first, first + 1, c});
    all.push_back({first + 1, b, first + 2});
    all.push_back({first + 1, first + 2, c});
  }
  box.triangles = all;
  const WeldedMesh mesh(box);
  EXPECT_GT(mesh.split, 10U);
  EXPECT_EQ(openEdges(mesh), 0U);
  double area = 0.0;
  Vector3 closed = Vector3::Zero();
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& [a, b, c] = mesh.triangles[i];
    area += structures::areaOf(mesh.triangles[i]);
    closed += 0.5 * mesh.winding[i] * (b - a).cross(c - a);
  }
  EXPECT_NEAR(area, 2.0 * (0.03 * 0.02 + 0.02 * 0.01 + 0.01 * 0.03), 1e-9);
  EXPECT_LT(closed.norm(), 1e-9) << "all parts are wound as their triangle was";
}

// triangles with a common vertex must not be compared pairwise
TEST(WeldedMesh, AFanOfUnconnectedTrianglesTakesNoQuadraticTime) {
  TriangleMesh fan;
  fan.vertices.emplace_back(9.0F, 9.0F, 9.0F);
  for (int i = 0; i < 200'000; ++i) {
    const auto x = static_cast<float>(i) * 1e-5F;
    fan.vertices.emplace_back(x, 0.0F, 0.0F);
    fan.vertices.emplace_back(x, 1e-3F, 0.0F);
    const auto first = static_cast<std::uint32_t>(2 * i + 1);
    fan.triangles.push_back({0, first, first + 1});
  }
  EXPECT_EQ(WeldedMesh(fan).closed, 0U);
}

}  // namespace
}  // namespace tenon::bake
