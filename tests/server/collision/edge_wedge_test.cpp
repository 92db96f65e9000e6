#include "server/collision/edge_wedge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "server/collision/feature_query.h"
#include "server/structures/shell_builder.h"
#include "tests/server/collision/baked_pair.h"

namespace tenon::collision {
namespace {

/// The features of a body that has one: a point, or a piece of an edge.
structures::FeatureShell oneFeature(const Vector3& p, const structures::FeatureEdge& edge = {}) {
  const std::vector<structures::SurfaceSample> samples{{p, -Vector3::UnitZ(), 0.0}};
  std::vector<std::uint32_t> order;
  structures::FeatureStorage storage{structures::buildFlatShell(samples, 0.001, order), {edge}};
  return structures::makeFeatureShell(std::move(storage));
}

/// A wedge of `angle` [rad] between its faces, which points up: an edge along x at the origin.
///
///      n_1  /\  n_0       into_0 goes down to the right, into_1 down to the left
///          /  \           .
struct Wedge {
  explicit Wedge(double angle)
      : into{Vector3(0.0, std::sin(0.5 * angle), -std::cos(0.5 * angle)),
             Vector3(0.0, -std::sin(0.5 * angle), -std::cos(0.5 * angle))},
        n{Vector3(0.0, std::cos(0.5 * angle), std::sin(0.5 * angle)),
          Vector3(0.0, -std::cos(0.5 * angle), std::sin(0.5 * angle))} {}

  [[nodiscard]] EdgePiece piece() const { return {.half = {0.003, 0.0, 0.0}, .into = into, .reach = 0.003}; }
  [[nodiscard]] structures::FeatureShell features() const {
    return oneFeature(Vector3::Zero(), {.half_M = {0.003F, 0.0F, 0.0F},
                                        .into_M = {into[0].cast<float>(), into[1].cast<float>()},
                                        .reach = 0.003F});
  }

  std::array<Vector3, 2> into;
  std::array<Vector3, 2> n;  // outwards
};

constexpr std::array kAngles{0.3, 0.9, 1.57, 2.2, 3.0};  // [rad]

Pose randomPose(test::SeededRandom& random) {
  const Vector3 p = 0.2 * random.vector();
  return {p, expRotation(2.0 * random.vector())};
}

TEST(EdgeWedge, HasTheNormalsOfItsFaces) {
  for (const double angle : kAngles) {
    const Wedge wedge(angle);
    const auto n = normalsOf(wedge.piece());
    for (const std::size_t face : {0U, 1U})
      EXPECT_NEAR((n[face] - wedge.n[face]).norm(), 0.0, 1e-12) << angle;
  }
}

TEST(EdgeWedge, APointHasTheLargerDistanceToTheFaces) {
  test::SeededRandom random(3);
  for (const double angle : kAngles) {
    const Wedge wedge(angle);
    for (int trial = 0; trial < 50; ++trial) {
      const Vector3 p = 0.001 * random.vector();
      Contact contact;
      ASSERT_TRUE(isBeside(p, wedge.piece(), 0.001, contact));
      EXPECT_NEAR(contact.gap, std::max(wedge.n[0].dot(p), wedge.n[1].dot(p)), 1e-12);
      EXPECT_EQ(contact.p_WP, p);
    }
  }
}

/// Poses of a body A with a point and of a body B with a wedge, the point at `r` [m] in the wedge's frame.
struct PointAtWedge {
  PointAtWedge(const Wedge& wedge, const Vector3& r, const Pose& X_W, test::SeededRandom& random)
      : X_WB(X_W * randomPose(random)), of_wedge(wedge.features()) {
    const Vector3 p_A = 0.01 * random.vector();
    const Quaternion q_WA = X_W.rotation() * expRotation(2.0 * random.vector());
    X_WA = Pose(X_WB * r - q_WA * p_A, q_WA);
    of_point = oneFeature(p_A);
    crossing.kind = ContactKind::kCrossing;
    crossing.p_WP = X_WB * r;
  }

  Pose X_WA, X_WB;
  structures::FeatureShell of_point, of_wedge;
  Contact crossing;
};

//   A's point is outside of either face of B's wedge, or B's of A's: the planes are those of the faces, with
//   normals from B into A
TEST(SidesOfAWedge, AreThePlanesOfItsFaces) {
  test::SeededRandom random(5);
  for (const double angle : kAngles) {
    const Wedge wedge(angle);
    for (int trial = 0; trial < 20; ++trial) {
      const Vector3 r = 0.0005 * random.vector();
      const PointAtWedge at(wedge, r, Pose(), random);
      const auto of_B = sidesOfWedge({&at.of_point, &at.of_wedge}, at.crossing, at.X_WA, at.X_WB);
      const auto of_A = sidesOfWedge({&at.of_wedge, &at.of_point}, at.crossing, at.X_WB, at.X_WA);
      ASSERT_EQ(of_B.size(), 2U);
      ASSERT_EQ(of_A.size(), 2U);
      for (const std::size_t face : {0U, 1U}) {
        const Vector3 n_W = at.X_WB.rotation() * wedge.n[face];
        EXPECT_NEAR((of_B[face].n_W - n_W).norm(), 0.0, 1e-6) << angle;
        EXPECT_NEAR((of_A[face].n_W + n_W).norm(), 0.0, 1e-6) << angle;
        EXPECT_NEAR(of_B[face].gap, wedge.n[face].dot(r), 1e-9) << angle;
        EXPECT_NEAR(of_A[face].gap, wedge.n[face].dot(r), 1e-9) << angle;
      }
    }
  }
}

TEST(SidesOfAWedge, TurnWithTheBodies) {
  const Wedge wedge(1.2);
  const Vector3 r(0.0007, 0.0002, -0.0001);
  test::SeededRandom poses(9);
  for (int trial = 0; trial < 20; ++trial) {
    const Pose X_VW = randomPose(poses);
    test::SeededRandom random(11);
    const PointAtWedge here(wedge, r, Pose(), random);
    random = test::SeededRandom(11);
    const PointAtWedge there(wedge, r, X_VW, random);
    const auto in_W = sidesOfWedge({&here.of_point, &here.of_wedge}, here.crossing, here.X_WA, here.X_WB);
    const auto in_V =
        sidesOfWedge({&there.of_point, &there.of_wedge}, there.crossing, there.X_WA, there.X_WB);
    ASSERT_EQ(in_V.size(), in_W.size());
    for (std::size_t i = 0; i < in_W.size(); ++i) {
      EXPECT_NEAR((in_V[i].n_W - X_VW.rotation() * in_W[i].n_W).norm(), 0.0, 1e-12);
      EXPECT_NEAR(in_V[i].gap, in_W[i].gap, 1e-12);
    }
  }
}

//   of two edges along each other the middle of B's is the point; edges that cross, and what is dormant, have
//   no sides
TEST(SidesOfAWedge, AreThoseOfAPointAlone) {
  const Wedge wedge(1.57);
  const structures::FeatureShell a = wedge.features(), b = wedge.features();
  const Vector3 r(0.001, 0.0, 0.0001);
  Contact crossing;
  crossing.kind = ContactKind::kCrossing;
  crossing.p_WP = r;
  const Pose along(r, expRotation({std::numbers::pi, 0.0, 0.0}));
  const auto sides = sidesOfWedge({&a, &b}, crossing, Pose(), along);
  ASSERT_EQ(sides.size(), 2U);
  for (const std::size_t face : {0U, 1U}) {
    EXPECT_NEAR((sides[face].n_W + wedge.n[face]).norm(), 0.0, 1e-6) << "A's, from B into A";
    EXPECT_NEAR(sides[face].gap, wedge.n[face].dot(r), 1e-9);
  }
  const Pose across(r, along.rotation() * expRotation({0.0, 0.0, 0.5 * std::numbers::pi}));
  EXPECT_TRUE(sidesOfWedge({&a, &b}, crossing, Pose(), across).empty());
  crossing.gap = kDormantGap + 0.001;
  EXPECT_TRUE(sidesOfWedge({&a, &b}, crossing, Pose(), along).empty());
}

}  // namespace
}  // namespace tenon::collision
