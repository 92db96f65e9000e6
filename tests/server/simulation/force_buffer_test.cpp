#include "server/simulation/force_buffer.h"

#include <limits>

#include <gtest/gtest.h>

namespace tenon::simulation {
namespace {

Wrench push(double x) { return {Vector3(x, 0.0, 0.0), Vector3::Zero()}; }

TEST(ForceBuffer, SumsCellsInCellOrderWhateverTheOrderOfWrites) {
  // 1e16 + 1 - 1e16 depends on the order of summation
  ForceBuffer forward(3);
  ForceBuffer backward(3);
  const double values[] = {1e16, 1.0, -1e16};
  for (std::size_t cell = 0; cell < 3; ++cell) forward.write(cell, push(values[cell]), 1);
  for (std::size_t cell = 3; cell-- > 0;) backward.write(cell, push(values[cell]), 1);
  EXPECT_EQ(forward.total(1).force, backward.total(1).force);
}

TEST(ForceBuffer, KeepsACellThatIsNotRefreshedAndReportsItsAge) {
  ForceBuffer buffer(2);
  buffer.write(0, push(3.0), 5);
  buffer.write(1, push(4.0), 9);
  EXPECT_EQ(buffer.total(100).force.x(), 7.0);
  EXPECT_EQ(buffer.age(0, 9), 4U);
}

TEST(ForceBuffer, FadesAContributionLinearlyAndFreesItsCellAfterItsLifetime) {
  ForceBuffer buffer(1);
  ASSERT_TRUE(buffer.contribute(7, push(10.0), 10, 100));
  EXPECT_DOUBLE_EQ(buffer.total(100).force.x(), 10.0);
  EXPECT_DOUBLE_EQ(buffer.total(105).force.x(), 5.0);
  EXPECT_DOUBLE_EQ(buffer.total(110).force.x(), 0.0);
  buffer.expire(110);
  EXPECT_FALSE(buffer.cells().back().used);
}

TEST(ForceBuffer, ASecondContributionOfASourceOverwritesItsCell) {
  ForceBuffer buffer(1);
  buffer.contribute(7, push(10.0), 10, 0);
  buffer.contribute(7, push(4.0), 10, 0);
  EXPECT_DOUBLE_EQ(buffer.total(0).force.x(), 4.0);
}

TEST(ForceBuffer, ClampsForceTorqueAndLifetimeOfAContribution) {
  ForceBuffer buffer(1);
  buffer.contribute(1, {Vector3(0.0, 0.0, 1e6), Vector3(1e6, 0.0, 0.0)}, 1000000, 0);
  EXPECT_NEAR(buffer.total(0).force.norm(), 50.0, 1e-9);
  EXPECT_NEAR(buffer.total(0).torque.norm(), 5.0, 1e-9);
  EXPECT_NEAR(buffer.total(99).force.norm(), 0.5, 1e-9);
  EXPECT_EQ(buffer.total(100).force.norm(), 0.0);
}

TEST(ForceBuffer, RejectsAndCountsInvalidContributions) {
  ForceBuffer buffer(1);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(buffer.contribute(1, push(nan), 10, 0));
  EXPECT_FALSE(buffer.contribute(1, push(std::numeric_limits<double>::infinity()), 10, 0));
  EXPECT_FALSE(buffer.contribute(1, push(1e300), 10, 0));
  EXPECT_FALSE(buffer.contribute(1, push(1.0), 0, 0));
  EXPECT_EQ(buffer.rejected(), 4U);
  EXPECT_EQ(buffer.total(0).force.norm(), 0.0);
}

TEST(ForceBuffer, RejectsASourceWhileAllCellsAreInUse) {
  ForceBuffer buffer(0);
  for (std::uint32_t source = 0; source < ForceBuffer::kContributions; ++source) {
    EXPECT_TRUE(buffer.contribute(source, push(1.0), source == 3 ? 5 : 100, 0));
  }
  EXPECT_FALSE(buffer.contribute(99, push(1.0), 100, 0));
  EXPECT_TRUE(buffer.contribute(99, push(1.0), 100, 5));
}

}  // namespace
}  // namespace tenon::simulation
