#include "idl/types/spatial.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace tenon {
namespace {

class Spatial : public ::testing::Test {
 protected:
  double number(double max) { return max * (2.0 * static_cast<double>(random_() >> 11U) * 0x1p-53 - 1.0); }
  Vector3 vector(double max) { return {number(max), number(max), number(max)}; }
  /// A rotation vector shorter than pi.
  Vector3 rotationVector() {
    while (true) {
      const Vector3 w = vector(std::numbers::pi);
      if (w.norm() < std::numbers::pi - 1e-6) return w;
    }
  }

  std::mt19937_64 random_{1};
};

TEST_F(Spatial, ClampNormKeepsTheDirectionAndBoundsTheNorm) {
  EXPECT_EQ(clampNorm({3.0, 0.0, 4.0}, 5.0), Vector3(3.0, 0.0, 4.0));
  EXPECT_TRUE(clampNorm({3.0, 0.0, -4.0}, 2.5).isApprox(Vector3(1.5, 0.0, -2.0)));
  EXPECT_EQ(clampNorm({3.0, 0.0, 4.0}, 0.0), Vector3::Zero());
  EXPECT_EQ(clampNorm(Vector3::Zero(), 0.0), Vector3::Zero());
}

TEST_F(Spatial, AngleOfIsTheArcTangent) {
  for (int i = 0; i < 10'000; ++i) {
    const double y = std::abs(number(10.0));
    const double x = number(10.0);
    EXPECT_NEAR(angleOf(y, x), std::atan2(y, x), 1e-14) << y << ' ' << x;
  }
  EXPECT_EQ(angleOf(0.0, 0.0), 0.0);
  EXPECT_EQ(angleOf(0.0, 1.0), 0.0);
  EXPECT_DOUBLE_EQ(angleOf(1.0, 0.0), std::numbers::pi / 2.0);
  EXPECT_DOUBLE_EQ(angleOf(0.0, -1.0), std::numbers::pi);
}

TEST_F(Spatial, ExpRotationRotatesAboutItsVectorByItsLength) {
  for (int i = 0; i < 2000; ++i) {
    const Vector3 w = rotationVector();
    const Matrix3 expected = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
    EXPECT_TRUE(expRotation(w).toRotationMatrix().isApprox(expected, 1e-13)) << w.transpose();
  }
  EXPECT_TRUE(expRotation(Vector3::Zero()).isApprox(Quaternion::Identity()));
}

TEST_F(Spatial, LogRotationIsTheInverseOfExpRotation) {
  for (int i = 0; i < 2000; ++i) {
    const Vector3 w = rotationVector();
    EXPECT_LT((logRotation(expRotation(w)) - w).norm(), 1e-12) << w.transpose();
  }
}

TEST_F(Spatial, LogRotationIsExactForTinyRotations) {
  const Vector3 w(1e-12, -2e-12, 3e-12);
  EXPECT_LT((logRotation(expRotation(w)) - w).norm(), 1e-24);
}

TEST_F(Spatial, LogRotationIsTheShorterRotationForEitherSignOfTheQuaternion) {
  const Vector3 w(0.0, 0.0, 0.5);
  Quaternion q = expRotation(w);
  q.coeffs() = -q.coeffs();
  EXPECT_LT((logRotation(q) - w).norm(), 1e-14);
}

TEST_F(Spatial, DisplacedIsTheInverseOfDisplacement) {
  for (int i = 0; i < 500; ++i) {
    const Pose X_WA(vector(2.0), expRotation(rotationVector()));
    const Pose X_WB(vector(2.0), expRotation(rotationVector()));
    const Pose X_WB_again = displaced(X_WA, displacement(X_WA, X_WB));
    EXPECT_LT((X_WB_again.translation() - X_WB.translation()).norm(), 1e-12);
    EXPECT_LT(X_WB_again.rotation().angularDistance(X_WB.rotation()), 1e-7);
  }
}

TEST_F(Spatial, TheDisplacementOfAnotherPointIsOfThatPoint) {
  for (int i = 0; i < 500; ++i) {
    const Pose X_WA(vector(2.0), expRotation(rotationVector()));
    const Pose X_WB(vector(2.0), expRotation(rotationVector()));
    const Vector3 p_OQ_O = vector(2.0);
    const Displacement motion = displacement(X_WA, X_WB, p_OQ_O);
    EXPECT_LT((motion.translation - (X_WB * p_OQ_O - X_WA * p_OQ_O)).norm(), 1e-12);
    const Pose X_WB_again = displaced(X_WA, motion, p_OQ_O);
    EXPECT_LT((X_WB_again.translation() - X_WB.translation()).norm(), 1e-12);
    EXPECT_LT(X_WB_again.rotation().angularDistance(X_WB.rotation()), 1e-7);
  }
  const Pose turned = displaced(Pose(), {Vector3::Zero(), Vector3(0, 0, std::numbers::pi)}, Vector3(1, 0, 0));
  EXPECT_LT((turned.translation() - Vector3(2, 0, 0)).norm(), 1e-12)
      << "about that point, not about the origin";
}

//   A --X_AB--> B --X_BC--> C
TEST_F(Spatial, PosesAreComposedAndInverted) {
  const Pose X_AB(Vector3(1, 0, 0), expRotation({0, 0, std::numbers::pi / 2}));
  const Pose X_BC(Vector3(2, 0, 0));
  EXPECT_LT((((X_AB * X_BC).translation()) - Vector3(1, 2, 0)).norm(), 1e-14);
  EXPECT_LT((X_AB.inverse() * (X_AB * Vector3(3, 4, 5)) - Vector3(3, 4, 5)).norm(), 1e-14);
}

TEST_F(Spatial, APoseWithNanOrInfinityIsNotFinite) {
  EXPECT_TRUE(Pose().isFinite());
  EXPECT_FALSE(Pose(Vector3(0, std::nan(""), 0)).isFinite());
  EXPECT_FALSE(Pose(Vector3::Zero(), Quaternion(1, 0, 0, HUGE_VAL)).isFinite());
}

}  // namespace
}  // namespace tenon
