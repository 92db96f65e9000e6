#include "server/collision/pair_query.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "server/collision/query_kernels.h"
#include "tests/support/analytic_structures.h"
#include "tests/support/realtime_guard.h"

namespace tenon::collision {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::floorStructures;
using test::sheetStructures;
using test::sphereStructures;
using test::StructuresPtr;

struct QueryOutcome {
  test::StructuresPtr other;
  PairQuery query;
  std::unique_ptr<PairQueryResult> result = std::make_unique<PairQueryResult>();

  const PairQueryResult& operator*() const { return *result; }
  const PairQueryResult* operator->() const { return result.get(); }
};

QueryOutcome run(const test::StructuresPtr& a, const test::StructuresPtr& b, const Pose& X_WA,
                 const Pose& X_WB, double dilation, double margin, std::uint32_t levels = 0xFFFFFFFFU) {
  QueryOutcome outcome;
  outcome.other = test::dilated(b, dilation);
  outcome.query = {&a->shell, &outcome.other->field, X_WA, X_WB, margin, levels};
  queryPair(outcome.query, *outcome.result);
  return outcome;
}

/// Contacts by testing every point, without the hierarchy: the reference for the traversal.
std::vector<Contact> contactsOfAllPoints(const PairQuery& query) {
  const LaneFrame frame(*query.field_B, query.X_WA, query.X_WB, query.margin, query.shell_A->radius());
  std::vector<Contact> contacts;
  const auto points = query.shell_A->points();
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const structures::FieldSample sample = query.field_B->sample(frame.inB(points[i].p_MP.cast<double>()));
    Contact contact;
    contact.gap = sample.distance;
    contact.point = i;
    if (sample.exact && contact.gap <= query.margin) contacts.push_back(contact);
  }
  return contacts;
}

Pose randomPose(std::mt19937_64& engine, double reach) {
  const auto uniform = [&engine] {
    return 2.0 * (static_cast<double>(engine() >> 11U) / 9007199254740992.0) - 1.0;
  };
  Vector3 p;
  Vector3 w;
  for (int i = 0; i < 3; ++i) p[i] = reach * uniform();
  for (int i = 0; i < 3; ++i) w[i] = 2.5 * uniform();
  return {p, expRotation(w)};
}

TEST(PairQuery, ListsTheSameContactsAsTestingEveryPoint) {
  const test::StructuresPtr box =
      test::boxStructures({0.08, 0.05, 0.03}, 0.002, 0.006);  // fewer points than the list's capacity
  const std::vector<test::StructuresPtr> others{
      test::boxStructures({0.06, 0.06, 0.06}, 0.002, 0.004), test::sphereStructures(0.04, 0.002, 0.004),
      test::cornerStructures(0.1, 0.003), test::sheetStructures(0.1, 0.0, 0.002, 0.0007)};
  std::mt19937_64 engine(11);
  std::size_t found = 0;
  std::uint64_t visited = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const test::StructuresPtr& other = others[static_cast<std::size_t>(trial) % others.size()];
    const QueryOutcome outcome =
        run(box, other, randomPose(engine, 0.07), randomPose(engine, 0.02), 0.0004, 0.001);
    const std::vector<Contact> expected = contactsOfAllPoints(outcome.query);
    ASSERT_EQ(outcome->counts.contacts_dropped, 0U);
    ASSERT_EQ(outcome->contacts.size(), expected.size()) << "trial " << trial;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_EQ(outcome->contacts[i].point, expected[i].point);
      ASSERT_EQ(outcome->contacts[i].gap, expected[i].gap);
    }
    found += expected.size();
    visited += outcome->counts.points_visited;
  }
  EXPECT_GT(found, 20000U);
  EXPECT_LT(visited, 4000U * box->shell.points().size()) << "nothing was pruned";
}

TEST(PairQuery, GapsAndNormalsOnASphereAreThoseOfTheFormula) {
  const test::StructuresPtr tool = test::sphereStructures(0.01, 0.001, 0.002);
  const test::StructuresPtr ball = test::sphereStructures(0.05, 0.001, 0.004);
  const Pose X_WB(Vector3(0.2, -0.1, 0.3), expRotation({0.3, -0.7, 0.2}));
  const Vector3 away = Vector3(1.0, 2.0, -0.5).normalized();
  const Pose X_WA(X_WB.translation() + 0.0595 * away, expRotation({1.0, 0.4, 0.0}));
  const QueryOutcome outcome = run(tool, ball, X_WA, X_WB, 0.0, 0.001);
  ASSERT_GT(outcome->contacts.size(), 3U);
  for (const Contact& contact : outcome->contacts) {
    const Vector3 from_centre = contact.p_WP - X_WB.translation();
    EXPECT_NEAR(contact.gap, from_centre.norm() - 0.05, 1e-5);
    EXPECT_GT(contact.n_W.dot(from_centre.normalized()), 0.9998);
    EXPECT_NEAR(contact.n_W.norm(), 1.0, 1e-12);
  }
  EXPECT_NEAR(outcome->deepest, 0.0005, 6e-5);  // points are 2 mm apart
}

//    [ A ]      margin 1 mm: only the underside is listed, with its positive gap
//    - - -      dilated floor
//    -----      floor at z = 0
TEST(PairQuery, ListsContactsWithinTheMarginBeforeTheyTouch) {
  const test::StructuresPtr box = test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004);
  const test::StructuresPtr floor = test::floorStructures(0.3, 0.002);
  const QueryOutcome outcome = run(box, floor, Pose(Vector3(0.0, 0.0, 0.01 + 0.0009)), Pose(), 0.0004, 0.001);
  EXPECT_EQ(outcome->contacts.size(), 11U * 11U);
  for (const Contact& contact : outcome->contacts) {
    EXPECT_NEAR(contact.gap, 0.0005, 2e-6);
    EXPECT_NEAR(contact.n_W.z(), 1.0, 1e-9);
  }
  EXPECT_NEAR(outcome->smallest_gap, 0.0005, 2e-6);
  EXPECT_EQ(outcome->deepest, 0.0);
  EXPECT_EQ(outcome->counts.points_colliding, 0U);
}

TEST(PairQuery, SmallestGapIsALowerBoundOfTheTrueGap) {
  const test::StructuresPtr box = test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004);
  const test::StructuresPtr ball = test::sphereStructures(0.03, 0.002, 0.004);
  std::mt19937_64 engine(12);
  for (int trial = 0; trial < 500; ++trial) {
    const Pose X_WA = randomPose(engine, 0.3);
    const QueryOutcome outcome = run(box, ball, X_WA, Pose(), 0.0, 0.0005);
    double truth = 1e9;
    for (const structures::ShellPoint& point : box->shell.points()) {
      truth = std::min(truth, (X_WA * point.p_MP.cast<double>()).norm() - 0.03);
    }
    // deeper than the band the field only has the sign
    EXPECT_LE(outcome->smallest_gap, std::max(truth, -0.007) + 2e-5);
    if (truth > 0.1) {
      EXPECT_GT(outcome->smallest_gap, 0.3 * truth);
    }
  }
}

TEST(PairQuery, AFullListKeepsTheSmallestGaps) {
  const test::StructuresPtr plate = test::boxStructures({0.1, 0.1, 0.01}, 0.002, 0.003);
  const test::StructuresPtr floor = test::floorStructures(0.3, 0.002);
  const Pose X_WA(Vector3(0.0, 0.0, 0.005), expRotation({0.004, 0.002, 0.0}));
  const QueryOutcome outcome = run(plate, floor, X_WA, Pose(), 0.0, 0.001);
  std::vector<Contact> expected = contactsOfAllPoints(outcome.query);
  ASSERT_GT(expected.size(), kMaxPairContacts);
  EXPECT_EQ(outcome->counts.contacts_dropped, expected.size() - kMaxPairContacts);
  std::sort(expected.begin(), expected.end(),
            [](const Contact& a, const Contact& b) { return a.gap < b.gap; });
  double largest = -1.0;
  for (const Contact& contact : outcome->contacts) largest = std::max(largest, contact.gap);
  EXPECT_EQ(outcome->contacts.size(), kMaxPairContacts);
  EXPECT_EQ(largest, expected[kMaxPairContacts - 1].gap);
  EXPECT_EQ(outcome->complete_to, largest);
}

TEST(PairQuery, WithoutAGradientTheNormalIsThatOfThePointshell) {
  // the field has a ridge in the middle of a thin plate
  const test::StructuresPtr box = test::boxStructures({0.02, 0.02, 0.02}, 0.002, 0.005);
  const test::StructuresPtr sheet = test::sheetStructures(0.2, 0.002, 0.002);
  const QueryOutcome outcome = run(box, sheet, Pose(Vector3(0.0, 0.0, 0.01)), Pose(), 0.0005, 0.0);
  ASSERT_GT(outcome->contacts.size(), 8U);
  int on_ridge = 0;
  for (const Contact& contact : outcome->contacts) {
    EXPECT_NEAR(contact.n_W.norm(), 1.0, 1e-6);
    if (std::abs(contact.p_WP.x()) < 0.009 && std::abs(contact.p_WP.y()) < 0.009) {
      EXPECT_NEAR(contact.n_W.z(), 1.0, 1e-6);
      ++on_ridge;
    }
  }
  EXPECT_GT(on_ridge, 0);
}

TEST(PairQuery, FewerLevelsRepresentTheSameSurface) {
  const test::StructuresPtr box = test::boxStructures({0.06, 0.06, 0.03}, 0.002, 0.002);
  const test::StructuresPtr floor = test::floorStructures(0.3, 0.002);
  ASSERT_GT(box->shell.levels().size(), 1U);
  const Pose X_WA(Vector3(0.0, 0.0, 0.0145));
  const auto force = [&](std::uint32_t levels) {
    const QueryOutcome outcome = run(box, floor, X_WA, Pose(), 0.0, 0.0, levels);
    return penaltyWrench(*outcome, X_WA.translation(), 1000.0).force.z();
  };
  // 0.5 mm deep over 36 cm^2, listed with at most 512 points
  const QueryOutcome coarse = run(box, floor, X_WA, Pose(), 0.0, 0.0, 1);
  const QueryOutcome fine = run(box, floor, X_WA, Pose(), 0.0, 0.0, 2);
  EXPECT_LT(coarse->counts.points_visited, fine->counts.points_visited);
  EXPECT_NEAR(force(1) / force(2), 1.0, 0.35);
}

TEST(PenaltyWrench, IsStiffnessTimesDepthTimesAreaOfAPlaneContact) {
  const test::StructuresPtr box = test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004);
  const test::StructuresPtr floor = test::floorStructures(0.3, 0.002);
  const Pose X_WA(Vector3(0.01, 0.02, 0.0095));
  const QueryOutcome outcome = run(box, floor, X_WA, Pose(), 0.0, 0.0);
  const Wrench F_Ao_W = penaltyWrench(*outcome, X_WA.translation(), 1000.0);
  // underside 16 cm^2; points of its rim represent the sides by half of their area
  double area = 0.0;
  for (const Contact& contact : outcome->contacts) area += contact.area;
  EXPECT_NEAR(F_Ao_W.force.z(), 1000.0 * 0.0005 * area / 1e-4, 0.01);
  EXPECT_LT(F_Ao_W.force.head<2>().norm(), 1e-6);
  EXPECT_LT(F_Ao_W.torque.norm(), 1e-3);

  // about another point the torque is that of the lever arm
  const Vector3 p_WQ = X_WA.translation() + Vector3(0.1, 0.0, 0.0);
  EXPECT_NEAR(penaltyWrench(*outcome, p_WQ, 1000.0).torque.y(), 0.1 * F_Ao_W.force.z(), 1e-3);
}

TEST(PenaltyWrench, OfABallInAFloorIsTheIntegralOfDepthOverTheCap) {
  const double r = 0.02;
  const double depth = 0.003;
  const test::StructuresPtr ball = test::sphereStructures(r, 0.002, 0.001);
  const test::StructuresPtr floor = test::floorStructures(0.3, 0.002);
  const Pose X_WA(Vector3(0.0, 0.0, r - depth), expRotation({0.2, 0.1, 0.0}));
  const QueryOutcome outcome = run(ball, floor, X_WA, Pose(), 0.0, 0.0);
  ASSERT_EQ(outcome->counts.contacts_dropped, 0U);
  // integral of depth over the surface of the cap: 2 pi r * depth^2 / 2
  const double truth = 1000.0 / 1e-4 * std::numbers::pi * r * depth * depth;
  EXPECT_NEAR(penaltyWrench(*outcome, X_WA.translation(), 1000.0).force.z(), truth, 0.03 * truth);
}

TEST(PenaltyWrench, IncludesThePointsThatDoNotFitTheList) {
  const test::StructuresPtr plate = test::boxStructures({0.1, 0.1, 0.01}, 0.002, 0.003);
  const test::StructuresPtr floor = test::floorStructures(0.3, 0.002);
  QueryOutcome outcome = run(plate, floor, Pose(Vector3(0.0, 0.0, 0.0048)), Pose(), 0.0, 0.0);
  ASSERT_GT(outcome->counts.contacts_dropped, 0U);
  outcome.query.sum_penalty = true;
  queryPair(outcome.query, *outcome.result);
  EXPECT_EQ(outcome->penalty_points, outcome->contacts.size() + outcome->counts.contacts_dropped);
  double area = 0.0;
  for (const Contact& contact : contactsOfAllPoints(outcome.query)) {
    area += static_cast<double>(plate->shell.points()[contact.point].area);
  }
  EXPECT_NEAR(outcome->penalty_Ao_W.force.z(), 0.0002 * area / 1e-4, 1e-6 * area / 1e-4);
}

TEST(PenaltyWrench, IsIndependentOfTheWorldFrame) {
  const test::StructuresPtr box = test::boxStructures({0.04, 0.03, 0.02}, 0.002, 0.004);
  const test::StructuresPtr other = test::cornerStructures(0.1, 0.003);
  const Pose X_WA(Vector3(0.019, 0.02, 0.012), expRotation({0.1, 0.2, 0.05}));
  const Pose X_VW(Vector3(0.4, -0.2, 0.1), expRotation({0.5, -1.2, 0.8}));
  const QueryOutcome here = run(box, other, X_WA, Pose(), 0.001, 0.0);
  const QueryOutcome there = run(box, other, X_VW * X_WA, X_VW, 0.001, 0.0);
  const Wrench F_W = penaltyWrench(*here, X_WA.translation(), 1000.0);
  const Wrench F_V = penaltyWrench(*there, (X_VW * X_WA).translation(), 1000.0);
  EXPECT_GT(F_W.force.norm(), 1.0);
  EXPECT_LE((F_V.force - X_VW.rotation() * F_W.force).norm(), 1e-8 * F_W.force.norm());
  EXPECT_LE((F_V.torque - X_VW.rotation() * F_W.torque).norm(), 1e-8 * F_W.force.norm());
}

TEST(SelectRepresentatives, SelectsTheDeepestAndTheCornersOfAPatch) {
  ContactList contacts;
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 20; ++k) {
      Contact contact;
      contact.p_WP = Vector3(0.01 * i, 0.01 * k, 0.0);
      contact.n_W = Vector3::UnitZ();
      contact.gap = i == 7 && k == 11 ? -0.001 : 0.0;
      contact.point = static_cast<std::uint32_t>(20 * i + k);
      contacts.push_back(contact);
    }
  }
  std::array<std::uint32_t, 5> chosen{};
  ASSERT_EQ(selectRepresentatives(contacts, chosen), 5U);
  EXPECT_EQ(chosen[0], 7U * 20U + 11U);
  const std::set<std::uint32_t> corners(chosen.begin() + 1, chosen.end());
  EXPECT_EQ(corners, (std::set<std::uint32_t>{0, 19, 380, 399}));
}

TEST(SelectRepresentatives, SelectsAContactOfADifferentNormal) {
  ContactList contacts;
  for (std::uint32_t i = 0; i < 100; ++i) {
    Contact contact;
    contact.p_WP = Vector3(0.001 * i, 0.0, 0.0);
    contact.n_W = i == 50 ? Vector3::UnitX() : Vector3::UnitZ();
    contact.point = i;
    contacts.push_back(contact);
  }
  std::array<std::uint32_t, 3> chosen{};
  ASSERT_EQ(selectRepresentatives(contacts, chosen), 3U);
  EXPECT_TRUE(std::find(chosen.begin(), chosen.end(), 50U) != chosen.end());
  ContactList none;
  EXPECT_EQ(selectRepresentatives(none, chosen), 0U);
}

//   0 1 2 ... 9   in a row: beside 5 and 3 the ends differ most, 9 more than 0
TEST(SelectRepresentatives, ThoseThatAreGivenComeFirst) {
  ContactList contacts;
  for (std::uint32_t i = 0; i < 10; ++i) {
    Contact contact;
    contact.p_WP = Vector3(0.001 * i, 0.0, 0.0);
    contact.n_W = Vector3::UnitZ();
    contact.gap = i == 7 ? -0.001 : 0.0;
    contacts.push_back(contact);
  }
  std::array<std::uint32_t, 4> chosen{5, 3};
  ASSERT_EQ(selectRepresentatives(contacts, chosen, 2), 4U);
  EXPECT_EQ(chosen, (std::array<std::uint32_t, 4>{5, 3, 9, 0}));
  std::array<std::uint32_t, 2> full{5, 3};
  ASSERT_EQ(selectRepresentatives(contacts, full, 2), 2U);
  EXPECT_EQ(full, (std::array<std::uint32_t, 2>{5, 3}));
}

TEST(SelectRepresentatives, DormantCrossingsAreNone) {
  ContactList contacts;
  for (std::uint32_t i = 0; i < 40; ++i) {
    Contact contact;
    contact.p_WP = Vector3(0.001 * i, 0.0, 0.0);
    contact.n_W = i % 2 == 0 ? Vector3::UnitX() : Vector3::UnitZ();
    contact.gap = i % 4 == 3 ? 1e-4 : kDormantGap + 1e-4;
    contacts.push_back(contact);
  }
  std::array<std::uint32_t, 16> chosen{};
  ASSERT_EQ(selectRepresentatives(contacts, chosen), 10U);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(chosen[i] % 4, 3U);
}

TEST(QueryCounts, LoadIsThatOfThePapersEquation2) {
  QueryCounts counts;
  EXPECT_EQ(counts.loadPercent(), 0.0);
  counts.spheres_visited = 30;
  counts.spheres_total = 100;
  counts.points_visited = 200;
  counts.points_colliding = 50;
  EXPECT_DOUBLE_EQ(counts.loadPercent(), 100.0 * (0.5 * 0.3 + 0.5 * 0.25));
}

TEST(PairQuery, AllocatesNothing) {
  const test::StructuresPtr plate = test::boxStructures({0.1, 0.1, 0.01}, 0.002, 0.003);
  const test::StructuresPtr floor = test::floorStructures(0.3, 0.002);
  QueryOutcome outcome = run(plate, floor, Pose(Vector3(0.0, 0.0, 0.005)), Pose(), 0.0, 0.001);
  std::array<std::uint32_t, 16> chosen{};
  const test::RealtimeGuard guard;
  for (int i = 0; i < 20; ++i) {
    outcome.query.correct_ridges = i % 2 == 0;
    queryPair(outcome.query, *outcome.result);
    selectRepresentatives(outcome->contacts, chosen);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::collision
