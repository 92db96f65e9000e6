#include "server/collision/motion_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::collision {
namespace {

/// Uniform in [-1, 1), the same on every machine.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : engine_(seed) {}
  double number() { return 2.0 * (static_cast<double>(engine_() >> 11U) / 9007199254740992.0) - 1.0; }
  Vector3 vector() {
    const double x = number();
    const double y = number();
    return {x, y, number()};
  }
  Vector3 direction() {
    while (true) {
      const Vector3 v = vector();
      if (v.norm() > 0.1 && v.norm() < 1.0) return v.normalized();
    }
  }
  Pose pose(double size, double angle) { return {size * vector(), expRotation(angle * vector())}; }

 private:
  std::mt19937_64 engine_;
};

MovableBody bodyAt(const Pose& X_WB, const Pose& X_WG, double stiffness = 1000.0,
                   double rotational_stiffness = 20.0) {
  MovableBody body;
  body.X_WB = X_WB;
  body.springs.push_back({X_WG, Vector3::Zero(), stiffness, rotational_stiffness});
  return body;
}

struct Solved {
  std::vector<Displacement> displacements;
  std::vector<double> multipliers;
  MotionResult result;
};

Solved solve(const std::vector<MovableBody>& bodies, const std::vector<ContactConstraint>& rows) {
  MotionSolver solver(bodies.size(), rows.size());
  Solved out;
  out.displacements.resize(bodies.size());
  out.multipliers.resize(rows.size());
  out.result = solver.solve(bodies, rows, out.displacements, out.multipliers);
  return out;
}

double slack(const ContactConstraint& row, const std::vector<MovableBody>& bodies,
             const std::vector<Displacement>& displacements) {
  const auto pointDisplacement = [&](std::int32_t body) -> Vector3 {
    if (body == ContactConstraint::kStatic) return Vector3::Zero();
    const auto i = static_cast<std::size_t>(body);
    return displacements[i].translation +
           displacements[i].rotation.cross(row.p_WP - bodies[i].X_WB.translation());
  };
  return row.gap + row.n_W.dot(pointDisplacement(row.body_a) - pointDisplacement(row.body_b));
}

/// Residual of the KKT stationarity condition by body: linearised spring wrench after the displacement, plus
/// the wrench of the rows' multipliers.
std::vector<Wrench> residuals(const std::vector<MovableBody>& bodies,
                              const std::vector<ContactConstraint>& rows, const Solved& solved) {
  std::vector<Wrench> sums(bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Displacement& m = solved.displacements[i];
    for (const Spring& spring : bodies[i].springs) {
      const Vector3 p_BoC_W = bodies[i].X_WB.rotation() * spring.p_BC;
      const Vector3 p_CoGc_W = spring.X_WG * spring.p_BC - bodies[i].X_WB * spring.p_BC;
      const Vector3 f = spring.stiffness * (p_CoGc_W - m.translation - m.rotation.cross(p_BoC_W));
      const Vector3 turn = displacement(bodies[i].X_WB, spring.X_WG).rotation - m.rotation;
      sums[i] += {f, p_BoC_W.cross(f) + spring.rotational_stiffness * turn};
    }
  }
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const Vector3 f = solved.multipliers[r] * rows[r].n_W;
    const auto push = [&](std::int32_t body, const Vector3& force) {
      if (body == ContactConstraint::kStatic) return;
      const auto i = static_cast<std::size_t>(body);
      sums[i] += {force, (rows[r].p_WP - bodies[i].X_WB.translation()).cross(force)};
    };
    push(rows[r].body_a, f);
    push(rows[r].body_b, -f);
  }
  return sums;
}

void expectOptimal(const std::vector<MovableBody>& bodies, const std::vector<ContactConstraint>& rows,
                   const Solved& solved) {
  ASSERT_FALSE(solved.result.infeasible);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const double s = slack(rows[r], bodies, solved.displacements);
    EXPECT_GE(s, -1e-9) << "row " << r;
    EXPECT_GE(solved.multipliers[r], 0.0) << "row " << r;
    EXPECT_LE(std::min(solved.multipliers[r], s), 1e-8) << "row " << r << " has a multiplier and a slack";
  }
  for (const Wrench& residual : residuals(bodies, rows, solved)) {
    EXPECT_LE(residual.force.norm(), 1e-4);  // of forces near 100 N; includes the rotational regularisation
    EXPECT_LE(residual.torque.norm(), 1e-4);
  }
}

/// The smallest energy over all active sets, by enumeration of the KKT systems. One body, <= 10 rows.
double leastEnergyByEnumeration(const MovableBody& body, const std::vector<ContactConstraint>& rows,
                                Displacement& best) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  const Spring& spring = body.springs[0];
  H.topLeftCorner<3, 3>() = spring.stiffness * Matrix3::Identity();
  H.bottomRightCorner<3, 3>() =
      (spring.rotational_stiffness + 1e-6 * spring.stiffness * body.radius * body.radius) *
      Matrix3::Identity();
  const Displacement goal = displacement(body.X_WB, spring.X_WG);
  Vector6 b;
  b << spring.stiffness * goal.translation, spring.rotational_stiffness * goal.rotation;

  double least = std::numeric_limits<double>::infinity();
  for (unsigned choice = 0; choice < (1U << rows.size()); ++choice) {
    std::vector<std::size_t> active;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      if ((choice >> r) & 1U) active.push_back(r);
    }
    if (active.size() > 6) continue;
    const auto q = static_cast<Eigen::Index>(active.size());
    Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(6 + q, 6 + q);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(6 + q);
    kkt.topLeftCorner(6, 6) = H;
    right.head(6) = b;
    for (Eigen::Index k = 0; k < q; ++k) {
      const ContactConstraint& row = rows[active[static_cast<std::size_t>(k)]];
      Vector6 c;
      c << row.n_W, (row.p_WP - body.X_WB.translation()).cross(row.n_W);
      kkt.block(6 + k, 0, 1, 6) = c.transpose();
      kkt.block(0, 6 + k, 6, 1) = -c;
      right[6 + k] = -row.gap;
    }
    const Eigen::VectorXd answer = kkt.fullPivLu().solve(right);
    if ((kkt * answer - right).norm() > 1e-6) continue;
    const Vector6 x = answer.head(6);
    const Displacement displacement_of_choice{x.head<3>(), x.tail<3>()};
    bool feasible = true;
    for (const ContactConstraint& row : rows)
      feasible = feasible && slack(row, {body}, {displacement_of_choice}) >= -1e-9;
    const double energy = 0.5 * x.dot(H * x) - b.dot(x);
    if (feasible && energy < least) {
      least = energy;
      best = displacement_of_choice;
    }
  }
  return least;
}

TEST(MotionSolver, ReachesTheGoalWithoutConstraints) {
  Noise noise(1);
  for (int trial = 0; trial < 100; ++trial) {
    const MovableBody body = bodyAt(noise.pose(1.0, 1.0), noise.pose(1.0, 1.0));
    const Solved solved = solve({body}, {});
    const Displacement goal = displacement(body.X_WB, body.springs[0].X_WG);
    EXPECT_LE((solved.displacements[0].translation - goal.translation).norm(), 1e-12);
    EXPECT_LE((solved.displacements[0].rotation - goal.rotation).norm(), 1e-4);
  }
}

TEST(MotionSolver, AgreesWithEnumerationOfAllActiveSets) {
  Noise noise(2);
  int bounded = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const MovableBody body = bodyAt(noise.pose(0.1, 1.0), noise.pose(0.1, 1.0));
    std::vector<ContactConstraint> rows;
    const int count = 1 + trial % 8;
    for (int r = 0; r < count; ++r) {
      rows.push_back({0, ContactConstraint::kStatic, noise.direction(),
                      body.X_WB.translation() + 0.1 * noise.vector(), 0.01 * std::abs(noise.number())});
    }
    Displacement truth;
    ASSERT_TRUE(std::isfinite(leastEnergyByEnumeration(body, rows, truth)));
    const Solved solved = solve({body}, rows);
    expectOptimal({body}, rows, solved);
    EXPECT_LE((solved.displacements[0].translation - truth.translation).norm(), 1e-8) << trial;
    EXPECT_LE((solved.displacements[0].rotation - truth.rotation).norm(), 1e-7) << trial;
    bounded += std::count_if(solved.multipliers.begin(), solved.multipliers.end(),
                             [](double u) { return u > 0; }) > 2;
  }
  EXPECT_GT(bounded, 30) << "the trials were too easy";
}

// a box is pressed on a table that its whole underside lies on: 900 coplanar contacts
TEST(MotionSolver, HundredsOfRedundantRowsNeedFewIterations) {
  const MovableBody body =
      bodyAt(Pose::Identity(), Pose({0.02, -0.01, -0.05}, expRotation({0.05, 0.02, 0.3})));
  std::vector<ContactConstraint> rows;
  for (int i = 0; i < 30; ++i) {
    for (int k = 0; k < 30; ++k) {
      rows.push_back({0,
                      ContactConstraint::kStatic,
                      Vector3::UnitZ(),
                      {0.01 * i - 0.145, 0.01 * k - 0.145, -0.05},
                      0.0});
    }
  }
  const Solved solved = solve({body}, rows);
  expectOptimal({body}, rows, solved);
  EXPECT_NEAR(solved.displacements[0].translation.x(), 0.02, 1e-9);  // it slides without resistance
  EXPECT_NEAR(solved.displacements[0].rotation.z(),
              displacement(body.X_WB, body.springs[0].X_WG).rotation.z(), 1e-4);
  EXPECT_NEAR(solved.displacements[0].translation.z(), 0.0, 1e-10);
  EXPECT_LT(solved.result.iterations, 60U);
}

//      wall | peg | wall        both walls touch: no rotation, translation along the slot only
TEST(MotionSolver, APegBetweenTwoWallsMovesAlongTheSlotOnly) {
  const MovableBody body = bodyAt(Pose::Identity(), Pose({0.01, 0.02, 0.03}, expRotation({0.0, 0.1, 0.0})));
  std::vector<ContactConstraint> rows;
  for (const double z : {-0.05, 0.0, 0.05}) {
    for (const double y : {-0.01, 0.01}) {
      rows.push_back({0, ContactConstraint::kStatic, Vector3::UnitX(), {-0.01, y, z}, 0.0});
      rows.push_back({0, ContactConstraint::kStatic, -Vector3::UnitX(), {0.01, y, z}, 0.0});
    }
  }
  const Solved solved = solve({body}, rows);
  expectOptimal({body}, rows, solved);
  EXPECT_LE((solved.displacements[0].translation - Vector3(0.0, 0.02, 0.03)).norm(), 1e-9);
  EXPECT_LE(solved.displacements[0].rotation.norm(), 1e-9);
}

TEST(MotionSolver, ReportsInfeasibleConstraintsAndDoesNotDeepenTheirOverlap) {
  const MovableBody body = bodyAt(Pose::Identity(), Pose(Vector3(0.05, 0.02, 0.0)));
  const std::vector<ContactConstraint> rows{
      {0, ContactConstraint::kStatic, Vector3::UnitX(), {-0.01, 0.0, 0.0}, -0.001},
      {0, ContactConstraint::kStatic, -Vector3::UnitX(), {0.01, 0.0, 0.0}, -0.001}};
  const Solved solved = solve({body}, rows);
  EXPECT_TRUE(solved.result.infeasible);
  EXPECT_NEAR(solved.displacements[0].translation.x(), 0.0, 1e-10);  // no deeper into either
  EXPECT_NEAR(solved.displacements[0].translation.y(), 0.02, 1e-10);
}

//   goal of a ->  <- goal of b        two hands press their parts against each other
//        [ a ][ b ]
TEST(MotionSolver, TwoBodiesInContactMoveInInverseProportionToTheirStiffness) {
  const std::vector<MovableBody> bodies{
      bodyAt(Pose(Vector3(-0.1, 0.0, 0.0)), Pose(Vector3(-0.07, 0.0, 0.0)), 1000.0),
      bodyAt(Pose(Vector3(0.1, 0.0, 0.0)), Pose(Vector3(0.1, 0.0, 0.0)), 2000.0)};
  std::vector<ContactConstraint> rows;
  for (const double y : {-0.02, 0.02}) {
    for (const double z : {-0.02, 0.02}) rows.push_back({0, 1, -Vector3::UnitX(), {0.0, y, z}, 0.0});
  }
  const Solved solved = solve(bodies, rows);
  expectOptimal(bodies, rows, solved);
  EXPECT_NEAR(solved.displacements[0].translation.x(), 0.01, 1e-9);  // 1000 (0.03 - x) = 2000 x
  EXPECT_NEAR(solved.displacements[1].translation.x(), 0.01, 1e-9);
  double force = 0.0;
  for (const double u : solved.multipliers) force += u;
  EXPECT_NEAR(force, 20.0, 1e-6);
}

TEST(MotionSolver, SpringsOfTwoHandsOnOneBodyAddUp) {
  MovableBody body = bodyAt(Pose::Identity(), Pose(Vector3(0.0, 0.0, 0.03)), 1000.0);
  body.springs.push_back({Pose(Vector3(0.0, 0.0, -0.01)), Vector3(0.1, 0.0, 0.0), 3000.0, 20.0});
  const Solved solved = solve({body}, {});
  const std::vector<Wrench> residual = residuals({body}, {}, solved);
  EXPECT_LE(residual[0].force.norm(), 1e-4);
  EXPECT_LE(residual[0].torque.norm(), 1e-4);
}

TEST(MotionSolver, SolutionIsEquivariantUnderAChangeOfWorldFrame) {
  Noise noise(3);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<MovableBody> bodies{bodyAt(noise.pose(0.1, 1.0), noise.pose(0.1, 0.5)),
                                    bodyAt(noise.pose(0.1, 1.0), noise.pose(0.1, 0.5))};
    std::vector<ContactConstraint> rows;
    for (int r = 0; r < 12; ++r) {
      rows.push_back({r % 2, r % 3 == 0 ? 1 - r % 2 : ContactConstraint::kStatic, noise.direction(),
                      0.1 * noise.vector(), 0.005 * std::abs(noise.number())});
    }
    const Solved here = solve(bodies, rows);
    const Pose X_VW(0.5 * noise.vector(), expRotation(3.0 * noise.vector()));
    for (MovableBody& body : bodies) {
      body.X_WB = X_VW * body.X_WB;
      for (Spring& spring : body.springs) spring.X_WG = X_VW * spring.X_WG;
    }
    for (ContactConstraint& row : rows)
      row = {row.body_a, row.body_b, X_VW.rotation() * row.n_W, X_VW * row.p_WP, row.gap};
    const Solved there = solve(bodies, rows);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      EXPECT_LE(
          (there.displacements[i].translation - X_VW.rotation() * here.displacements[i].translation).norm(),
          1e-9);
      EXPECT_LE((there.displacements[i].rotation - X_VW.rotation() * here.displacements[i].rotation).norm(),
                1e-8);
    }
  }
}

TEST(MotionSolver, AChainOfBodiesKeepsItsGaps) {
  // a chain of eight: the first is pushed, each pushes the next
  std::vector<MovableBody> bodies;
  std::vector<ContactConstraint> rows;
  Noise noise(4);
  for (int i = 0; i < 8; ++i) {
    const Pose X_WB(Vector3(0.1 * i, 0.0, 0.0));
    bodies.push_back(bodyAt(X_WB, Pose(X_WB.translation() + Vector3(i == 0 ? 0.05 : 0.0, 0.0, 0.0))));
    for (int k = 0; i > 0 && k < 20; ++k) {
      const Vector3 p(0.1 * i - 0.05, 0.03 * noise.number(), 0.03 * noise.number());
      rows.push_back({i - 1, i, -Vector3::UnitX(), p, 0.001});
    }
  }
  const Solved solved = solve(bodies, rows);
  expectOptimal(bodies, rows, solved);
}

TEST(MotionSolver, RandomIslandsSatisfyTheOptimalityConditions) {
  Noise noise(5);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<MovableBody> bodies;
    for (int i = 0; i < 1 + trial % 4; ++i)
      bodies.push_back(bodyAt(noise.pose(0.1, 1.0), noise.pose(0.1, 0.5)));
    std::vector<ContactConstraint> rows;
    for (int r = 0; r < 5 + trial; ++r) {
      const int a = r % static_cast<int>(bodies.size());
      const int b = r % 2 == 0 || bodies.size() == 1 ? ContactConstraint::kStatic
                                                     : (a + 1) % static_cast<int>(bodies.size());
      rows.push_back({a, b, noise.direction(), 0.1 * noise.vector(), 0.01 * std::abs(noise.number())});
    }
    expectOptimal(bodies, rows, solve(bodies, rows));
  }
}

/// A wall of boxes, five a layer, each on two of the layer below and with a goal 10 um lower. A box touches
/// its neighbours only, however large the wall is: the active set is sparse.
struct Wall {
  explicit Wall(int count) {
    Noise noise(7);
    for (int i = 0; i < count; ++i) {
      const Pose X_WB(Vector3(0.05 * (i % 5) + 0.025 * (i / 5 % 2), 0.0, 0.05 * (i / 5)));
      bodies.push_back(bodyAt(X_WB, Pose(X_WB.translation() - Vector3(0.0, 0.0, 1e-5)), 4e5, 170.0));
      for (int k = 0; k < 40; ++k) {
        const double x = 0.025 * noise.number();
        const int below = i - 5 + (i / 5 % 2 == 0 ? (x < 0.0 ? -1 : 0) : (x < 0.0 ? 0 : 1));
        const bool there = i >= 5 && below >= 0 && below / 5 == i / 5 - 1;
        if (i >= 5 && !there) continue;
        const Vector3 p = X_WB.translation() + Vector3(x, 0.025 * noise.number(), -0.025);
        const Vector3 n = (Vector3::UnitZ() + 1e-3 * noise.vector()).normalized();
        rows.push_back({i, there ? below : ContactConstraint::kStatic, n, p, 1e-6 * noise.number()});
      }
    }
  }
  std::vector<MovableBody> bodies;
  std::vector<ContactConstraint> rows;
};

std::vector<std::uint32_t> activeRows(const Solved& solved) {
  std::vector<std::uint32_t> active;
  for (std::uint32_t r = 0; r < solved.multipliers.size(); ++r) {
    if (solved.multipliers[r] > 0.0) active.push_back(r);
  }
  return active;
}

void expectSameDisplacements(const std::vector<Displacement>& one, const std::vector<Displacement>& other) {
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_LE((one[i].translation - other[i].translation).norm(), 1e-10) << i;
    EXPECT_LE((one[i].rotation - other[i].rotation).norm(), 1e-8) << i;
  }
}

TEST(MotionSolver, AWarmStartWithTheSolutionNeedsNoIteration) {
  for (const int count : {10, 40, 80}) {
    const Wall wall(count);
    Solved solved = solve(wall.bodies, wall.rows);
    expectOptimal(wall.bodies, wall.rows, solved);
    const std::vector<Displacement> cold = solved.displacements;
    MotionSolver solver(wall.bodies.size(), wall.rows.size());
    solved.result =
        solver.solve(wall.bodies, wall.rows, solved.displacements, solved.multipliers, activeRows(solved));
    expectOptimal(wall.bodies, wall.rows, solved);
    EXPECT_EQ(solved.result.iterations, 0U) << count << " boxes";
    expectSameDisplacements(solved.displacements, cold);
  }
}

TEST(MotionSolver, AWrongWarmStartGivesTheSameSolution) {
  const Wall wall(20);
  const Solved truth = solve(wall.bodies, wall.rows);
  Noise noise(8);
  for (int trial = 0; trial < 20; ++trial) {
    MotionSolver solver(wall.bodies.size(), wall.rows.size());
    Solved solved = truth;
    std::vector<std::uint32_t> first;
    for (std::uint32_t r = 0; r < wall.rows.size(); ++r) {
      if (noise.number() < 0.7) continue;
      first.push_back(r);
      solved.multipliers[r] = 10.0 * std::max(noise.number(), 0.0);
    }
    solved.result = solver.solve(wall.bodies, wall.rows, solved.displacements, solved.multipliers, first);
    expectOptimal(wall.bodies, wall.rows, solved);
    expectSameDisplacements(solved.displacements, truth.displacements);
  }
}

TEST(MotionSolver, ExcludedAndChangedRowsGiveTheSolutionOfAColdStart) {
  Wall wall(20);
  MotionSolver solver(wall.bodies.size(), wall.rows.size());
  Solved solved = solve(wall.bodies, wall.rows);
  solver.solve(wall.bodies, wall.rows, solved.displacements, solved.multipliers);
  const std::vector<std::uint32_t> active = activeRows(solved);
  std::vector<std::uint32_t> excluded;
  for (std::size_t i = 0; i < active.size(); i += 7) excluded.push_back(active[i]);

  std::vector<Displacement> displacements(wall.bodies.size());
  solver.solve(wall.bodies, wall.rows, displacements, {}, active, wall.rows.size(), excluded);
  std::vector<ContactConstraint> fewer = wall.rows;
  for (const std::uint32_t row : excluded) fewer[row].gap = std::numeric_limits<double>::infinity();
  expectSameDisplacements(displacements, solve(wall.bodies, fewer).displacements);

  for (const std::uint32_t row : excluded) {
    wall.rows[row].n_W = (wall.rows[row].n_W + Vector3(0.1, 0.05, 0.0)).normalized();
  }
  solved.result =
      solver.solve(wall.bodies, wall.rows, solved.displacements, solved.multipliers, active, excluded[0]);
  expectOptimal(wall.bodies, wall.rows, solved);
  expectSameDisplacements(solved.displacements, solve(wall.bodies, wall.rows).displacements);
}

TEST(MotionSolver, IsDeterministicToTheLastBit) {
  Noise noise(6);
  const MovableBody body = bodyAt(noise.pose(0.1, 1.0), noise.pose(0.1, 0.5));
  std::vector<ContactConstraint> rows;
  for (int r = 0; r < 200; ++r) {
    rows.push_back({0, ContactConstraint::kStatic, noise.direction(), 0.1 * noise.vector(),
                    0.01 * std::abs(noise.number())});
  }
  const Solved once = solve({body}, rows);
  const Solved twice = solve({body}, rows);
  EXPECT_EQ(once.displacements[0].translation, twice.displacements[0].translation);
  EXPECT_EQ(once.displacements[0].rotation, twice.displacements[0].rotation);
  EXPECT_EQ(once.multipliers, twice.multipliers);
}

TEST(SpringWrench, PullsTowardsTheGoalAboutTheOrigin) {
  const Spring spring{Pose({0.0, 0.0, 0.01}, expRotation({0.0, 0.0, 0.1})), Vector3(0.2, 0.0, 0.0), 1000.0,
                      20.0};
  const Wrench F_Bo_W = springWrench(spring, Pose::Identity());
  // the attachment point's goal: from (0.2, 0, 0) to 0.2 (cos 0.1, sin 0.1), 10 mm higher
  EXPECT_NEAR(F_Bo_W.force.z(), 10.0, 1e-9);
  EXPECT_NEAR(F_Bo_W.force.y(), 200.0 * std::sin(0.1), 1e-9);
  EXPECT_NEAR(F_Bo_W.torque.y(), -2.0, 1e-9);
  EXPECT_NEAR(F_Bo_W.torque.z(), 0.2 * 200.0 * std::sin(0.1) + 2.0, 1e-9);
}

}  // namespace
}  // namespace tenon::collision
