#include <cmath>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/bake.h"
#include "server/bake/octree_file.h"
#include "server/bake/sweep.h"
#include "tests/support/analytic_structures.h"
#include "tests/support/file_damage.h"

namespace tenon::bake {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Imports `count` damaged files of each octree format. They have no checksum.
void importDamaged(std::uint64_t count) {
  const fs::path folder = fs::temp_directory_path() / ("tenon-damaged-octree-" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const auto box = test::boxStructures(Vector3(0.12, 0.08, 0.06), 0.003, 0.005);
  const auto cells = sweep(*box, std::vector{Pose(Vector3(0.003, 0.001, 0.002))}, {0.01, 0.0});
  ASSERT_TRUE(cells) << cells.error().what;
  for (const char* name : {"box.bt", "box.ot"}) {
    const fs::path file = folder / name;
    ASSERT_TRUE(writeOctree(file, *cells));
    const std::vector<std::uint8_t> whole = test::bytesOf(file);
    const auto undamaged = importMesh(file, 1.0);
    ASSERT_TRUE(undamaged) << undamaged.error().what;
    std::uint64_t refused = 0;
    for (std::uint64_t seed = 0; seed < count; ++seed) {
      SCOPED_TRACE(std::string(name) + ", damage " + std::to_string(seed));
      std::vector<std::uint8_t> bytes = whole;
      test::FileDamage damage(seed);
      if (seed % 8 == 0) damage.truncate(bytes);
      damage.damage(bytes);
      test::writeBytes(file, bytes);
      const auto mesh = importMesh(file, 1.0);
      if (!mesh) {
        ++refused;
        ASSERT_THAT(mesh.error().what, HasSubstr(name));
        ASSERT_EQ(mesh.error().what.find('\n'), std::string::npos) << mesh.error().what;
        continue;
      }
      for (const Vector3f& p : mesh->vertices) ASSERT_TRUE(p.allFinite());
      for (const auto& triangle : mesh->triangles)
        for (const std::uint32_t corner : triangle) ASSERT_LT(corner, mesh->vertices.size());
    }
    EXPECT_GT(refused, count / 10);
    EXPECT_LT(refused, count) << "damage of a probability or of a cell is not detectable";
  }
  fs::remove_all(folder);
}

TEST(DamagedOctree, IsRefusedOrAValidMesh) { importDamaged(60); }

TEST(DamagedOctreeNightly, IsRefusedOrAValidMesh) { importDamaged(2000); }

}  // namespace
}  // namespace tenon::bake
