#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/bake.h"
#include "tests/support/shared_files.h"

namespace tenon::bake {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

fs::path folderForThisTest() {
  const fs::path folder =
      fs::temp_directory_path() / ("tenon-import-" + std::to_string(::getpid()) +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  fs::create_directories(folder);
  return folder;
}

TEST(MeshImport, LoadsOrRefusesEveryMalformedFileWithOneSentence) {
  const fs::path folder = test::sharedFolder() / "malformed";
  if (!fs::exists(folder)) GTEST_SKIP() << "no folder of malformed meshes (TENON_SHARED)";
  // files that must load, with the least number of triangles; all others must be refused
  const std::map<std::string, std::size_t> loads{
      {"stl_nan_vertices.stl", 12},       {"stl_inside_out.stl", 12},     {"obj_missing_mtl.obj", 12},
      {"obj_ngon_20000.obj", 19984},      {"obj_bad_utf8_group.obj", 12}, {"gltf_mirror_scale_node.gltf", 12},
      {"glb_bad_utf8_node_name.glb", 12}, {"unicode name 部品 ü.stl", 12}};
  int seen = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".md") continue;
    ++seen;
    const auto mesh = importMesh(entry.path(), 1.0);
    const auto expected = loads.find(name);
    if (expected == loads.end()) {
      EXPECT_FALSE(mesh) << name << " was loaded with " << (mesh ? mesh->triangles.size() : 0)
                         << " triangles";
      if (mesh) continue;
      EXPECT_THAT(mesh.error().what, HasSubstr(name));
      EXPECT_EQ(mesh.error().what.find('\n'), std::string::npos) << mesh.error().what;
    } else {
      ASSERT_TRUE(mesh) << mesh.error().what;
      EXPECT_GE(mesh->triangles.size(), expected->second) << name;
    }
  }
  EXPECT_GE(seen, 39);
}

TEST(MeshImport, NotesSkippedTriangles) {
  const fs::path file = test::sharedFolder() / "malformed" / "stl_nan_vertices.stl";
  if (!fs::exists(file)) GTEST_SKIP() << "no folder of malformed meshes (TENON_SHARED)";
  const auto mesh = importMesh(file, 1.0);
  ASSERT_TRUE(mesh) << mesh.error().what;
  ASSERT_EQ(mesh->notes.size(), 1U);
  EXPECT_THAT(mesh->notes[0], HasSubstr("skipped"));
}

TEST(MeshImport, AppliesUnitAndMirroredNodes) {
  const fs::path file = test::sharedFolder() / "malformed" / "gltf_mirror_scale_node.gltf";
  if (!fs::exists(file)) GTEST_SKIP() << "no folder of malformed meshes (TENON_SHARED)";
  const auto mesh = importMesh(file, 1e-3);
  ASSERT_TRUE(mesh) << mesh.error().what;
  Eigen::AlignedBox3f box;
  for (const Vector3f& p : mesh->vertices) box.extend(p);
  EXPECT_NEAR(box.sizes().maxCoeff(), 1e-3F, 1e-9F);
  EXPECT_LT(box.min().minCoeff(), -0.5e-3F);
}

TEST(MeshImport, ReadsAFileWhoseNameIsNotUtf8) {
  const fs::path folder = folderForThisTest();
  const fs::path file = folder / "bad\xff.obj";
  std::ofstream(file) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const auto mesh = importMesh(file, 1.0);
  EXPECT_TRUE(mesh) << mesh.error().what;
  fs::remove_all(folder);
}

TEST(MeshImport, ImplausibleSizesAreRefused) {
  const fs::path folder = folderForThisTest();
  const fs::path file = folder / "corner.obj";
  const auto write = [&file](const char* size) {
    std::ofstream(file) << "v 0 0 0\nv " << size << " 0 0\nv 0 " << size << " 0\nv 0 0 " << size
                        << "\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";
  };
  for (const char* size : {"1e8", "1e30", "1e-42", "1e-9"}) {
    write(size);
    const auto mesh = importMesh(file, 1.0);
    ASSERT_FALSE(mesh) << size;
    EXPECT_THAT(mesh.error().what, HasSubstr("is the unit right?"));
  }
  write("100");
  const auto millimetres = bakeFiles({file}, 1e-3, {});
  ASSERT_TRUE(millimetres) << millimetres.error().what;
  // in metres the same file is a cube of 100 m, too large for voxels of 3 mm
  const auto metres = bakeFiles({file}, 1.0, {});
  ASSERT_FALSE(metres);
  EXPECT_THAT(metres.error().what, HasSubstr("more than 3 GB"));
  fs::remove_all(folder);
}

TEST(MeshImport, AMissingFileIsNamed) {
  EXPECT_THAT(importMesh("/no/such.stl", 1.0).error().what, HasSubstr("/no/such.stl"));
}

TEST(BakeCache, BakesAgainOnlyWhenTheMeshOrAnOptionChanges) {
  const fs::path folder = folderForThisTest();
  const fs::path mesh = folder / "corner.obj";
  const auto write = [&mesh](const char* height) {
    std::ofstream(mesh) << "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 " << height
                        << "\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";
  };
  write("0.1");
  int bakes = 0;
  const auto count = [&bakes](double fraction, std::string_view) {
    if (fraction >= 1.0) ++bakes;
    return true;
  };
  BakeOptions options;
  options.points = 200;
  const auto first = bakeCached({mesh}, 1.0, options, folder / "cache", count);
  ASSERT_TRUE(first) << first.error().what;
  const int once = bakes;
  EXPECT_GT(once, 0);
  const auto second = bakeCached({mesh}, 1.0, options, folder / "cache", count);
  ASSERT_TRUE(second);
  EXPECT_EQ(*first, *second);
  EXPECT_EQ(bakes, once);
  options.points = 300;
  EXPECT_NE(bakeCached({mesh}, 1.0, options, folder / "cache").value_or(*first), *first);
  write("0.2");
  options.points = 200;
  EXPECT_NE(bakeCached({mesh}, 1.0, options, folder / "cache").value_or(*first), *first);
  // a damaged file is replaced
  fs::resize_file(*first, 100);
  write("0.1");
  const auto repaired = bakeCached({mesh}, 1.0, options, folder / "cache");
  ASSERT_TRUE(repaired);
  EXPECT_TRUE(structures::openStructures(*repaired));
  fs::remove_all(folder);
}

TEST(BakeCache, ACancelledBakeLeavesNoFile) {
  const fs::path folder = folderForThisTest();
  const fs::path mesh = folder / "corner.obj";
  std::ofstream(mesh) << "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";
  const auto file =
      bakeCached({mesh}, 1.0, {}, folder / "cache", [](double fraction, auto) { return fraction < 0.5; });
  EXPECT_FALSE(file);
  EXPECT_TRUE(fs::is_empty(folder / "cache"));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace tenon::bake
