#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

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

/// Files that must load, with the least number of triangles; all others of the folders must be refused.
const std::map<std::string, std::size_t> kLoads{
    {"stl_nan_vertices.stl", 12},       {"stl_inside_out.stl", 12},     {"obj_missing_mtl.obj", 12},
    {"obj_ngon_20000.obj", 19984},      {"obj_bad_utf8_group.obj", 12}, {"gltf_mirror_scale_node.gltf", 12},
    {"glb_bad_utf8_node_name.glb", 12}, {"unicode name 部品 ü.stl", 12}};

void expectLoadedOrRefused(const fs::path& file) {
  const std::string name = file.filename().string();
  const auto mesh = importMesh(file, 1.0);
  const auto expected = kLoads.find(name);
  if (expected != kLoads.end()) {
    ASSERT_TRUE(mesh) << mesh.error().what;
    EXPECT_GE(mesh->triangles.size(), expected->second) << name;
    return;
  }
  ASSERT_FALSE(mesh) << name << " was loaded with " << mesh->triangles.size() << " triangles";
  EXPECT_THAT(mesh.error().what, HasSubstr(name));
  EXPECT_EQ(mesh.error().what.find('\n'), std::string::npos) << mesh.error().what;
}

/// Imports each file of a folder but those named; returns how many.
int importFolder(const fs::path& folder, const std::set<std::string>& but = {}) {
  int seen = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".md" || but.contains(entry.path().filename().string())) continue;
    ++seen;
    expectLoadedOrRefused(entry.path());
  }
  return seen;
}

/// Appends little-endian numbers and texts.
struct Zip {
  std::string bytes;

  void put(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> (8 * i)));
  }
  /// Header fields that a local entry and its entry in the directory share. `method` 0: stored, 8: deflated.
  void putEntry(int method, std::uint64_t packed, std::uint64_t unpacked, const std::string& name) {
    put(20, 2), put(0, 2), put(static_cast<std::uint64_t>(method), 2), put(0, 4), put(0, 4);
    put(packed, 4), put(unpacked, 4), put(name.size(), 2), put(0, 2);
  }
};

/// A 3MF file of 1 MB whose model unpacks to 1 GiB of spaces.
std::string bombOf1GiB() {
  const std::string begin = R"(<?xml version="1.0"?><model unit="millimeter"><!--)";
  // a stored block with the beginning, then a block in which 0 0 repeats the last character 258 times and 1 1
  // ends
  std::string deflated(1, '\0');
  Zip length;
  length.put(begin.size(), 2), length.put(~begin.size(), 2);
  constexpr unsigned char kCodes[] = {0xED, 0xE0, 0x81, 0x00, 0x00, 0x00, 0x00, 0x80,
                                      0x20, 0xA8, 0xEC, 0x4F, 0xB9, 0x48, 0x05};
  deflated += length.bytes + begin + std::string(std::begin(kCodes), std::end(kCodes));
  constexpr std::uint64_t kUnpacked = 1ULL << 30U;
  constexpr std::uint64_t kPerByte = 4 * 258;
  deflated += std::string(kUnpacked / kPerByte, '\0') + '\3';
  const std::vector<std::tuple<std::string, int, std::string, std::uint64_t>> files{
      {"[Content_Types].xml", 0, R"(<?xml version="1.0"?><Types/>)", 0},
      {"_rels/.rels", 0,
       R"(<?xml version="1.0"?><Relationships><Relationship Target="/3D/3dmodel.model" Id="rel0" )"
       R"(Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>)",
       0},
      {"3D/3dmodel.model", 8, deflated, begin.size() + 1 + 2 * 258 + kPerByte * (kUnpacked / kPerByte)}};
  Zip zip;
  Zip directory;
  for (const auto& [name, method, data, unpacked] : files) {
    const std::size_t at = zip.bytes.size();
    const std::uint64_t whole = method == 0 ? data.size() : unpacked;
    zip.put(0x04034B50, 4), zip.putEntry(method, data.size(), whole, name);
    zip.bytes += name + data;
    directory.put(0x02014B50, 4), directory.put(20, 2), directory.putEntry(method, data.size(), whole, name);
    directory.put(0, 2), directory.put(0, 2), directory.put(0, 2), directory.put(0, 4), directory.put(at, 4);
    directory.bytes += name;
  }
  const std::size_t directory_at = zip.bytes.size();
  zip.bytes += directory.bytes;
  zip.put(0x06054B50, 4), zip.put(0, 4), zip.put(files.size(), 2), zip.put(files.size(), 2);
  zip.put(directory.bytes.size(), 4), zip.put(directory_at, 4), zip.put(0, 2);
  return zip.bytes;
}

/// A polygon with 20,000 corners, on which an importer that triangulates in quadratic time hangs.
std::string polygonOf20000() {
  constexpr int kCorners = 20'000;
  std::ostringstream text;
  text << std::fixed << std::setprecision(6);
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kCorners;
    text << "v " << std::cos(angle) << ' ' << std::sin(angle) << " 0\n";
  }
  text << "f";
  for (int i = 1; i <= kCorners; ++i) text << ' ' << i;
  return text.str() + "\n";
}

TEST(MeshImport, LoadsOrRefusesEveryMalformedFileWithOneSentence) {
  // 2^30 instances keep the importer busy up to its limit: nightly
  EXPECT_GE(importFolder(test::dataFolder() / "malformed", {"gltf_instance_bomb_2pow30.gltf"}), 37);
  const fs::path folder = folderForThisTest();
  std::ofstream(folder / "bomb_1GiB.3mf", std::ios::binary) << bombOf1GiB();
  std::ofstream(folder / "obj_ngon_20000.obj") << polygonOf20000();
  EXPECT_EQ(importFolder(folder), 2);
  fs::remove_all(folder);
}

TEST(MeshImportNightly, LoadsOrRefusesEveryMalformedFileWithOneSentence) {
  expectLoadedOrRefused(test::dataFolder() / "malformed" / "gltf_instance_bomb_2pow30.gltf");
  if (const auto shared = test::sharedFolder()) {
    EXPECT_GE(importFolder(*shared / "malformed"), 39);
  }
}

TEST(MeshImport, MeshesOfSeveralFormatsHaveTheirTriangles) {
  const std::map<std::string, std::size_t> triangles{
      {"soup.stl", 100},  {"multibody.stl", 32}, {"wallhole.obj", 66},        {"fels.3ds", 768},
      {"crank.stl", 716}, {"head.stl", 532},     {"connecting-rod.stl", 524}, {"cylinder.stl", 368}};
  for (const auto& [name, count] : triangles) {
    const auto mesh = importMesh(test::dataFolder() / "meshes" / name, 1e-3);
    ASSERT_TRUE(mesh) << mesh.error().what;
    EXPECT_EQ(mesh->triangles.size(), count) << name;
  }
  const auto infinite = importMesh(test::dataFolder() / "meshes" / "BoxWithInfinites.glb", 1.0);
  ASSERT_FALSE(infinite);
  EXPECT_THAT(infinite.error().what, HasSubstr("not finite"));
}

TEST(MeshImportNightly, EveryCadFileOfTheSharedFolderIsLoadedOrRefusedWithOneSentence) {
  int seen = 0;
  for (const auto& folder : {std::optional(test::dataFolder()), test::sharedFolder()}) {
    if (!folder) continue;
    const fs::path root = fs::exists(*folder / "cad") ? *folder / "cad" : *folder / "pairs";
    for (const auto& entry : fs::recursive_directory_iterator(root)) {
      const std::string kind = entry.path().extension().string();
      if (!std::set<std::string>{".obj", ".stl", ".STL", ".ply", ".glb", ".gltf", ".dae", ".3ds", ".3mf"}
               .contains(kind))
        continue;
      ++seen;
      const auto mesh = importMesh(entry.path(), 1e-3);
      if (mesh) {
        EXPECT_GT(mesh->triangles.size(), 0U) << entry.path();
      } else {
        EXPECT_THAT(mesh.error().what, HasSubstr(entry.path().filename().string()));
        EXPECT_EQ(mesh.error().what.find('\n'), std::string::npos) << mesh.error().what;
      }
    }
  }
  EXPECT_GE(seen, 9);
}

// A file without a line in the README has no stated source and licence.
TEST(TestData, EachFileIsInTheReadmeAndAllAreSmall) {
  std::ifstream in(test::dataFolder() / "README.md");
  const std::string readme{std::istreambuf_iterator<char>(in), {}};
  ASSERT_FALSE(readme.empty());
  constexpr std::uintmax_t kMostBytes = 4U << 20U;
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(test::dataFolder())) {
    if (!entry.is_regular_file()) continue;
    bytes += entry.file_size();
    const std::string name = entry.path().filename().string();
    if (name == "README.md") continue;
    EXPECT_THAT(readme, HasSubstr("`" + name + "`"));
  }
  EXPECT_LE(bytes, kMostBytes);
}

TEST(MeshImport, NotesSkippedTriangles) {
  const fs::path file = test::dataFolder() / "malformed" / "stl_nan_vertices.stl";
  const auto mesh = importMesh(file, 1.0);
  ASSERT_TRUE(mesh) << mesh.error().what;
  ASSERT_EQ(mesh->notes.size(), 1U);
  EXPECT_THAT(mesh->notes[0], HasSubstr("skipped"));
}

TEST(MeshImport, AppliesUnitAndMirroredNodes) {
  const fs::path file = test::dataFolder() / "malformed" / "gltf_mirror_scale_node.gltf";
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
  EXPECT_THAT(metres.error().what, HasSubstr("make a field of about"));
  fs::remove_all(folder);
}

std::vector<std::uint32_t> colorsOf(const fs::path& file) {
  const auto mesh = importMesh(file, 1.0);
  EXPECT_TRUE(mesh) << mesh.error().what;
  return mesh ? mesh->colors : std::vector<std::uint32_t>{};
}

//   each format has two triangles, of which one is 0x4080C0 and the other 0xFF0000 or without a colour
TEST(MeshImport, ColoursOfMaterialsAndVerticesAreRead) {
  const fs::path folder = folderForThisTest();
  std::ofstream(folder / "paint.mtl") << "newmtl blue\nKd 0.251 0.502 0.753\nnewmtl red\nKd 1 0 0\n";
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  std::ofstream(folder / "paint.obj") << "mtllib paint.mtl\n"
                                      << corners << "usemtl blue\nf 1 2 3\nusemtl red\nf 1 2 4\n";
  EXPECT_THAT(colorsOf(folder / "paint.obj"), testing::UnorderedElementsAre(0x4080C0U, 0xFF0000U));

  std::ofstream(folder / "paint.ply")
      << "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n"
         "property list uchar int vertex_indices\nend_header\n"
         "0 0 0 64 128 192\n1 0 0 64 128 192\n0 1 0 64 128 192\n0 0 0 255 0 0\n1 0 0 255 0 0\n0 0 1 255 0 0\n"
         "3 0 1 2\n3 3 4 5\n";
  EXPECT_THAT(colorsOf(folder / "paint.ply"), testing::ElementsAre(0x4080C0U, 0xFF0000U));

  // linear 0.0513, 0.2159, 0.5271 is sRGB 0x40, 0x80, 0xC0; the buffer holds three corners as floats
  std::ofstream(folder / "paint.gltf")
      << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
         R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],)"
         R"("materials":[{"name":"blue","pbrMetallicRoughness":{"baseColorFactor":[0.0513,0.2159,0.5271,1]}}],)"
         R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],)"
         R"("bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":)"
         R"("data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";
  EXPECT_THAT(colorsOf(folder / "paint.gltf"), testing::ElementsAre(0x4080C0U));

  std::ofstream(folder / "plain.obj") << corners << "f 1 2 3\nf 1 2 4\n";
  EXPECT_THAT(colorsOf(folder / "plain.obj"), testing::IsEmpty());
  fs::remove_all(folder);
}

//   binary STL: bit 15 of a facet's attribute says that it has a colour
TEST(MeshImport, ColoursOfAnStlStayWithTheirTriangles) {
  const fs::path folder = folderForThisTest();
  const auto write = [&](bool painted) {
    std::string bytes(80, ' ');
    const auto append = [&](const auto& value) {
      bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    constexpr std::uint32_t kFacets = 12;
    append(kFacets);
    for (std::uint32_t i = 0; i < kFacets; ++i) {
      // the second has no place: it is skipped
      const float z = i == 1 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(i);
      for (const float x : {0.0F, 0.0F, 1.0F, 0.0F, 0.0F, z, 1.0F, 0.0F, z, 0.0F, 1.0F, z}) append(x);
      const bool is_painted = painted && i + 1 < kFacets;  // the last one says none
      append(static_cast<std::uint16_t>(is_painted ? 0x8000U | i << 10U : 0U));
    }
    std::ofstream(folder / "facets.stl", std::ios::binary) << bytes;
  };
  write(true);
  const auto mesh = importMesh(folder / "facets.stl", 1.0);
  ASSERT_TRUE(mesh) << mesh.error().what;
  ASSERT_EQ(mesh->triangles.size(), 11U);
  ASSERT_EQ(mesh->colors.size(), 11U);
  for (std::size_t i = 0; i < mesh->triangles.size(); ++i) {
    const auto facet = static_cast<std::uint32_t>(mesh->vertices[mesh->triangles[i][0]].z());
    const std::uint32_t of_5_bits_of_red = ((facet * 255 + 15) / 31) << 16U;
    EXPECT_EQ(mesh->colors[i], facet == 11 ? kNoColor : of_5_bits_of_red) << facet;
  }
  write(false);
  EXPECT_THAT(colorsOf(folder / "facets.stl"), testing::IsEmpty());
  fs::remove_all(folder);
}

/// The import of a triangle by a program of this text.
Result<TriangleMesh> importBy(const std::string& program, const BakeProgress& progress = {}) {
  const fs::path folder = fs::temp_directory_path() / ("tenon-import-" + std::to_string(getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "importer") << "#!/bin/sh\n" << program << "\n";
  fs::permissions(folder / "importer", fs::perms::owner_all);
  std::ofstream(folder / "one.stl") << "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                                       "vertex 0 1 0\nendloop\nendfacet\nendsolid\n";
  EXPECT_EQ(setenv("TENON_BAKE", (folder / "importer").c_str(), 1), 0);
  auto mesh = importMesh(folder / "one.stl", 1e-3, progress);
  unsetenv("TENON_BAKE");
  fs::remove_all(folder);
  return mesh;
}

// a signal to this program alone: the importer would go on for ten minutes
TEST(MeshImport, ThatIsCancelledEndsWithItsImporter) {
  int asked = 0;
  const auto mesh = importBy("exec sleep 600", [&](double, std::string_view) { return ++asked < 3; });
  ASSERT_FALSE(mesh);
  EXPECT_EQ(mesh.error().what, "cancelled");
  EXPECT_EQ(asked, 3);
}

// Ctrl-C in a terminal reaches the importer too
TEST(MeshImport, AnInterruptedImportIsNoDamagedFile) {
  const auto mesh = importBy("kill -INT $$");
  ASSERT_FALSE(mesh);
  EXPECT_THAT(mesh.error().what, ::testing::HasSubstr("its import was interrupted"));
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
