#include "server/collision/query_kernels.h"

#include <bit>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "server/collision/pair_query.h"
#include "server/structures/field_builder.h"
#include "tests/support/analytic_structures.h"

namespace tenon::collision {
namespace {

using test::boxStructures;
using test::StructuresPtr;

/// Field of a box with four times finer voxels in one octant.
test::StructuresPtr refinedBox() {
  const Vector3 size(0.06, 0.05, 0.04);
  const Eigen::AlignedBox3d box(-size / 2, size / 2);
  const std::vector<Eigen::AlignedBox3d> refine{{Vector3::Zero(), size}};
  auto structures = std::make_shared<structures::HapticStructures>();
  structures->field = structures::buildField(test::boxDistance(size), box, 0.002, refine, 4);
  return structures;
}

/// With a dilation of 0 to `largest` [m] that changes from brick to brick.
test::StructuresPtr unevenlyDilated(const test::StructuresPtr& structures, float largest) {
  const structures::DistanceField::Layout& layout = structures->field.layout();
  structures::FieldStorage storage{layout,
                                   {layout.index.begin(), layout.index.end()},
                                   {layout.samples.begin(), layout.samples.end()},
                                   {layout.far.begin(), layout.far.end()},
                                   {}};
  std::size_t corners = 1;
  for (const std::int32_t count : layout.bricks) corners *= static_cast<std::size_t>(count) + 1;
  std::vector<float> dilations(corners);
  for (std::size_t i = 0; i < corners; ++i) dilations[i] = largest * static_cast<float>(i * 7 % 5) / 4.0F;
  auto result = std::make_shared<structures::HapticStructures>(*structures);
  result->field = structures::makeDilatedField(std::move(storage), dilations);
  EXPECT_GT(result->field.slope(), 1.05);
  return result;
}

std::vector<test::StructuresPtr> fields() {
  return {test::boxStructures({0.06, 0.06, 0.06}, 0.002, 0.004),
          test::sphereStructures(0.04, 0.002, 0.004),
          test::cornerStructures(0.1, 0.003),
          test::sheetStructures(0.1, 0.0, 0.002, 0.0007),
          refinedBox(),
          unevenlyDilated(refinedBox(), 0.0015F),
          unevenlyDilated(test::sheetStructures(0.1, 0.001, 0.002, 0.0007), 0.0017F)};
}

Pose poseWithin(std::mt19937_64& engine, double reach) {
  const auto uniform = [&engine] {
    return 2.0 * (static_cast<double>(engine() >> 11U) / 9007199254740992.0) - 1.0;
  };
  Vector3 p;
  Vector3 w;
  for (int i = 0; i < 3; ++i) p[i] = reach * uniform();
  for (int i = 0; i < 3; ++i) w[i] = 2.5 * uniform();
  return {p, expRotation(w)};
}

bool sameBits(const Vector3& a, const Vector3& b) {
  for (int i = 0; i < 3; ++i) {
    if (std::bit_cast<std::uint64_t>(a[i]) != std::bit_cast<std::uint64_t>(b[i])) return false;
  }
  return true;
}

void expectSame(const PairQueryResult& a, const PairQueryResult& b) {
  ASSERT_EQ(a.contacts.size(), b.contacts.size());
  for (std::size_t i = 0; i < a.contacts.size(); ++i) {
    ASSERT_EQ(a.contacts[i].point, b.contacts[i].point);
    ASSERT_EQ(a.contacts[i].gap, b.contacts[i].gap);
    ASSERT_EQ(a.contacts[i].area, b.contacts[i].area);
    ASSERT_TRUE(sameBits(a.contacts[i].p_WP, b.contacts[i].p_WP));
    ASSERT_TRUE(sameBits(a.contacts[i].n_W, b.contacts[i].n_W));
  }
  ASSERT_EQ(a.smallest_gap, b.smallest_gap);
  ASSERT_EQ(a.unlisted_gap, b.unlisted_gap);
  ASSERT_EQ(a.deepest, b.deepest);
  ASSERT_EQ(a.counts.spheres_visited, b.counts.spheres_visited);
  ASSERT_EQ(a.counts.points_visited, b.counts.points_visited);
  ASSERT_EQ(a.counts.points_colliding, b.counts.points_colliding);
}

/// Restores the default kernels of the process.
class QueryKernelsTest : public testing::Test {
 protected:
  ~QueryKernelsTest() override { chooseKernels(supportedKernels().back().isa); }
};

TEST_F(QueryKernelsTest, ScalarCodeIsAlwaysSupportedAndUnknownInstructionSetsAreRejected) {
  EXPECT_EQ(supportedKernels().front().isa, "scalar");
  for (const QueryKernels& kernels : supportedKernels()) EXPECT_TRUE(chooseKernels(kernels.isa));
  EXPECT_FALSE(chooseKernels("abacus"));
}

TEST_F(QueryKernelsTest, EveryInstructionSetGivesTheSameBits) {
  const test::StructuresPtr box = test::boxStructures({0.08, 0.05, 0.03}, 0.002, 0.004);
  const std::vector<test::StructuresPtr> others = fields();
  std::mt19937_64 engine(21);
  const auto expected = std::make_unique<PairQueryResult>();
  const auto expected_later = std::make_unique<PairQueryResult>();
  const auto result = std::make_unique<PairQueryResult>();
  std::size_t found = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const test::StructuresPtr& other = others[static_cast<std::size_t>(trial) % others.size()];
    const Pose X_WA = poseWithin(engine, trial % 7 == 0 ? 0.3 : 0.07);
    PairQuery query{&box->shell, &other->field, X_WA, poseWithin(engine, 0.02), 0.001};
    query.reduce = trial % 2 == 0;
    query.correct_ridges = trial % 4 < 2;
    PairQuery later = query;
    later.X_WA.translation() += Vector3(1e-4, -2e-4, 1e-4);
    for (const QueryKernels& kernels : supportedKernels()) {
      ASSERT_TRUE(chooseKernels(kernels.isa));
      SCOPED_TRACE(testing::Message() << kernels.isa << ", trial " << trial);
      queryPair(query, *result);
      found += result->contacts.size();
      if (kernels.isa == "scalar") *expected = *result;
      expectSame(*expected, *result);
      if (HasFatalFailure()) return;
      resampleContacts(later, 3e-4, *result);
      if (kernels.isa == "scalar") *expected_later = *result;
      expectSame(*expected_later, *result);
      if (HasFatalFailure()) return;
    }
  }
  EXPECT_GT(found, 50000U);
}

TEST_F(QueryKernelsTest, SampledLanesEqualTheSamplesOfTheField) {
  const test::StructuresPtr box = test::boxStructures({0.08, 0.05, 0.03}, 0.002, 0.004);
  std::mt19937_64 engine(22);
  SampleLanes lanes;
  for (const test::StructuresPtr& other : fields()) {
    for (int trial = 0; trial < 50; ++trial) {
      const LaneFrame frame(other->field, poseWithin(engine, 0.07), Pose(), 0.001, box->shell.radius());
      for (const QueryKernels& kernels : supportedKernels()) {
        for (std::size_t leaf = 0; leaf < box->shell.leaves().size(); ++leaf) {
          const structures::ShellBlock& block = box->shell.pointsOfLeaf(leaf);
          SampleSums sums;
          kernels.samples(frame, {block.x.data(), block.y.data(), block.z.data(), block.count}, &lanes, sums);
          const structures::ShellSphere& ball = box->shell.leaves()[leaf];
          for (std::uint32_t i = 0; i < ball.count; ++i) {
            const Vector3 p_AP = box->shell.points()[ball.first + i].p_MP.cast<double>();
            const structures::FieldSample sample = other->field.sample(frame.inB(p_AP));
            ASSERT_EQ(lanes.distance[i], sample.distance) << kernels.isa;
            ASSERT_EQ((lanes.exact >> i & 1U) != 0, sample.exact) << kernels.isa;
            ASSERT_EQ(lanes.gradient_x[i], sample.gradient.x()) << kernels.isa;
            ASSERT_EQ(lanes.gradient_y[i], sample.gradient.y()) << kernels.isa;
            ASSERT_EQ(lanes.gradient_z[i], sample.gradient.z()) << kernels.isa;
          }
        }
      }
    }
  }
}

TEST_F(QueryKernelsTest, PruningChangesNoContact) {
  const test::StructuresPtr box = test::boxStructures({0.08, 0.05, 0.03}, 0.002, 0.006);
  const std::vector<test::StructuresPtr> others = fields();
  std::mt19937_64 engine(23);
  std::size_t contacts = 0;
  std::size_t visited = 0;
  const auto pruned = std::make_unique<PairQueryResult>();
  const auto unpruned = std::make_unique<PairQueryResult>();
  for (int trial = 0; trial < 3000; ++trial) {
    const test::StructuresPtr& other = others[static_cast<std::size_t>(trial) % others.size()];
    PairQuery query{&box->shell, &other->field, poseWithin(engine, 0.07), Pose(), 0.001};
    queryPair(query, *pruned);
    query.prune = false;
    queryPair(query, *unpruned);
    EXPECT_EQ(unpruned->counts.points_visited, box->shell.points().size());
    contacts += unpruned->contacts.size();
    visited += pruned->counts.points_visited;
    ASSERT_EQ(pruned->contacts.size(), unpruned->contacts.size()) << "trial " << trial;
    for (std::size_t i = 0; i < unpruned->contacts.size(); ++i) {
      ASSERT_EQ(pruned->contacts[i].point, unpruned->contacts[i].point);
      ASSERT_EQ(pruned->contacts[i].gap, unpruned->contacts[i].gap);
    }
  }
  EXPECT_GT(contacts, 10'000U);
  EXPECT_LT(visited, 3000 * box->shell.points().size() / 2) << "most points are culled";
}

TEST_F(QueryKernelsTest, NoPointIsNearerThanTheBoundOfCulledPoints) {
  const test::StructuresPtr box = test::boxStructures({0.08, 0.05, 0.03}, 0.002, 0.006);
  const std::vector<test::StructuresPtr> others = fields();
  std::mt19937_64 engine(24);
  int compared = 0;
  const auto result = std::make_unique<PairQueryResult>();
  for (int trial = 0; trial < 500; ++trial) {
    const test::StructuresPtr& other = others[static_cast<std::size_t>(trial) % others.size()];
    const Pose X_WA = poseWithin(engine, trial % 4 == 0 ? 0.2 : 0.07);
    queryPair({&box->shell, &other->field, X_WA, Pose(), 0.0}, *result);
    for (const structures::ShellPoint& point : box->shell.points()) {
      const structures::FieldSample sample = other->field.sample(X_WA * point.p_MP.cast<double>());
      if (!sample.exact) continue;
      ASSERT_LE(result->smallest_gap, sample.distance + 1e-12) << "trial " << trial;
      ++compared;
    }
  }
  EXPECT_GT(compared, 10'000);
}

//   o o o o   A grid so long that floats do not resolve its voxels. One brick
//   --------  holds a floor, and the pointshell lies in that brick.
TEST_F(QueryKernelsTest, NothingIsCulledInAGridTooLongForFloats) {
  constexpr double kVoxel = 0.001;
  constexpr std::int32_t kBricks = 600'000;
  constexpr std::int32_t kFloor = 599'990;
  std::vector<structures::DistanceField::Entry> index(kBricks, structures::DistanceField::kFarOutside);
  index[kFloor] = 0;
  const std::vector<std::int16_t> far(kBricks, 0);
  std::vector<std::int16_t> samples;
  for (int i = 0; i < structures::DistanceField::kBrickSamples; ++i) {
    const int z = i / (structures::DistanceField::kBrickSide * structures::DistanceField::kBrickSide);
    samples.push_back(static_cast<std::int16_t>((z - 4) * structures::DistanceField::kQuantaPerVoxel));
  }
  const structures::DistanceField::Layout layout{.voxel = kVoxel,
                                                 .bricks = {kBricks, 1, 1},
                                                 .band = 4.0 * kVoxel,
                                                 .margin = kVoxel,
                                                 .index = index,
                                                 .samples = samples,
                                                 .far = far};
  const structures::DistanceField floor(layout, nullptr);
  const test::StructuresPtr box = test::boxStructures({0.006, 0.006, 0.004}, 0.0005, 0.001);
  const Pose X_WA(Vector3((kFloor + 0.5) * 8.0 * kVoxel, 0.004, 0.005), Eigen::Quaterniond::Identity());
  const auto result = std::make_unique<PairQueryResult>();
  for (const QueryKernels& kernels : supportedKernels()) {
    ASSERT_TRUE(chooseKernels(kernels.isa));
    queryPair({&box->shell, &floor, X_WA, Pose(), 0.0}, *result);
    EXPECT_GT(result->contacts.size(), 20U) << kernels.isa;
    for (const Contact& contact : result->contacts) EXPECT_NEAR(contact.gap, contact.p_WP.z() - 0.004, 1e-9);
  }
}

}  // namespace
}  // namespace tenon::collision
