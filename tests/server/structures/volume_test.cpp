#include "server/structures/volume.h"

#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/analytic_structures.h"

namespace tenon::structures {
namespace {

TEST(Volume, VolumeAndInertiaOfABoxMatchTheFormula) {
  const Vector3 size(0.06, 0.04, 0.10);
  const auto box = test::boxStructures(size, 0.002, 0.01);
  const Volume volume = volumeOf(box->field);
  const double expected = size.prod();
  EXPECT_NEAR(volume.volume, expected, 5e-3 * expected);
  EXPECT_LE(volume.p_MC_M.norm(), 1e-5);
  for (int axis = 0; axis < 3; ++axis) {
    const double a = size[(axis + 1) % 3];
    const double b = size[(axis + 2) % 3];
    const double inertia = expected * (a * a + b * b) / 12.0;
    EXPECT_NEAR(volume.inertia_C_M(axis, axis), inertia, 0.01 * inertia);
  }
  EXPECT_LE(Matrix3(volume.inertia_C_M - Matrix3(volume.inertia_C_M.diagonal().asDiagonal())).norm(), 1e-12);
}

TEST(Volume, CentroidOfAnOffsetBallIsAtItsCentre) {
  const double radius = 0.03;
  const Vector3 p_MC(0.05, -0.02, 0.01);
  const Eigen::AlignedBox3d box(p_MC - Vector3::Constant(radius), p_MC + Vector3::Constant(radius));
  const auto ball =
      test::analyticStructures(test::movedDistance(test::sphereDistance(radius), Pose(p_MC)), box, 0.002);
  const Volume volume = volumeOf(ball->field);
  const double expected = 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
  EXPECT_NEAR(volume.volume, expected, 5e-3 * expected);
  EXPECT_LE((volume.p_MC_M - p_MC).norm(), 1e-5);
  const double inertia = 0.4 * expected * radius * radius;
  EXPECT_LE((volume.inertia_C_M - inertia * Matrix3::Identity()).cwiseAbs().maxCoeff(), 0.01 * inertia);
}

TEST(Volume, ASheetWithoutThicknessHasNoVolume) {
  EXPECT_LE(volumeOf(test::sheetStructures(0.1, 0.0, 0.002)->field).volume, 0.1 * 0.1 * 0.002);
}

}  // namespace
}  // namespace tenon::structures
