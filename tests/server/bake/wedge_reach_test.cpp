#include "server/bake/wedge_reach.h"

#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

constexpr double kMost = 0.006;        // [m]
constexpr double kTolerance = 5e-5;    // [m]
const Vector3 kHalf(0.002, 0.0, 0.0);  // [m] pieces are along x

std::vector<structures::Triangle> trianglesOf(const TriangleMesh& mesh) {
  std::vector<structures::Triangle> triangles;
  for (const auto& [a, b, c] : mesh.triangles)
    triangles.push_back(
        {mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(), mesh.vertices[c].cast<double>()});
  return triangles;
}

/// Of the upper edge at y = 0 of what is below z = 0 and beyond y > 0.
double reachOf(const TriangleMesh& mesh, const Vector3& centre = Vector3::Zero(),
               const std::array<Vector3, 2>& into = {Vector3::UnitY(), -Vector3::UnitZ()}) {
  const TriangleTree tree(trianglesOf(mesh), 0.01);
  return WedgeReach(tree).of({centre, kHalf, into}, kMost, kTolerance);
}

TEST(WedgeReach, EndsAtTheFarSideOfAPlate) {
  EXPECT_NEAR(reachOf(test::boxMesh({-0.05, 0.0, -0.001}, {0.05, 0.1, 0.0})), 0.001, 1e-6) << "1 mm thick";
  EXPECT_NEAR(reachOf(test::boxMesh({-0.05, 0.0, -0.1}, {0.05, 0.1, 0.0})), kMost, 1e-9) << "thick";
  EXPECT_NEAR(reachOf(test::boxMesh({-0.05, 0.0, -0.1}, {0.05, 0.003, 0.0})), 0.003, 1e-6) << "a rib";
}

TEST(WedgeReach, DoesNotCountTheFacesAtTheEndsOfItsPiece) {
  // the piece ends where the box does
  EXPECT_NEAR(reachOf(test::boxMesh({-0.05, 0.0, -0.1}, {0.002, 0.1, 0.0})), kMost, 1e-9);
}

TEST(WedgeReach, EndsAtAnotherPart) {
  const TriangleMesh box = test::boxMesh({-0.05, 0.0, -0.1}, {0.05, 0.1, 0.0});
  const auto beside = [&](double y) {
    return test::together(box, test::boxMesh({0.0005, y - 0.01, -0.004}, {0.001, y, 0.004}));
  };
  EXPECT_NEAR(reachOf(beside(-0.002)), 0.002, 1e-6);
  EXPECT_NEAR(reachOf(beside(0.001)), 0.0, 1e-9) << "the edge passes through it";
  EXPECT_NEAR(reachOf(beside(-0.002), {-0.01, 0.0, 0.0}), kMost, 1e-9) << "beyond the end of the piece";
}

//  ___
//     \ 1.4 mm at 45 degrees
//      |
TEST(WedgeReach, EndsAtTheNextEdgeOfAChamfer) {
  TriangleMesh mesh;
  const auto quad = [&mesh](const Vector3& a, const Vector3& b) {  // along x, between two lines
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const double x : {-0.05, 0.05})
      for (const Vector3& p : {a, b}) mesh.vertices.push_back((p + Vector3(x, 0.0, 0.0)).cast<float>());
    mesh.triangles.push_back({first, first + 1, first + 3});
    mesh.triangles.push_back({first, first + 3, first + 2});
  };
  quad({0.0, 0.1, 0.0}, {0.0, 0.0, 0.0});
  quad({0.0, 0.0, 0.0}, {0.0, -0.001, -0.001});
  quad({0.0, -0.001, -0.001}, {0.0, -0.001, -0.1});
  const Vector3 down = Vector3(0.0, -1.0, -1.0).normalized();
  EXPECT_NEAR(reachOf(mesh, Vector3::Zero(), {Vector3::UnitY(), down}), std::sqrt(2.0) * 0.001, 1e-6);
}

//  ____.  from above: the face at the end leans back over the piece by 60 degrees
//      /
TEST(WedgeReach, EndsOfAPieceMayBeSkewed) {
  constexpr double kSkew = 1.73;
  TriangleMesh mesh;
  const auto quad = [&mesh](const std::array<Vector3, 4>& corners) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vector3& p : corners) mesh.vertices.push_back(p.cast<float>());
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
  };
  const Vector3 end(0.002, 0.0, 0.0);
  const Vector3 behind(0.002 - 0.1 * kSkew, 0.1, 0.0);
  const Vector3 down(0.0, 0.0, -0.1);
  quad({Vector3(-0.4, 0.0, 0.0), end, behind, Vector3(-0.4, 0.1, 0.0)});
  quad({Vector3(-0.4, 0.0, 0.0), end, end + down, Vector3(-0.4, 0.0, -0.1)});
  quad({end, behind, behind + down, end + down});
  const TriangleTree tree(trianglesOf(mesh), 0.01);
  const WedgeReach reach(tree);
  WedgePiece piece{Vector3::Zero(), kHalf, {Vector3::UnitY(), -Vector3::UnitZ()}};
  EXPECT_LT(reach.of(piece, kMost, kTolerance), 1e-5) << "the face at the end is between perpendicular ends";
  piece.skew[1] = kSkew * Vector3::UnitY();
  EXPECT_NEAR(reach.of(piece, kMost, kTolerance), kMost, 1e-9);
}

TEST(WedgeReach, OfASheetIsNone) {
  EXPECT_EQ(reachOf(test::sheetMesh(0.05, 0.0, 4), {0.0, -0.05, 0.0}, {Vector3::UnitY(), Vector3::UnitY()}),
            0.0);
}

}  // namespace
}  // namespace tenon::bake
