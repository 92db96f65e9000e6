#include <algorithm>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "scenarios/part_generator/scenario_parts.h"
#include "server/bake/bake.h"
#include "tests/scenarios/part_generator/solid_probe.h"
#include "tests/support/exact_distance.h"
#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

using test::boxMesh;
using test::together;

constexpr double kSignVoxel = 0.003;

/// The solids of the engine bay at full detail that lie in a region: `mesh` is the triangle soup as in its
/// file; the separate solids give the ground truth.
class EngineBay {
 public:
  explicit EngineBay(const Eigen::AlignedBox3d& region) {
    part_generator::PartMesh whole;
    for (const part_generator::ScenarioPart& part : part_generator::engineBayParts().parts) {
      if (part.name == "engine_bay") whole = part.make(1.0);
    }
    part_generator::PartMesh kept;
    for (const part_generator::PartMesh::Shell& shell : whole.shells) {
      const auto first = whole.triangles.begin() + static_cast<std::ptrdiff_t>(shell.first);
      const auto end = first + static_cast<std::ptrdiff_t>(shell.count);
      if (!std::all_of(first, end, [&](const auto& t) { return region.contains(test::boxOf(t)); })) continue;
      kept.shells.push_back({kept.triangles.size(), shell.count, shell.closed});
      kept.triangles.insert(kept.triangles.end(), first, end);
    }
    for (const auto& corners : kept.triangles) {
      const auto number = static_cast<std::uint32_t>(mesh.vertices.size());
      for (const Vector3& p : corners) mesh.vertices.push_back(p.cast<float>());
      mesh.triangles.push_back({number, number + 1, number + 2});
    }
    solids_ = std::make_unique<test::SolidProbe>(kept, Pose::Identity(), kept.box());
    surface_ = std::make_unique<test::ExactDistance>(mesh.vertices, mesh.triangles);
  }
  [[nodiscard]] bool inside(const Vector3& p) const { return solids_->inside(p); }
  [[nodiscard]] double distance(const Vector3& p) const { return surface_->nearest(p).distance; }

  TriangleMesh mesh;

 private:
  std::unique_ptr<test::SolidProbe> solids_;
  std::unique_ptr<test::ExactDistance> surface_;
};

TriangleMesh withHoles(TriangleMesh mesh, unsigned one_in) {
  std::mt19937_64 random(11);
  std::erase_if(mesh.triangles, [&](const auto&) { return random() % one_in == 0; });
  return mesh;
}

structures::DistanceField signedField(const TriangleMesh& mesh) {
  BakeOptions options;
  options.voxel = kSignVoxel;
  options.points = 500;
  const auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << structures.error().what;
  return structures ? structures->field : structures::DistanceField{};
}

struct BakedBay {
  explicit BakedBay(const Eigen::AlignedBox3d& region) : bay(region), field(signedField(bay.mesh)) {}
  EngineBay bay;
  structures::DistanceField field;
};

/// Between radiator and engine.
const BakedBay& wholeBay() {
  static const BakedBay the_bay({Vector3(-0.5, 0.33, 0.3), Vector3(0.1, 0.9, 0.75)});
  return the_bay;
}
/// A part of it that is signedField within seconds.
const BakedBay& pieceOfBay() {
  static const BakedBay the_piece({Vector3(-0.3, 0.45, 0.35), Vector3(0.0, 0.75, 0.65)});
  return the_piece;
}

struct SignErrors {
  std::size_t band = 0;   ///< samples in the band
  std::size_t wrong = 0;  ///< of these, with a wrong sign and more than half a voxel from the surface
  [[nodiscard]] double percent() const {
    return 100.0 * static_cast<double>(wrong) / static_cast<double>(band);
  }
};

/// Compares the sign of every `every`-th coarse sample with the ground truth.
SignErrors countSignErrors(const EngineBay& bay, const structures::DistanceField& field, std::size_t every) {
  const structures::DistanceField::Layout& layout = field.layout();
  SignErrors errors;
  std::size_t number = 0;
  std::size_t next = 0;
  const auto children = static_cast<std::size_t>(layout.refinement * layout.refinement * layout.refinement);
  while (number < layout.far.size()) {
    structures::DistanceField::Entry entry = layout.index[number];
    // a narrow gap is refined by itself; its coarse brick follows its children
    if (entry >= structures::DistanceField::kRefined)
      entry = layout.index[static_cast<std::size_t>(entry - structures::DistanceField::kRefined) + children];
    const auto linear_index = static_cast<int>(number++);
    if (entry < 0) continue;
    const Eigen::Array3d brick(linear_index % layout.bricks[0],
                               linear_index / layout.bricks[0] % layout.bricks[1],
                               linear_index / layout.bricks[0] / layout.bricks[1]);
    for (int k = 0; k < structures::DistanceField::kBrickSamples; ++k) {
      if (++next % every != 0) continue;
      const auto sample = static_cast<std::size_t>(entry) * structures::DistanceField::kBrickSamples +
                          static_cast<std::size_t>(k);
      const Vector3 in_brick(k % 9, k / 9 % 9, k / 81);
      const Vector3 p = layout.p_MoFo_M + (brick.matrix() * 8.0 + in_brick) * layout.voxel;
      const double voxels = layout.samples[sample] / double{structures::DistanceField::kQuantaPerVoxel} +
                            field.dilationAt(p) / layout.voxel;
      if (std::abs(voxels) > structures::DistanceField::kBandVoxels) continue;
      ++errors.band;
      if ((voxels < 0.0) == bay.inside(p)) continue;
      if (bay.distance(p) > 0.501 * layout.voxel) ++errors.wrong;
    }
  }
  return errors;
}

void expectRightBeyondHalfAVoxel(const BakedBay& bay, std::size_t every, std::size_t samples) {
  const SignErrors errors = countSignErrors(bay.bay, bay.field, every);
  EXPECT_GT(errors.band, samples);
  EXPECT_LE(errors.percent(), 0.02);
}

void expectTheSameWithHalfOfTheTrianglesFlipped(const BakedBay& bay) {
  const structures::DistanceField flipped = signedField(test::randomlyFlipped(bay.bay.mesh, 5));
  EXPECT_TRUE(std::ranges::equal(bay.field.layout().index, flipped.layout().index));
  EXPECT_TRUE(std::ranges::equal(bay.field.layout().samples, flipped.layout().samples));
  EXPECT_TRUE(std::ranges::equal(bay.field.layout().far, flipped.layout().far));
}

void expectMostlyRightWithHoles(const BakedBay& bay, std::size_t every, std::size_t samples) {
  const SignErrors errors = countSignErrors(bay.bay, signedField(withHoles(bay.bay.mesh, 100)), every);
  EXPECT_GT(errors.band, samples);
  EXPECT_LE(errors.percent(), 2.5);
}

TEST(Sign, OfTheEngineBayIsRightBeyondHalfAVoxel) { expectRightBeyondHalfAVoxel(pieceOfBay(), 7, 10'000); }
TEST(Sign, OfTheEngineBayIsTheSameWithHalfOfItsTrianglesFlipped) {
  expectTheSameWithHalfOfTheTrianglesFlipped(pieceOfBay());
}
TEST(Sign, OfTheEngineBayIsMostlyRightWithOneTriangleInAHundredMissing) {
  expectMostlyRightWithHoles(pieceOfBay(), 7, 10'000);
}

TEST(SignNightly, OfTheEngineBayIsRightBeyondHalfAVoxel) {
  expectRightBeyondHalfAVoxel(wholeBay(), 31, 30'000);
}
TEST(SignNightly, OfTheEngineBayIsTheSameWithHalfOfItsTrianglesFlipped) {
  expectTheSameWithHalfOfTheTrianglesFlipped(wholeBay());
}
TEST(SignNightly, OfTheEngineBayIsMostlyRightWithOneTriangleInAHundredMissing) {
  expectMostlyRightWithHoles(wholeBay(), 31, 30'000);
}

//    #####| |#####      the flood fill does not enter a gap of less than 2.4 voxels
//    #####|x|#####
TEST(Sign, OfANarrowGapIsOutside) {
  for (const double gap : {0.0061, 0.0066, 0.0071}) {
    for (const double left : {0.05, 0.0493, 0.0487, 0.0482}) {
      const structures::DistanceField field = signedField(
          test::together(test::boxMesh(Vector3(-left, -0.05, -0.02), Vector3(-gap / 2, 0.05, 0.02)),
                         test::boxMesh(Vector3(gap / 2, -0.05, -0.02), Vector3(0.05, 0.05, 0.02))));
      EXPECT_GT(field.sample(Vector3(0.0, 0.011, 0.004)).distance, 0.0) << gap << " beside " << left;
      EXPECT_LT(field.sample(Vector3(0.011, 0.011, 0.004)).distance, -0.004) << gap << " beside " << left;
    }
  }
}

//    ___  ____________      a plate of less than 2.4 voxels with holes of missing triangles: by
//    ___  ____________      distances it resembles a gap, but rays find that it is solid
TEST(Sign, OfAPlateWithHolesIsInside) {
  const auto side = [](double z) { return test::sheetMesh(0.06, z, 20); };
  TriangleMesh plate = test::together(side(-0.003), side(0.003));
  const TriangleMesh block = test::boxMesh(Vector3(-0.06, -0.06, -0.003), Vector3(0.06, 0.06, 0.003));
  TriangleMesh rim = block;
  std::erase_if(rim.triangles, [&](const auto& t) {
    const float z = block.vertices[t[0]].z();
    return block.vertices[t[1]].z() == z && block.vertices[t[2]].z() == z;
  });
  plate = test::together(plate, rim);
  const structures::DistanceField whole = signedField(plate);
  EXPECT_LT(whole.sample(Vector3(0.013, 0.001, 0.0)).distance, -0.002);
  plate.triangles.erase(plate.triangles.begin() + 100);
  plate.triangles.erase(plate.triangles.begin() + 900);
  const structures::DistanceField with_holes = signedField(plate);
  EXPECT_LT(with_holes.sample(Vector3(0.013, 0.001, 0.0)).distance, -0.002);
  EXPECT_LT(with_holes.sample(Vector3(-0.031, 0.021, 0.0)).distance, -0.002);
}

}  // namespace
}  // namespace tenon::bake
