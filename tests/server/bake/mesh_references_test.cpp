#include "server/bake/mesh_references.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/bake.h"
#include "server/bake/display_model.h"

namespace tenon::bake {
namespace {

namespace fs = std::filesystem;

/// A glTF of a tetrahedron, whose buffer is the file `uri`, in a folder that each test has for itself.
class MeshReferences : public ::testing::Test {
 protected:
  MeshReferences() { fs::create_directories(folder_ / "parts"); }
  ~MeshReferences() override { fs::remove_all(folder_); }

  static void writeGltf(const fs::path& file, const std::string& uri) {
    std::ofstream(file) << R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
 "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [9, 9, 9]},
               {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}],
 "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
 "buffers": [{"byteLength": 72, "uri" : ")"
                        << uri << "\"}]}\n";
  }
  static void writeBuffer(const fs::path& file, float height) {
    fs::create_directories(file.parent_path());
    const float positions[] = {0, 0, 0, 0.1F, 0, 0, 0, 0.1F, 0, 0, 0, height};
    const std::uint16_t corners[] = {0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 3};
    std::ofstream out(file, std::ios::binary);
    out.write(reinterpret_cast<const char*>(positions), sizeof positions);
    out.write(reinterpret_cast<const char*>(corners), sizeof corners);
  }
  /// [m] The height of the imported tetrahedron; 0 when it is refused.
  static float height(const fs::path& file) {
    const auto mesh = importMesh(file, 1.0);
    if (!mesh) return 0.0F;
    Eigen::AlignedBox3f box;
    for (const Vector3f& p : mesh->vertices) box.extend(p);
    return box.max().z();
  }
  [[nodiscard]] std::string keyOf(const fs::path& mesh) const {
    BakeOptions options;
    options.points = 100;
    options.voxel = 0.01;
    const auto file = bakeCached({mesh}, 1.0, options, folder_ / "cache");
    EXPECT_TRUE(file) << file.error().what;
    return file ? file->filename().string() : std::string();
  }

  fs::path folder_ =
      fs::temp_directory_path() / ("tenon-references-" + std::to_string(::getpid()) +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  fs::path mesh_ = folder_ / "parts" / "part.gltf";
};

TEST_F(MeshReferences, ABufferInASubfolderIsReadAndIsPartOfTheCacheKey) {
  writeGltf(mesh_, "data/deep/part.bin");
  const fs::path buffer = folder_ / "parts" / "data" / "deep" / "part.bin";
  writeBuffer(buffer, 0.1F);
  writeBuffer(folder_ / "parts" / "other.bin", 0.1F);
  EXPECT_FLOAT_EQ(height(mesh_), 0.1F);
  const std::string key = keyOf(mesh_);
  EXPECT_EQ(keyOf(mesh_), key);
  writeBuffer(folder_ / "parts" / "other.bin", 0.3F);
  EXPECT_EQ(keyOf(mesh_), key) << "a file that it does not refer to";
  writeBuffer(buffer, 0.2F);
  EXPECT_NE(keyOf(mesh_), key);
  EXPECT_FLOAT_EQ(height(mesh_), 0.2F);
}

TEST_F(MeshReferences, NamesMayBeEncodedAndEscaped) {
  for (const auto& [uri, name] :
       std::vector<std::pair<std::string, std::string>>{{"a part.bin", "a part.bin"},
                                                        {"a%20part.bin", "a part.bin"},
                                                        {"data\\/part.bin", "data/part.bin"},
                                                        {"./data/../part.bin", "part.bin"},
                                                        {"p\\u00fcnkt.bin", "p\u00fcnkt.bin"}}) {
    writeGltf(mesh_, uri);
    writeBuffer(folder_ / "parts" / name, 0.1F);
    std::vector<fs::path> files;
    for (const MeshReference& reference : referencesOf(mesh_)) {
      if (!reference.file.empty()) files.push_back(fs::canonical(reference.file));
    }
    EXPECT_THAT(files, ::testing::Contains(fs::canonical(folder_ / "parts" / name))) << uri;
  }
}

TEST_F(MeshReferences, AnEncodedNameLoads) {
  writeGltf(mesh_, "a%20part.bin");
  writeBuffer(folder_ / "parts" / "a%20part.bin", 0.1F);
  EXPECT_FLOAT_EQ(height(mesh_), 0.1F);
}

TEST_F(MeshReferences, FilesOutsideOfTheFolderAndDataInTheTextAreNone) {
  writeBuffer(folder_ / "secret.bin", 0.1F);
  for (const std::string& uri :
       {std::string("../secret.bin"), std::string("x/../../secret.bin"), (folder_ / "secret.bin").string(),
        std::string("%2E%2E/secret.bin"), "..%2Fsecret.bin" + std::string()}) {
    writeGltf(mesh_, uri);
    for (const MeshReference& reference : referencesOf(mesh_)) EXPECT_TRUE(reference.file.empty()) << uri;
    EXPECT_EQ(height(mesh_), 0.0F) << uri;
  }
  writeGltf(mesh_, "data:application/octet-stream;base64,AAAA");
  EXPECT_TRUE(referencesOf(mesh_).empty());
  writeGltf(mesh_, "missing.bin");
  ASSERT_EQ(referencesOf(mesh_).size(), 1U);
  EXPECT_TRUE(referencesOf(mesh_)[0].file.empty());
  const auto refused = importMesh(mesh_, 1.0);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().what, ::testing::HasSubstr("part.gltf"));
}

//   parts/part.gltf -> ../store/part.gltf    its buffer is beside the link, or beside the file
TEST_F(MeshReferences, AMeshThatIsASymbolicLinkLoads) {
  const fs::path store = folder_ / "store";
  fs::create_directories(store);
  writeGltf(store / "part.gltf", "data/part.bin");
  fs::create_symlink("../store/part.gltf", mesh_);
  EXPECT_EQ(height(mesh_), 0.0F) << "no buffer anywhere";
  writeBuffer(store / "data" / "part.bin", 0.1F);
  EXPECT_FLOAT_EQ(height(mesh_), 0.1F);
  const std::string key = keyOf(mesh_);
  writeBuffer(folder_ / "parts" / "data" / "part.bin", 0.2F);
  EXPECT_FLOAT_EQ(height(mesh_), 0.2F) << "beside the link comes first";
  EXPECT_NE(keyOf(mesh_), key);

  std::ofstream(store / "corner.obj")
      << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 3\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";
  fs::create_symlink(store / "corner.obj", folder_ / "parts" / "corner.obj");
  EXPECT_FLOAT_EQ(height(folder_ / "parts" / "corner.obj"), 3.0F);
}

TEST_F(MeshReferences, AFolderOrABufferThatIsASymbolicLinkLoads) {
  writeGltf(mesh_, "data/part.bin");
  writeBuffer(folder_ / "elsewhere" / "part.bin", 0.1F);
  fs::create_directory_symlink("../elsewhere", folder_ / "parts" / "data");
  EXPECT_FLOAT_EQ(height(mesh_), 0.1F);
  fs::create_directory_symlink("parts", folder_ / "link");
  EXPECT_FLOAT_EQ(height(folder_ / "link" / "part.gltf"), 0.1F);
  const std::string key = keyOf(folder_ / "link" / "part.gltf");
  writeBuffer(folder_ / "elsewhere" / "part.bin", 0.2F);
  EXPECT_NE(keyOf(folder_ / "link" / "part.gltf"), key);
  fs::remove(folder_ / "parts" / "data");
  fs::create_directories(folder_ / "parts" / "data");
  fs::create_symlink("../../elsewhere/part.bin", folder_ / "parts" / "data" / "part.bin");
  EXPECT_FLOAT_EQ(height(mesh_), 0.2F);
}

TEST_F(MeshReferences, TheMaterialsOfAnObjChangeNoTriangle) {
  const fs::path obj = folder_ / "parts" / "corner.obj";
  std::ofstream(obj)
      << "mtllib corner.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl red\nf 1 2 3\nf 1 2 4\nusemtl blue\n"
         "f 1 3 4\nf 2 3 4\n";
  const auto without = importMesh(obj, 1.0);
  ASSERT_TRUE(without) << without.error().what;
  const std::string key = keyOf(obj);
  std::ofstream(folder_ / "parts" / "corner.mtl") << "newmtl blue\nKd 0 0 1\nnewmtl red\nKd 1 0 0\n";
  const auto with = importMesh(obj, 1.0);
  ASSERT_TRUE(with);
  EXPECT_EQ(with->triangles, without->triangles);
  ASSERT_EQ(with->vertices.size(), without->vertices.size());
  for (std::size_t i = 0; i < with->vertices.size(); ++i) EXPECT_EQ(with->vertices[i], without->vertices[i]);
  EXPECT_EQ(keyOf(obj), key);
}

TEST_F(MeshReferences, TheMaterialsOfAnObjChangeItsDisplayModel) {
  const fs::path obj = folder_ / "parts" / "corner.obj";
  std::ofstream(obj)
      << "v 0 0 0\r\nmtllib the colours.mtl\r\nv 1 0 0\r\nv 0 1 0\r\nusemtl red\r\nf 1 2 3\r\n";
  const auto key = [&] { return displayKey({obj}, 1.0, 0x808080).value(); };
  const std::string without = key();
  EXPECT_TRUE(importMesh(obj, 1.0)->colors.empty()) << "a library that is missing has no colours";
  const auto write = [&](const char* color) {
    std::ofstream(folder_ / "parts" / "the colours.mtl") << "newmtl red\nKd " << color << "\n";
  };
  write("1 0 0");
  const std::string red = key();
  EXPECT_NE(red, without);
  EXPECT_EQ(importMesh(obj, 1.0)->colors, std::vector<std::uint32_t>{0xFF0000});
  write("0 1 0");
  EXPECT_NE(key(), red);
  EXPECT_NE(displayKey({obj}, 1.0, 0).value(), key()) << "the colour of what has none";
  // not from elsewhere
  std::ofstream(obj) << "mtllib ../colours.mtl\nmtllib\n"
                     << "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
  EXPECT_TRUE(referencesOf(obj).empty());
}

}  // namespace
}  // namespace tenon::bake
