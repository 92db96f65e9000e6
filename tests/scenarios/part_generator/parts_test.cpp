#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include "scenarios/part_generator/mesh_builder.h"
#include "scenarios/part_generator/scenario_parts.h"

namespace tenon::part_generator {
namespace {

std::filesystem::path temporaryFile(const std::string& name) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "tenon_scenarios";
  std::filesystem::create_directories(folder);
  return folder / name;
}

std::string bytesOf(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

PartMesh makePart(const PartSet& set, std::string_view name, double detail) {
  for (const ScenarioPart& part : set.parts) {
    if (part.name == name) return part.make(detail);
  }
  ADD_FAILURE() << "no part " << name;
  return {};
}

/// Six times the signed volume of a shell: positive when its faces are counter-clockwise seen from outside.
double sixfoldVolumeOf(const PartMesh& mesh, const PartMesh::Shell& shell) {
  double sum = 0.0;
  for (std::size_t i = shell.first; i < shell.first + shell.count; ++i) {
    const auto& t = mesh.triangles[i];
    sum += t[0].dot(t[1].cross(t[2]));
  }
  return sum;
}

TEST(Parts, EveryMeshIsFiniteAndItsClosedShellsFaceOutwards) {
  for (const PartSet& set : partSets()) {
    for (const ScenarioPart& part : set.parts) {
      const PartMesh mesh = part.make(0.0);
      ASSERT_FALSE(mesh.triangles.empty()) << part.name;
      ASSERT_EQ(mesh.triangles.size(), mesh.paint.size()) << part.name;
      for (const auto& t : mesh.triangles) {
        for (const Vector3& corner : t) ASSERT_TRUE(corner.allFinite()) << part.name;
      }
      for (std::size_t i = 0; i < mesh.shells.size(); ++i) {
        if (!mesh.shells[i].closed) continue;
        EXPECT_GT(sixfoldVolumeOf(mesh, mesh.shells[i]), 0.0) << part.name << " shell " << i;
      }
    }
  }
}

TEST(Parts, TheSameMeshGivesTheSameBytes) {
  for (const PartSet& set : partSets()) {
    for (const ScenarioPart& part : set.parts) {
      ASSERT_TRUE(writeStl(temporaryFile("a.stl"), part.make(0.05)));
      ASSERT_TRUE(writeStl(temporaryFile("b.stl"), part.make(0.05)));
      EXPECT_EQ(bytesOf(temporaryFile("a.stl")), bytesOf(temporaryFile("b.stl"))) << part.name;
    }
  }
}

TEST(Parts, AnStlFileHasItsTriangleCountAndIsInMillimetres) {
  ASSERT_TRUE(writeStl(temporaryFile("cube.stl"), makePart(pegAndBoxParts(), "cube", 0.0)));
  const std::string bytes = bytesOf(temporaryFile("cube.stl"));
  ASSERT_EQ(bytes.size(), 84U + 12U * 50U);
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  EXPECT_EQ(count, 12U);
  float x = 0.0F;
  std::memcpy(&x, bytes.data() + 84 + 12, sizeof x);
  EXPECT_EQ(std::abs(x), 25.0F);
}

TEST(Parts, TheErrorNamesAFileThatCannotBeWritten) {
  const auto written = writeStl("/no/such/folder/cube.stl", makePart(pegAndBoxParts(), "cube", 0.0));
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().what.find("/no/such/folder/cube.stl"), std::string::npos);
}

//   ____      ____   z = 0      A peg of 39.5 mm fits into a hole of 40.0 mm, 60 mm deep.
//  |    | 40 |    |
//  |    |____|    |  z = -60
//  |______________|  z = -80
TEST(Stacking, ABlockHasTheColourOfItsObject) {
  for (const Color color : makePart(stackingParts(), "block", 0.0).paint) EXPECT_EQ(color, kUnpainted);
}

TEST(PegAndBox, HasAClearanceOfHalfAMillimetre) {
  const PartMesh box = makePart(pegAndBoxParts(), "box_with_hole", 0.0);
  const PartMesh peg = makePart(pegAndBoxParts(), "peg", 0.0);
  EXPECT_TRUE(box.box().sizes().isApprox(Vector3(0.200, 0.200, 0.080), 1e-12));
  EXPECT_TRUE(peg.box().sizes().isApprox(Vector3(0.0395, 0.0395, 0.100), 1e-12));
  EXPECT_DOUBLE_EQ(box.box().max().z(), 0.0);
  EXPECT_DOUBLE_EQ(peg.box().min().z(), 0.0);
  for (const double x : {-0.01999, 0.01999}) {
    for (const double z : {-0.0001, -0.030, -0.0599}) {
      EXPECT_FALSE(insideAnyShell(box, {x, 0.5 * x, z}));
      EXPECT_FALSE(insideAnyShell(box, {0.5 * x, x, z}));
      EXPECT_TRUE(insideAnyShell(box, {1.001 * x, 0.5 * x, z}));
      EXPECT_TRUE(insideAnyShell(box, {0.5 * x, 1.001 * x, z}));
    }
  }
  EXPECT_TRUE(insideAnyShell(box, {0.003, 0.002, -0.0601}));
}

TEST(EngineBayParts, HaveFewTrianglesAtDetailZeroAndThoseOfThePaperAtFullDetail) {
  const PartSet set = engineBayParts();
  EXPECT_LT(makePart(set, "engine_bay", 0.0).triangles.size(), 250'000U);
  const std::size_t bay = makePart(set, "engine_bay", 1.0).triangles.size();
  EXPECT_GT(bay, 1'650'000U);
  EXPECT_LT(bay, 2'000'000U);
  const std::size_t control_box = makePart(set, "control_box", 1.0).triangles.size();
  EXPECT_GT(control_box, 85'000U);
  EXPECT_LT(control_box, 130'000U);
  for (const char* name : {"covering_board", "grid", "bracket", "wiper_mechanism"}) {
    const std::size_t count = makePart(set, name, 1.0).triangles.size();
    EXPECT_GT(count, 5'000U) << name;
    EXPECT_LT(count, 65'000U) << name;
  }
}

TEST(EngineBayParts, KeepTheirSizeAtAnyDetail) {
  const PartSet set = engineBayParts();
  const Eigen::AlignedBox3d coarse = makePart(set, "engine_bay", 0.0).box();
  const Eigen::AlignedBox3d fine = makePart(set, "engine_bay", 0.6).box();
  EXPECT_EQ(coarse.min(), fine.min());
  EXPECT_EQ(coarse.max(), fine.max());
}

TEST(DetailFor, FindsTheDetailForANumberOfTriangles) {
  const PartSet set = pegAndBoxParts();
  const double detail = detailFor(set, 1000);
  std::size_t count = 0;
  for (const ScenarioPart& part : set.parts) count += part.make(detail).triangles.size();
  EXPECT_NEAR(static_cast<double>(count), 1000.0, 150.0);
}

TEST(Triangulate, CoversAnOutlineWithoutItsHoles) {
  const Polygon outline = roundedRectangle({0.0, 0.0}, {4.0, 2.0}, 0.3, 5);
  const std::vector<Polygon> holes{circle({-1.2, 0.3}, 0.4, 17), circle({0.1, -0.2}, 0.5, 24),
                                   circle({1.2, 0.4}, 0.3, 8)};
  std::vector<Vector2> points(outline);
  double expected = signedArea(outline);
  for (const Polygon& hole : holes) {
    expected -= signedArea(hole);
    points.insert(points.end(), hole.begin(), hole.end());
  }
  double covered = 0.0;
  for (const auto& t : triangulate(outline, holes)) {
    const double piece = signedArea({points[t[0]], points[t[1]], points[t[2]]});
    EXPECT_GT(piece, 0.0);
    covered += piece;
  }
  EXPECT_NEAR(covered, expected, 1e-12);
}

}  // namespace
}  // namespace tenon::part_generator
