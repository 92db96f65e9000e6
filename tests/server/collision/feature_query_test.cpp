#include "server/collision/feature_query.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/structures/shell_builder.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/analytic_structures.h"

namespace tenon::collision {
namespace {

/// Bars of 60 mm along x (A, an edge down) and along y (B, an edge up), 10 mm square.
class FeatureQuery : public ::testing::Test {
 protected:
  FeatureQuery() {
    a_ = test::barShape(Vector3::UnitX());
    b_ = test::barShape(Vector3::UnitY());
  }

  /// A's lowest edge is `gap` [m] above B's highest.
  void query(double gap, const Vector3& off = Vector3::Zero()) {
    query_ = {&a_->shell, &b_->field, Pose(Vector3(0.0, 0.0, 2.0 * kEdge + gap) + off), Pose(), 0.001};
    queryPair(query_, *result_);
    queryFeatures(query_, features_, *scratch_, *result_);
  }
  [[nodiscard]] std::vector<Contact> crossings() const {
    std::vector<Contact> list;
    std::copy_if(result_->contacts.begin(), result_->contacts.end(), std::back_inserter(list),
                 [](const Contact& one) { return one.kind == ContactKind::kCrossing && !one.dormant(); });
    return list;
  }

  static constexpr double kEdge = test::kBarEdge;
  std::shared_ptr<const structures::HapticStructures> a_, b_;
  PairFeatures features_;
  PairQuery query_;
  std::unique_ptr<PairQueryResult> result_ = std::make_unique<PairQueryResult>();
  std::unique_ptr<FeatureScratch> scratch_ = std::make_unique<FeatureScratch>();

  void SetUp() override { features_ = {&a_->features, &b_->features, &a_->field, 0.0}; }
};

TEST_F(FeatureQuery, FindsTheOneCrossingOfTwoEdges) {
  for (const double gap : {0.0007, 0.0, -0.0002}) {
    query(gap, {0.0011, -0.0007, 0.0});
    const auto found = crossings();
    ASSERT_EQ(found.size(), 1U) << gap;
    EXPECT_NEAR(found[0].gap, gap, 1e-7);
    EXPECT_NEAR(found[0].n_W.z(), 1.0, 1e-6) << "from B into A";
    EXPECT_NEAR((found[0].p_WP - Vector3(0.0, -0.0007, kEdge + gap)).norm(), 0.0, 1e-6);
    EXPECT_LE(result_->smallest_gap, gap + 1e-7);
  }
}

TEST_F(FeatureQuery, ResamplingFollowsTheCrossing) {
  query(0.0004);
  query_.X_WA.translation() += Vector3(0.0002, 0.0003, -0.0003);
  resampleFeatures(query_, features_, 0.0006, *result_);
  const auto found = crossings();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].gap, 0.0001, 1e-7);
  EXPECT_NEAR(found[0].p_WP.y(), 0.0003, 1e-6);
}

TEST_F(FeatureQuery, BoundsWhatItDoesNotList) {
  for (const double gap : {0.002, 0.004, 0.01, 0.05}) {
    query(gap);
    EXPECT_TRUE(crossings().empty());
    EXPECT_LE(result_->smallest_gap, gap + 1e-6) << "a bound";
    EXPECT_GE(result_->smallest_gap, std::min(query_.margin, gap - 0.004) - 1e-6) << "not needlessly low";
  }
}

TEST_F(FeatureQuery, EdgesBesideFacesDoNotCross) {
  // A's bar lies with a face on B's edge: points hold it, and no edge of A crosses within the face
  query_ = {
      &a_->shell, &b_->field,
      Pose(Vector3(0.0011, -0.0007, kEdge + 0.005 + 0.0002), expRotation({0.7853981633974483, 0.0, 0.0})),
      Pose(), 0.001};
  queryPair(query_, *result_);
  queryFeatures(query_, features_, *scratch_, *result_);
  // A's two lower edges lie across B's edge, each of them in one piece
  const auto found = crossings();
  EXPECT_EQ(found.size(), 2U);
  for (const Contact& one : found) {
    EXPECT_NEAR(one.gap, 0.0002, 1e-6) << "at the face's borders";
    EXPECT_NEAR(std::abs(one.p_WP.y() + 0.0007), 0.005, 1e-6);
  }
}

TEST_F(FeatureQuery, OnlyCrossingsHaveASecondIndex) {
  // the memory of the list may have held crossings
  for (ContactList* list : {&result_->contacts, &scratch_->of_B.contacts}) {
    list->resize(ContactList::capacity());
    for (Contact& contact : *list) contact.other = 7;
  }
  query(0.0002, {0.0011, 0.0024, 0.0});  // over the middle of a piece of B's edge
  const auto count = [this](ContactKind kind) {
    return std::ranges::count_if(result_->contacts, [kind](const Contact& one) { return one.kind == kind; });
  };
  ASSERT_GT(count(ContactKind::kShellPoint), 0);
  ASSERT_GT(count(ContactKind::kFeaturePoint), 0);
  ASSERT_GT(count(ContactKind::kCrossing), 0);
  for (const Contact& contact : result_->contacts)
    EXPECT_TRUE(contact.kind == ContactKind::kCrossing || contact.other == 0U);
}

TEST_F(FeatureQuery, ResamplingAtTheSamePoseFindsTheSame) {
  // edges meet between two features, faces hold A off, and A's edge is beside the end of B's
  int dormant = 0;
  for (const Vector3& off : {Vector3(0.0011, -0.0007, 0.0), Vector3(0.0002, 0.0302, 0.0)}) {
    query(-0.0002, off);
    const auto before = std::make_unique<PairQueryResult>(*result_);
    resampleFeatures(query_, features_, 0.0, *result_);
    ASSERT_EQ(result_->contacts.size(), before->contacts.size());
    for (std::size_t i = 0; i < before->contacts.size(); ++i) {
      EXPECT_NEAR(result_->contacts[i].gap, before->contacts[i].gap, 1e-9);
      dormant += before->contacts[i].dormant() ? 1 : 0;
    }
    EXPECT_NEAR(result_->deepest, before->deepest, 1e-9);
    EXPECT_EQ(result_->dormant_gap, before->dormant_gap);
  }
  EXPECT_GT(dormant, 0);
  query(-0.0002, {0.0011, -0.0007, 0.0});
  EXPECT_NEAR(result_->deepest, 0.0002, 1e-7);
}

TEST_F(FeatureQuery, TheGapAloneIsABoundOfTheTrueOne) {
  for (const double gap : {0.0004, 0.002, 0.006, 0.02}) {
    for (const double limit : {0.0005, 0.001}) {
      const PairQuery query{&a_->shell, &b_->field, Pose(Vector3(0.0011, -0.0007, 2.0 * kEdge + gap)), Pose(),
                            limit};
      QueryCounts counts;
      const double bound = featureGap(query, features_, *scratch_, counts);
      EXPECT_LE(bound, gap + 1e-6) << "edges cross at this gap";
      EXPECT_GE(bound, std::min(limit, gap) - b_->features.longestHalf() - 2e-5)
          << "lower by half a piece of an edge at most";
      EXPECT_GT(counts.spheres_visited, 0U);
    }
  }
}

/// A cube of 40 mm, 1 mm voxels (A), and features of another body B that a test chooses, in A's frame. They
/// are as listed: features have no order of their own.
class ChosenFeatures : public ::testing::Test {
 protected:
  ChosenFeatures() : cube_(test::boxStructures(Vector3::Constant(0.04), 0.001, 0.001)) {}

  void add(const Vector3& p, const Vector3& half = Vector3::Zero(), const Vector3& into_0 = Vector3::Zero(),
           const Vector3& into_1 = Vector3::Zero()) {
    samples_.push_back({p, Vector3(0.0, 0.0, -1.0), 0.0});
    edges_.push_back({half.cast<float>(), {into_0.cast<float>(), into_1.cast<float>()}});
  }
  structures::FeatureShell taken() {
    std::vector<std::uint32_t> order;
    structures::FeatureStorage storage{structures::buildFlatShell(samples_, 0.001, order), {}};
    for (const std::uint32_t i : order) storage.edges.push_back(edges_[i]);
    samples_.clear();
    edges_.clear();
    return structures::makeFeatureShell(std::move(storage));
  }
  void query(const structures::FeatureShell& of_A, const structures::FeatureShell& of_B,
             const structures::Pointshell& shell_A, const structures::DistanceField& field_B) {
    const PairQuery query{&shell_A, &field_B, Pose(), Pose(), 0.001};
    queryPair(query, *result_);
    queryFeatures(query, {&of_A, &of_B, &cube_->field}, *scratch_, *result_);
  }

  test::StructuresPtr cube_;
  std::vector<structures::SurfaceSample> samples_;
  std::vector<structures::FeatureEdge> edges_;
  std::unique_ptr<PairQueryResult> result_ = std::make_unique<PairQueryResult>();
  std::unique_ptr<FeatureScratch> scratch_ = std::make_unique<FeatureScratch>();
};

//   |____|   the cube's lower side has more points within the margin than the list holds, and as many
//   .:.':.   features of B are below it
TEST_F(ChosenFeatures, AFullListHasTheSmallestGapsOfBothSides) {
  const test::StructuresPtr below = test::boxStructures({0.1, 0.1, 0.02}, 0.001, 0.01);
  const Pose X_WB(Vector3(0.0, 0.0, -0.0302));  // its upper side is 0.2 mm below the cube
  test::SeededRandom random(11);
  std::vector<double> gaps;
  for (int i = 0; i < 400; ++i) {
    const double gap = 0.0005 + 0.0004 * random.symmetric();
    add(X_WB.inverse() * Vector3(0.0015 * (i % 20) - 0.014, 0.0015 * (i / 20) - 0.014, -0.02 - gap));
    gaps.push_back(gap);
  }
  std::ranges::sort(gaps);
  const structures::FeatureShell of_B = taken();
  const PairQuery query{&cube_->shell, &below->field, Pose(), X_WB, 0.001};
  queryPair(query, *result_);
  ASSERT_EQ(result_->contacts.size(), ContactList::capacity());
  const std::uint32_t dropped = result_->counts.contacts_dropped;
  const structures::FeatureShell none;
  queryFeatures(query, {&none, &of_B, &cube_->field}, *scratch_, *result_);
  ASSERT_EQ(result_->contacts.size(), ContactList::capacity());
  EXPECT_EQ(result_->counts.contacts_dropped, dropped + 400U) << "128 shell points, 272 features";
  std::vector<double> listed;
  for (const Contact& contact : result_->contacts)
    if (contact.kind == ContactKind::kFeaturePoint) listed.push_back(contact.gap);
  ASSERT_EQ(listed.size(), kFeatureRoom);
  std::ranges::sort(listed);
  for (std::size_t i = 0; i < listed.size(); ++i) ASSERT_NEAR(listed[i], gaps[i], 1e-6) << i;
  EXPECT_LE(result_->complete_to, gaps[kFeatureRoom] + 1e-6);
}

TEST_F(ChosenFeatures, WhatIsBeyondTheMarginIsNotDropped) {
  // 600 features 2 mm below the cube, and an edge far away, for which contacts are searched up to 3 mm
  for (int i = 0; i < 600; ++i) add({0.0012 * (i % 25) - 0.015, 0.0012 * (i / 25) - 0.015, -0.022});
  add({0.1, 0.0, 0.0}, {0.002, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0});
  query(structures::FeatureShell(), taken(), structures::Pointshell(), structures::DistanceField());
  EXPECT_TRUE(result_->contacts.empty());
  EXPECT_EQ(result_->counts.contacts_dropped, 0U);
}

//   |_____|    600 points of B 0.2 mm below A's edge are more than a list takes, and B has a longer edge
//   .:.:.:.    elsewhere: where that could cross is within the margin, but nothing overlaps
TEST_F(ChosenFeatures, WhatAFullListMayLackIsNoOverlap) {
  const double s = std::sqrt(0.5);
  add({0.018, 0.0, -0.02}, {0.002, 0.0, 0.0}, {0.0, s, s}, {0.0, -s, s});
  const structures::FeatureShell of_A = taken();
  for (int i = 0; i < 600; ++i) add({0.0012 * (i % 25) - 0.015, 0.0012 * (i / 25) - 0.015, -0.0202});
  add({0.1, 0.0, 0.0}, {0.002, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0});
  query(of_A, taken(), structures::Pointshell(), structures::DistanceField());
  EXPECT_FALSE(result_->contacts.empty());
  EXPECT_EQ(result_->deepest, 0.0);
  EXPECT_GE(result_->smallest_gap, 0.0);
}

//       ___________ A's edge, of which B's edges pass the end
//   | | |           they are dormant: 100 of them, 0.1 to 0.3 mm beside the end, 0.1 mm below
TEST_F(ChosenFeatures, DormantCrossingsThatAreNotListedCountWithTheirDistance) {
  const double s = std::sqrt(0.5);
  add({0.018, 0.0, -0.02}, {0.002, 0.0, 0.0}, {0.0, s, s}, {0.0, -s, s});
  const structures::FeatureShell of_A = taken();
  std::vector<double> distances;
  for (int i = 0; i < 100; ++i) {
    const double beside = 0.0001 + 2e-6 * i;
    add({0.02 + beside, 0.0, -0.0201}, {0.0, 0.002, 0.0}, {s, 0.0, -s}, {-s, 0.0, -s});
    distances.push_back(std::hypot(beside, 0.0001));
  }
  query(of_A, taken(), structures::Pointshell(), structures::DistanceField());
  std::vector<double> listed;
  for (const Contact& contact : result_->contacts)
    if (contact.kind == ContactKind::kCrossing) listed.push_back(contact.gapBound());
  ASSERT_EQ(listed.size(), kMaxCrossings);
  std::ranges::sort(listed);
  for (std::size_t i = 0; i < listed.size(); ++i) ASSERT_NEAR(listed[i], distances[i], 1e-7) << i;
  EXPECT_NEAR(result_->dormant_gap, distances[0], 1e-7);
  EXPECT_LE(result_->unlisted_gap, distances[kMaxCrossings] + 1e-7);
  EXPECT_GT(result_->unlisted_gap, distances[kMaxCrossings - 1] - 1e-7);
  EXPECT_LE(result_->complete_to, distances[kMaxCrossings] + 1e-7);
  EXPECT_EQ(result_->counts.contacts_dropped, 0U) << "they hold nothing";
}

//  A's or B's corner beside the other's edge along x, whose faces are at -45 and 45 degrees below it
class PointsBesideEdges : public ChosenFeatures {
 protected:
  static constexpr double kReach = 0.003;  // [m]

  void addEdge() {
    const double s = std::sqrt(0.5);
    add({0.0, 0.0, 0.02}, {0.003, 0.0, 0.0}, {0.0, s, -s}, {0.0, -s, -s});
    edges_.back().reach = kReach;
  }
  [[nodiscard]] std::vector<Contact> crossings() const {
    std::vector<Contact> list;
    std::ranges::copy_if(result_->contacts, std::back_inserter(list),
                         [](const Contact& one) { return one.kind == ContactKind::kCrossing; });
    return list;
  }
};

TEST_F(PointsBesideEdges, HaveTheGapOfTheWedge) {
  const double s = std::sqrt(0.5);
  // over one face, over the edge itself, and behind the other face
  for (const Vector3& r :
       {Vector3(0.001, 0.0012, -0.001), Vector3(0.0, 0.0, 0.0003), Vector3(0.0, -0.0005, -0.0007)}) {
    const double gap = std::max(s * (r.y() + r.z()), s * (r.z() - r.y()));
    add(Vector3(0.0, 0.0, 0.02) + r);
    const structures::FeatureShell point = taken();
    addEdge();
    const structures::FeatureShell edge = taken();
    query(point, edge, structures::Pointshell(), structures::DistanceField());
    std::vector<Contact> found = crossings();
    ASSERT_EQ(found.size(), 1U);
    EXPECT_NEAR(found[0].gap, gap, 1e-8);
    EXPECT_NEAR(found[0].n_W.z(), s, 1e-6) << "out of B, into A";
    query(edge, point, structures::Pointshell(), structures::DistanceField());
    found = crossings();
    ASSERT_EQ(found.size(), 1U);
    EXPECT_NEAR(found[0].gap, gap, 1e-8);
    EXPECT_NEAR(found[0].n_W.z(), -s, 1e-6) << "out of B, into A";
    EXPECT_NEAR((found[0].p_WP - Vector3(0.0, 0.0, 0.02) - r).norm(), 0.0, 1e-8);
  }
}

TEST_F(PointsBesideEdges, HoldNothingBeyondTheEndsAndTheReachOfTheEdge) {
  for (const Vector3& r : {Vector3(0.0034, 0.0, -0.0001), Vector3(0.0, 0.0024, -0.0024)}) {
    add(Vector3(0.0, 0.0, 0.02) + r);
    const structures::FeatureShell point = taken();
    addEdge();
    query(point, taken(), structures::Pointshell(), structures::DistanceField());
    const std::vector<Contact> found = crossings();
    ASSERT_EQ(found.size(), 1U) << "within the margin of motion";
    EXPECT_TRUE(found[0].dormant());
    const double beyond = std::max(std::abs(r.x()) - 0.003, 0.0);
    EXPECT_NEAR(found[0].gapBound(), std::hypot(beyond, r.y(), r.z()), 1e-7) << "distance of the segment";
  }
}

// From above, the edge along x; its end is skewed as the plane between two pieces of a rim.
//   ____.    acute: the end is before the perpendicular one where the solid is
//   ____.    of a hole's rim: it is behind it, so that no sector between two pieces is without a row
TEST_F(PointsBesideEdges, AreBetweenSkewedEnds) {
  const auto isHeld = [this](double before, double beyond, double y) {
    add(Vector3(0.003 + beyond, y, 0.0199));
    const structures::FeatureShell point = taken();
    add({0.0, 0.0, 0.02}, {0.003, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, -1.0});
    edges_.back().reach = kReach;
    edges_.back().beyond = {1.0F, 1.0F};
    edges_.back().skew[1] = {static_cast<float>(before), 0.0F};
    query(point, taken(), structures::Pointshell(), structures::DistanceField());
    const std::vector<Contact> found = crossings();
    return found.size() == 1U && !found[0].dormant();
  };
  EXPECT_TRUE(isHeld(0.0, -0.0001, 0.001)) << "perpendicular";
  EXPECT_FALSE(isHeld(0.0, 0.0001, 0.001));
  EXPECT_TRUE(isHeld(0.5, -0.0006, 0.001)) << "acute";
  EXPECT_FALSE(isHeld(0.5, -0.0004, 0.001));
  EXPECT_TRUE(isHeld(-0.5, 0.0004, 0.001)) << "a rim";
  EXPECT_FALSE(isHeld(-0.5, 0.0006, 0.001));
  EXPECT_TRUE(isHeld(-0.5, -0.0001, -0.0005)) << "beside the solid both pieces hold";
  EXPECT_FALSE(isHeld(-0.2, -0.00005, -0.0005)) << "one is enough where they turn little";
}

/// A plate of 60 x 60 x 10 mm, its upper side at z = 0, with a hole of `facets` facets and a radius [m].
bake::TriangleMesh plateWithHole(int facets, double radius) {
  bake::TriangleMesh mesh;
  for (const double z : {-0.01, 0.0}) {
    for (int k = 0; k < facets; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / facets;
      const Vector3 out(std::cos(angle), std::sin(angle), 0.0);
      const double to_side = 0.03 / out.cwiseAbs().maxCoeff();
      for (const double r : {radius, to_side})
        mesh.vertices.push_back((r * out + Vector3(0.0, 0.0, z)).cast<float>());
    }
  }
  const auto vertex = [facets](int k, int outer, int upper) {
    return static_cast<std::uint32_t>(2 * (facets * upper + k % facets) + outer);
  };
  const auto quad = [&mesh](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (int k = 0; k < facets; ++k) {
    quad(vertex(k, 0, 1), vertex(k, 1, 1), vertex(k + 1, 1, 1), vertex(k + 1, 0, 1));
    quad(vertex(k, 0, 0), vertex(k + 1, 0, 0), vertex(k + 1, 1, 0), vertex(k, 1, 0));
    quad(vertex(k, 0, 0), vertex(k, 0, 1), vertex(k + 1, 0, 1), vertex(k + 1, 0, 0));
    quad(vertex(k, 1, 0), vertex(k + 1, 1, 0), vertex(k + 1, 1, 1), vertex(k, 1, 1));
  }
  return mesh;
}

//  ____ . ____   a corner at the rim of a hole, in the plate, is held wherever it is: between two facets too
//      | |
TEST(RimOfAHole, LeavesNoSectorOut) {
  constexpr int kFacets = 16;
  constexpr double kRadius = 0.01;
  const auto plate = test::baked(plateWithHole(kFacets, kRadius), 0.002, 2000);
  ASSERT_TRUE(plate);
  const auto result = std::make_unique<PairQueryResult>();
  const auto scratch = std::make_unique<FeatureScratch>();
  const structures::Pointshell no_shell;
  const structures::DistanceField no_field;
  for (int i = 0; i < 64; ++i) {
    const double angle = 2.0 * std::numbers::pi * (i + 0.03) / 64.0;  // 0.03 mm beside a vertex
    const double facet = 2.0 * std::numbers::pi / kFacets;
    const double to_middle = angle - facet * (std::floor(angle / facet) + 0.5);
    constexpr double kBeside = 0.0003;
    constexpr double kBelow = 0.0002;
    const double flat = kRadius * std::cos(0.5 * facet);  // of the facets
    const double r = flat / std::cos(to_middle) + kBeside;
    const std::vector<structures::SurfaceSample> samples{
        {{r * std::cos(angle), r * std::sin(angle), -kBelow}, -Vector3::UnitZ(), 0.0}};
    std::vector<std::uint32_t> order;
    structures::FeatureStorage storage{structures::buildFlatShell(samples, 0.001, order), {}};
    storage.edges.resize(1);
    const structures::FeatureShell corner = structures::makeFeatureShell(std::move(storage));
    const PairQuery query{&no_shell, &no_field, Pose(), Pose(), 0.001};
    queryPair(query, *result);
    queryFeatures(query, {&plate->features, &corner, &plate->field}, *scratch, *result);
    const auto held = std::ranges::count_if(result->contacts, [](const Contact& one) {
      return one.kind == ContactKind::kCrossing && !one.dormant();
    });
    EXPECT_EQ(held, 1) << "at " << angle << " rad";
    for (const Contact& one : result->contacts) {
      if (one.kind == ContactKind::kCrossing && !one.dormant()) {
        EXPECT_NEAR(one.gap, -kBelow, 1e-7);
      }
    }
  }
}

// Facets that are one line by the spacing of the points would narrow a hole that fits within a voxel.
TEST(RimOfAHole, IsAsWideAsItsFacetsWhereVoxelsAreSmall) {
  constexpr int kFacets = 64;
  constexpr double kRadius = 0.005;
  const Vector3 half(0.006, 0.006, 0.001);
  const auto plate = test::baked(plateWithHole(kFacets, kRadius), 0.002, 2000, {{{-half, half}}});
  int pieces = 0;
  for (std::size_t i = 0; i < plate->features.edges().size(); ++i) {
    const Vector3f& p = plate->features.points().points()[i].p_MP;
    if (!isEdge(plate->features, i) || std::abs(p.z()) > 1e-6F || p.norm() > 0.01F) continue;
    EXPECT_GE(p.norm(), kRadius * std::cos(std::numbers::pi / kFacets) - 1e-6);
    ++pieces;
  }
  EXPECT_EQ(pieces, kFacets);
}

// A shell of one level with many clusters is descended by blocks of them.
TEST(BlocksOfClusters, ListTheSameContactsAsTestingEveryPoint) {
  const auto samples = test::boxSamples({0.6, 0.5, 0.4}, 0.006);
  std::vector<std::uint32_t> order;
  const structures::Pointshell shell =
      structures::makeShell(structures::buildFlatShell(samples, 0.006, order));
  ASSERT_FALSE(shell.blockSpheres().empty());
  const auto ball = test::sphereStructures(0.05, 0.004, 0.01);
  const auto pruned = std::make_unique<PairQueryResult>();
  const auto unpruned = std::make_unique<PairQueryResult>();
  test::SeededRandom random(7);
  std::size_t contacts = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Vector3 p(0.3 * random.symmetric(), 0.25 * random.symmetric(), 0.25 + 0.02 * random.symmetric());
    PairQuery query{&shell, &ball->field, Pose(), Pose(p), 0.001};
    queryPair(query, *pruned);
    query.prune = false;
    queryPair(query, *unpruned);
    ASSERT_EQ(pruned->contacts.size(), unpruned->contacts.size()) << trial;
    for (std::size_t i = 0; i < unpruned->contacts.size(); ++i)
      ASSERT_EQ(pruned->contacts[i].point, unpruned->contacts[i].point);
    EXPECT_LE(pruned->smallest_gap, unpruned->smallest_gap);
    EXPECT_LT(pruned->counts.points_visited, unpruned->counts.points_visited);
    EXPECT_LE(pruned->counts.spheres_visited, pruned->counts.spheres_total);
    contacts += unpruned->contacts.size();
  }
  EXPECT_GT(contacts, 100U);
}

}  // namespace
}  // namespace tenon::collision
