#include "server/bake/welded_mesh.h"

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
