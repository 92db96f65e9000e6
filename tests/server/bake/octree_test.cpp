#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/octree_file.h"
#include "server/bake/sweep.h"
#include "tests/support/analytic_structures.h"

namespace tenon::bake {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class Octree : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  const fs::path folder_ =
      fs::temp_directory_path() / ("tenon-octree-" + std::to_string(::getpid()) +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

VoxelSet swept(const structures::HapticStructures& body, const std::vector<Pose>& poses, double cell) {
  auto cells = sweep(body, poses, {cell, 0.0});
  EXPECT_TRUE(cells) << cells.error().what;
  return cells ? *cells : VoxelSet(cell);
}

TEST_F(Octree, ABallAtRestFillsItsVolume) {
  const auto ball = test::sphereStructures(0.05, 0.003, 0.005);
  const double truth = 4.0 / 3.0 * std::numbers::pi * std::pow(0.05, 3);
  EXPECT_NEAR(swept(*ball, {Pose::Identity()}, 0.002).volume(), truth, 0.01 * truth);
  EXPECT_NEAR(swept(*ball, {Pose(Vector3(3.3, -7.1, 0.0123))}, 0.002).volume(), truth, 0.01 * truth);
}

//    .-----------.
//   (  o ----> o  )    two poses: the space between them is swept too
//    '-----------'
TEST_F(Octree, ABallOnAStraightPathSweepsACapsule) {
  const auto ball = test::sphereStructures(0.03, 0.003, 0.005);
  const double truth = std::numbers::pi * 0.03 * 0.03 * (0.25 + 4.0 / 3.0 * 0.03);
  const VoxelSet cells = swept(*ball, {Pose(Vector3(0, 0, 0)), Pose(Vector3(0.15, 0.2, 0.0))}, 0.002);
  EXPECT_NEAR(cells.volume(), truth, 0.01 * truth);
}

TEST_F(Octree, ARotatingBarSweepsADisc) {
  const auto bar = test::boxStructures(Vector3(0.2, 0.02, 0.032), 0.002, 0.005);
  std::vector<Pose> poses;
  for (int k = 0; k <= 2; ++k) {
    poses.emplace_back(Vector3(0, 0, 0), expRotation(Vector3(0.0, 0.0, 0.5 * std::numbers::pi * k)));
  }
  // the radius is half the bar's diagonal; no cell's middle is on the upper or lower face
  const double truth = std::numbers::pi * (0.1 * 0.1 + 0.01 * 0.01) * 0.032;
  EXPECT_NEAR(swept(*bar, poses, 0.002).volume(), truth, 0.02 * truth);
}

TEST_F(Octree, ClearanceIsTheMinimumAlongThePath) {
  const auto ball = test::sphereStructures(0.03, 0.003, 0.002);
  const auto floor = test::floorStructures(0.4, 0.003);
  const auto above = [](double x, double z) { return Pose(Vector3(x, 0.0, z)); };
  const auto found = clearance(*ball, std::vector{above(-0.1, 0.08), above(0.0, 0.035), above(0.1, 0.08)},
                               floor->field, 0.001);
  ASSERT_TRUE(found) << found.error().what;
  EXPECT_TRUE(found->exact);
  EXPECT_NEAR(found->distance, 0.005, 1e-4);
  EXPECT_NEAR(found->p_WP.x(), 0.0, 0.003);

  const auto through =
      clearance(*ball, std::vector{above(0.0, 0.08), above(0.0, 0.025)}, floor->field, 0.001);
  ASSERT_TRUE(through);
  EXPECT_NEAR(through->distance, -0.005, 1e-4);

  const auto far = clearance(*ball, std::vector{above(0.0, 0.2)}, floor->field, 0.001);
  ASSERT_TRUE(far);
  EXPECT_FALSE(far->exact);
  EXPECT_LE(far->distance, 0.17);
  EXPECT_GT(far->distance, 0.008);
}

TEST_F(Octree, AWrittenOctreeIsBakedToTheSameSolid) {
  const auto box = test::boxStructures(Vector3(0.12, 0.08, 0.06), 0.003, 0.005);
  const VoxelSet cells = swept(*box, {Pose(Vector3(0.003, 0.001, 0.002))}, 0.01);
  for (const char* name : {"box.bt", "box.ot"}) {
    const fs::path file = folder_ / name;
    const auto written = writeOctree(file, cells);
    ASSERT_TRUE(written) << written.error().what;
    const auto mesh = importMesh(file, 1e-3);  // an octree is in metres whatever the unit
    ASSERT_TRUE(mesh) << mesh.error().what;
    BakeOptions options;
    options.voxel = 0.002;
    options.points = 1000;
    const auto scan = bake(*mesh, options);
    ASSERT_TRUE(scan) << scan.error().what;
    // cells of several sizes have vertices on each other's edges, and nothing else to say
    EXPECT_THAT(scan->info.notes, MatchesRegex("[0-9]+ vertices and edges of open borders .*place.\n"));
    // cells of 10 mm whose middles are in the box: -57..63 by -39..41 by -28..32 mm gives 12 x 8 x 6 cells
    EXPECT_EQ(cells.count(), 12U * 8 * 6);
    EXPECT_NEAR(scan->info.surface_area, 2 * (0.12 * 0.08 + 0.12 * 0.06 + 0.08 * 0.06), 1e-6);
    const Vector3 middle = scan->info.box_M.center();
    EXPECT_LT(scan->field.sample(middle).distance, 0.0);
    EXPECT_NEAR(scan->field.sample(middle + Vector3(0.065, 0, 0)).distance, 0.005, 1e-5);
  }
}

TEST_F(Octree, InteriorCellsHaveNoSurface) {
  VoxelSet cells =
      swept(*test::boxStructures(Vector3::Constant(0.16), 0.004, 0.02), {Pose::Identity()}, 0.01);
  const fs::path file = folder_ / "cube.bt";
  ASSERT_TRUE(writeOctree(file, cells));
  const auto corners = readOctreeSurface(file);
  ASSERT_TRUE(corners) << corners.error().what;
  double area = 0.0;
  for (std::size_t i = 0; i + 2 < corners->size(); i += 3) {
    const Vector3f& a = (*corners)[i];
    area += static_cast<double>(((*corners)[i + 1] - a).cross((*corners)[i + 2] - a).norm()) / 2;
  }
  EXPECT_NEAR(area, 6 * 0.16 * 0.16, 1e-6);
}

TEST_F(Octree, ATruncatedOrDamagedFileIsAnErrorOfOneLine) {
  const auto ball = test::sphereStructures(0.05, 0.003, 0.005);
  const VoxelSet cells = swept(*ball, {Pose::Identity()}, 0.004);
  for (const char* name : {"ball.bt", "ball.ot"}) {
    const fs::path file = folder_ / name;
    ASSERT_TRUE(writeOctree(file, cells));
    const auto bytes = fs::file_size(file);
    for (const double fraction : {0.99, 0.5, 0.1, 0.01}) {
      ASSERT_TRUE(writeOctree(file, cells));
      fs::resize_file(file, static_cast<std::uintmax_t>(fraction * static_cast<double>(bytes)));
      const auto mesh = importMesh(file, 1.0);
      ASSERT_FALSE(mesh) << name << " cut to " << fraction;
      EXPECT_THAT(mesh.error().what, HasSubstr(name));
      EXPECT_EQ(mesh.error().what.find('\n'), std::string::npos);
    }
    std::ofstream(file) << "# Octomap OcTree binary file\nid OcTree\nsize 4000000000\nres 0\ndata\n";
    EXPECT_FALSE(importMesh(file, 1.0));
    std::ofstream(file) << "not an octree";
    EXPECT_FALSE(importMesh(file, 1.0));
  }
}

TEST_F(Octree, InvalidSweepsAreRefused) {
  const auto ball = test::sphereStructures(0.05, 0.003, 0.005);
  EXPECT_FALSE(sweep(*ball, {}, {}));
  EXPECT_FALSE(sweep(*ball, std::vector{Pose::Identity()}, {0.0, 0.0}));
  EXPECT_FALSE(sweep(*ball, std::vector{Pose::Identity()}, {0.001, 1.0}));
  EXPECT_FALSE(sweep(*ball, std::vector{Pose::Identity(), Pose(Vector3(1e6, 0, 0))}, {0.001, 0.0}));
  EXPECT_FALSE(sweep(*ball, std::vector{Pose::Identity()}, {1e-6, 0.0}));
  const auto stopped = sweep(*ball, std::vector{Pose::Identity()}, {}, [](double, auto) { return false; });
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().what, "cancelled");
  EXPECT_FALSE(writeOctree(folder_ / "ball.obj", swept(*ball, {Pose::Identity()}, 0.01)));
  const VoxelSet far = swept(*ball, {Pose(Vector3(1000, 0, 0))}, 0.01);
  EXPECT_FALSE(writeOctree(folder_ / "far.bt", far));
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace tenon::bake
