#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "server/bake/bake.h"
#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

using test::ballMesh;
using test::boxMesh;
using test::together;

constexpr double kSlopeVoxel = 0.003;
constexpr int kSamples = structures::DistanceField::kBrickSamples;

/// Two blocks with a gap of `gap` between them, 40 mm deep.
TriangleMesh blocksApart(double gap) {
  return test::together(test::boxMesh(Vector3(-0.05, -0.05, -0.02), Vector3(-gap / 2, 0.05, 0.02)),
                        test::boxMesh(Vector3(gap / 2, -0.05, -0.02), Vector3(0.05, 0.05, 0.02)));
}

TriangleMesh withoutTriangles(TriangleMesh mesh, unsigned one_in) {
  std::mt19937_64 random(3);
  std::erase_if(mesh.triangles, [&](const auto&) { return random() % one_in == 0; });
  return mesh;
}

structures::DistanceField bakedField(const TriangleMesh& mesh, std::vector<RefineBox> refine = {}) {
  BakeOptions options;
  options.voxel = kSlopeVoxel;
  options.points = 500;
  options.refinement = refine.empty() ? 1 : 4;
  options.refine = std::move(refine);
  const auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << structures.error().what;
  return structures ? structures->field : structures::DistanceField{};
}

Vector3 inBrick(int sample) { return Vector3(sample % 9, sample / 9 % 9, sample / 81); }

/// [quanta] The largest violation of the Lipschitz condition: difference of two samples of a brick minus
/// their distance. Checks neighbours, all samples against the middle (which bounds the brick for queries) and
/// random pairs.
int worstViolation(std::span<const std::int16_t> brick) {
  std::mt19937 random(5);
  int worst = -1'000'000;
  const auto check = [&](int i, int j) {
    const double apart = (inBrick(i) - inBrick(j)).norm() * structures::DistanceField::kQuantaPerVoxel;
    worst = std::max(worst, std::abs(brick[i] - brick[j]) - static_cast<int>(std::ceil(apart)));
  };
  for (int i = 0; i < kSamples; ++i) {
    for (const int step : {1, 8, 9, 10, 72, 73, 80, 81, 82, 90, 91}) {
      if (i + step < kSamples) check(i, i + step);
    }
    check(i, kSamples / 2);
    for (int k = 0; k < 8; ++k) check(i, static_cast<int>(random() % kSamples));
  }
  return worst;
}

int worstViolation(const structures::DistanceField& field) {
  const auto samples = field.layout().samples;
  int worst = -1'000'000;
  for (std::size_t first = 0; first < samples.size(); first += kSamples) {
    worst = std::max(worst, worstViolation(samples.subspan(first, kSamples)));
  }
  return worst;
}

//    #####| |#####      the flood fill does not enter a gap of less than 2.4 voxels: at its mouth
//    #####|?|#####      reached and unreached samples are neighbours
//    #####| |#####
TEST(SlopeLimit, SamplesOfABrickAreLipschitz) {
  for (const double gap : {0.001, 0.002, 0.004, 0.0065, 0.008}) {
    EXPECT_LE(worstViolation(bakedField(blocksApart(gap))), 2) << gap;
  }
  const TriangleMesh ball = test::ballMesh(0.03, 4);
  EXPECT_LE(worstViolation(bakedField(ball)), 2);
  EXPECT_LE(worstViolation(bakedField(withoutTriangles(ball, 100))), 2);
  EXPECT_LE(worstViolation(bakedField(withoutTriangles(ball, 20))), 2);
  EXPECT_LE(worstViolation(bakedField(
                test::together(ball, test::boxMesh(Vector3(0.02, -0.01, -0.01), Vector3(0.06, 0.01, 0.01))))),
            2);
}

TEST(SlopeLimit, CoarseAndFineSamplesOfABrickAreLipschitz) {
  const RefineBox mouth{{Vector3(-0.004, -0.06, 0.0), Vector3(0.004, 0.0, 0.03)}};
  for (const double gap : {0.001, 0.002, 0.004, 0.0065}) {
    const structures::DistanceField field = bakedField(blocksApart(gap), {mouth});
    const structures::DistanceField::Layout& layout = field.layout();
    ASSERT_EQ(layout.refinement, 4);
    EXPECT_LE(worstViolation(field), 2) << gap;
    std::size_t pairs = 0;
    double worst = -1.0;
    for (const structures::DistanceField::Entry entry : layout.index) {
      if (entry < structures::DistanceField::kRefined) continue;
      const structures::DistanceField::Entry* children =
          layout.index.data() + (entry - structures::DistanceField::kRefined);
      const std::int16_t* coarse =
          layout.samples.data() + std::size_t{kSamples} * static_cast<std::size_t>(children[64]);
      for (int child = 0; child < 64; ++child) {
        if (children[child] < 0) continue;
        const std::int16_t* fine =
            layout.samples.data() + std::size_t{kSamples} * static_cast<std::size_t>(children[child]);
        const Vector3 corner = Vector3(child % 4, child / 4 % 4, child / 16) * 2.0;
        for (int k = 0; k < kSamples; k += 5) {
          if (std::abs(fine[k]) >= 4 * structures::DistanceField::kQuantaPerVoxel) continue;
          for (int j = 0; j < kSamples; j += 7) {
            const double apart =
                (corner + inBrick(k) / 4 - inBrick(j)).norm() * structures::DistanceField::kQuantaPerVoxel;
            worst = std::max(worst, coarse[j] - fine[k] / 4.0 - apart);
            ++pairs;
          }
        }
      }
    }
    EXPECT_GT(pairs, 100'000U);
    EXPECT_LE(worst, 3.0) << gap;
  }
}

// reached samples are correct, so raising the others may only reduce their error
TEST(SlopeLimit, RaisesNoSampleAboveTheTrueDistance) {
  for (const double gap : {0.002, 0.004, 0.0065}) {
    const structures::DistanceField field = bakedField(blocksApart(gap));
    const auto truth = [&](const Vector3& p) {
      const auto block = [&](double from, double to) {
        const Vector3 low(from, -0.05, -0.02);
        const Vector3 high(to, 0.05, 0.02);
        const Vector3 beyond = (low - p).cwiseMax(p - high);
        return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
      };
      return std::min(block(-0.05, -gap / 2), block(gap / 2, 0.05));
    };
    const structures::DistanceField::Layout& layout = field.layout();
    std::size_t number = 0;
    std::size_t compared = 0;
    for (const structures::DistanceField::Entry entry : layout.index) {
      const auto linear_index = static_cast<int>(number++);
      if (entry < 0) continue;
      const Eigen::Array3d brick(linear_index % layout.bricks[0],
                                 linear_index / layout.bricks[0] % layout.bricks[1],
                                 linear_index / layout.bricks[0] / layout.bricks[1]);
      for (int k = 0; k < kSamples; ++k) {
        const double value = layout.samples[static_cast<std::size_t>(entry * kSamples + k)] * kSlopeVoxel /
                             structures::DistanceField::kQuantaPerVoxel;
        const Vector3 p = layout.p_MoFo_M + kSlopeVoxel * (8.0 * brick.matrix() + inBrick(k));
        ASSERT_LE(value, std::max(truth(p), -structures::DistanceField::kClampVoxels * kSlopeVoxel) + 2e-6)
            << p.transpose();
        ++compared;
      }
    }
    EXPECT_GT(compared, 10'000U);
  }
}

}  // namespace
}  // namespace tenon::bake
