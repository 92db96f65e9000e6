#include "server/bake/field_size.h"

#include <cmath>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/bake/field_bake.h"
#include "server/bake/parallel.h"
#include "server/bake/welded_mesh.h"
#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

BakeOptions withVoxel(double voxel) {
  BakeOptions options;
  options.voxel = voxel;
  options.points = 200;
  return options;
}

/// [bricks] The field that is really baked.
double bakedBricks(const TriangleMesh& mesh, const BakeOptions& options) {
  const auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << structures.error().what;
  return structures ? static_cast<double>(structures->info.bricks) : 0.0;
}

FieldSize estimated(const TriangleMesh& mesh, const BakeOptions& options) {
  return estimateSize(WeldedMesh(mesh).triangles, options);
}

TEST(FieldSizeTruth, IsThatOfTheBakedFieldWhateverTheShape) {
  const TriangleMesh ball = test::ballMesh(0.05, 4);
  const TriangleMesh box = test::boxMesh(Vector3(-0.04, -0.03, -0.02), Vector3(0.04, 0.03, 0.021));
  const TriangleMesh sheet = test::sheetMesh(0.05, 0.013, 20);
  const TriangleMesh sliver = test::boxMesh(Vector3(-0.4, 0.1, 0.02), Vector3(0.4, 0.109, 0.021));
  for (const TriangleMesh* mesh : {&ball, &box, &sheet, &sliver}) {
    for (const double voxel : {0.002, 0.0008}) {
      const double bricks = bakedBricks(*mesh, withVoxel(voxel));
      EXPECT_NEAR(estimated(*mesh, withVoxel(voxel)).coarse / bricks, 1.0, 0.1)
          << bricks << " bricks, voxel " << voxel;
    }
  }
}

TEST(FieldSize, CountsEverySurfaceOnceHoweverOftenItIsThere) {
  const TriangleMesh once = test::ballMesh(0.05, 4);
  TriangleMesh often = once;
  for (int i = 0; i < 6; ++i) often = test::together(often, test::ballMesh(0.05 + 1e-7 * i, 4));
  const double one = estimated(once, withVoxel(0.001)).coarse;
  EXPECT_NEAR(estimated(often, withVoxel(0.001)).coarse / one, 1.0, 0.02);
}

TEST(FieldSize, CountsRefinedBricksInTheirBoxesAlone) {
  const TriangleMesh mesh = test::boxMesh(Vector3(-0.04, -0.03, -0.02), Vector3(0.04, 0.03, 0.021));
  BakeOptions options = withVoxel(0.002);
  options.refinement = 4;
  options.refine = {{{Vector3(0.01, -0.04, -0.03), Vector3(0.05, 0.04, 0.03)}}};
  const FieldSize size = estimated(mesh, options);
  EXPECT_GT(size.refined, 2.0 * size.coarse);
  EXPECT_NEAR((size.coarse + size.refined) / bakedBricks(mesh, options), 1.0, 0.15);
}

TEST(FieldSize, GrowsWithTheSquareOfTheInverseVoxel) {
  const TriangleMesh ball = test::ballMesh(0.05, 6);
  // bricks of a sphere: area / edge^2 times the mean of |nx| + |ny| + |nz| + 1, which is 2.5
  for (const double voxel : {0.0005, 0.0001, 0.00002, 0.000002}) {
    const double edge = 8.0 * voxel;
    const double bricks = 2.5 * 4.0 * M_PI * 0.05 * 0.05 / (edge * edge);
    EXPECT_NEAR(estimated(ball, withVoxel(voxel)).coarse / bricks, 1.0, 0.1) << voxel;
  }
}

/// The error of a bake, and the stages that it went through.
std::pair<std::string, std::set<std::string, std::less<>>> refusal(const TriangleMesh& mesh,
                                                                   const BakeOptions& options) {
  std::set<std::string, std::less<>> stages;
  const auto structures = bake(mesh, options, [&stages](double, std::string_view stage) {
    stages.emplace(stage);
    return true;
  });
  return {structures ? std::string() : structures.error().what, std::move(stages)};
}

TEST(FieldSize, VoxelsOfTwentyMicrometresAreRefusedAtOnceWithTheSizeOfTheirField) {
  // two layers of bricks on 0.0204 m^2: 2 x 0.0204 m^2 / (0.16 mm)^2 = 1.59 million of 1,458 bytes
  const TriangleMesh plate = test::boxMesh(Vector3::Zero(), Vector3(0.1, 0.1, 0.001));
  const auto [what, stages] = refusal(plate, withVoxel(2e-5));
  EXPECT_THAT(
      what,
      ::testing::ContainsRegex(
          "voxels of 0.02 mm make a field of about 1\\.[56][0-9]? million bricks "
          "\\(2\\.[2-4][0-9]? GB\\) of this mesh, at most 1 million fit; choose voxels of 0.02[67] mm"));
  EXPECT_EQ(stages, (std::set<std::string, std::less<>>{"welding"})) << "nothing was measured for it";
}

TEST(FieldSize, AMeshTooLargeForItsVoxelsIsRefusedWithoutOverflow) {
  for (const double radius : {1.0, 1000.0, 90'000.0}) {
    for (const double voxel : {2e-4, 2e-5, 1e-9}) {
      const auto [what, stages] = refusal(test::ballMesh(radius, 3), withVoxel(voxel));
      ASSERT_THAT(what, HasSubstr("make a field of about"));
      ASSERT_THAT(what, HasSubstr("choose voxels of"));
      EXPECT_THAT(what, Not(HasSubstr("about -")));
      EXPECT_THAT(what, Not(HasSubstr("nan")));
      EXPECT_THAT(what, Not(HasSubstr("inf")));
      EXPECT_EQ(stages.count("measuring distances"), 0U);
    }
  }
}

TEST(FieldSizeTruth, TheSuggestedVoxelFits) {
  const TriangleMesh ball = test::ballMesh(0.05, 4);
  FieldLimits limits;
  limits.level_bricks = 2000;
  const std::string what = whyTooLarge(WeldedMesh(ball).triangles, withVoxel(0.0005), limits);
  const std::size_t at = what.find("choose voxels of ");
  ASSERT_NE(at, std::string::npos) << what;
  const double suggested = 1e-3 * std::stod(what.substr(at + 17));
  EXPECT_GT(suggested, 0.0005);
  const double bricks = bakedBricks(ball, withVoxel(suggested));
  EXPECT_LE(bricks, 2000.0);
  EXPECT_GE(bricks, 1000.0) << "not much larger than it has to be";
}

/// Bakes with limits around the size of the field.
Result<BakedField> bakeWithin(const FieldLimits& limits, const BakeOptions& options) {
  const BakeProgress progress;
  ParallelWork work(progress);
  return bakeField(WeldedMesh(test::ballMesh(0.05, 4)), options, work, limits);
}

// An estimate refuses what is certainly too large; what is nearly so is counted.
TEST(FieldSizeTruth, ABakeJustTooLargeForItsReaderIsRefusedWithTheNumber) {
  BakeOptions options = withVoxel(0.002);
  options.refine = {{{Vector3::Zero(), Vector3::Constant(0.06)}}};
  const auto whole = bakeWithin({}, options);
  ASSERT_TRUE(whole) << whole.error().what;
  const std::size_t bricks = whole->storage.samples.size() / structures::DistanceField::kBrickSamples;
  FieldLimits limits;
  limits.field_bricks = bricks;
  EXPECT_TRUE(bakeWithin(limits, options));
  for (const std::size_t limit : {bricks - 1, bricks / 4}) {
    limits.field_bricks = limit;
    const auto refused = bakeWithin(limits, options);
    ASSERT_FALSE(refused);
    EXPECT_THAT(refused.error().what, HasSubstr("make a field of about"));
    EXPECT_THAT(refused.error().what, HasSubstr("smaller boxes to refine"));
  }
  limits = {};
  limits.level_bricks = bricks / 8;
  EXPECT_FALSE(bakeWithin(limits, options));
}

}  // namespace
}  // namespace tenon::bake
