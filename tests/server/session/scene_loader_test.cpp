#include "server/session/scene_loader.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/compression.h"
#include "idl/wire/assets.h"
#include "server/bake/shapes.h"
#include "server/simulation/compiled_scene.h"
#include "tests/server/session/small_session.h"
#include "tests/support/source_folder.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Fingerprint, OfTheSameSceneHasNoChanges) {
  const LoadedScene loaded = test::smallSession();
  EXPECT_THAT(changesSince(fingerprintOf(loaded), loaded), IsEmpty());
  EXPECT_THAT(changesSince({}, loaded), IsEmpty()) << "unknown hashes compare as unchanged";
}

TEST(Fingerprint, ChangesAreNamed) {
  const LoadedScene loaded = test::smallSession();
  const LoadedScene edited = test::smallSession(test::twoHandedScenario() + "\n# a remark\n");
  EXPECT_THAT(changesSince(fingerprintOf(loaded), edited), ElementsAre("the text of small/scenario.yaml"));

  Fingerprint then = fingerprintOf(loaded);
  then.structures["part"] = "another";
  then.structures["lid"] = "was there";
  then.structures.erase("pointer");
  EXPECT_THAT(changesSince(then, loaded),
              ElementsAre("'lid' was removed", "the structures of 'part'", "'pointer' was added"));
}

std::string readText(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class SceneLoaderTest : public ::testing::Test {
 protected:
  SceneLoaderTest() { fs::create_directories(folder_ / "scene"); }
  ~SceneLoaderTest() override { fs::remove_all(folder_); }

  Result<LoadedScene> load(const std::string& text) {
    const fs::path file = folder_ / "scene" / "scenario.yaml";
    std::ofstream(file) << text;
    return loadScene(file, {.cache = folder_ / "cache"},
                     [this](std::string_view activity, double) { activity_ = std::string(activity); });
  }

  fs::path folder_ = fs::temp_directory_path() / ("tenon_loader_" + std::to_string(getpid()));
  std::string activity_;
};

TEST_F(SceneLoaderTest, AMissingScenarioIsAnErrorThatNamesIt) {
  const auto none = loadScene(folder_ / "nowhere", {.cache = folder_ / "cache"});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().what, HasSubstr("nowhere"));
}

TEST_F(SceneLoaderTest, AMissingMeshIsAnErrorWithFileAndLine) {
  const auto none =
      load(test::with(test::twoHandedScenario(), "{part: spare}", "{file: gone.stl, unit: mm}"));
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().what, HasSubstr("scenario.yaml:"));
}

/// A pointer of one shape, which is also the scene: the smallest scenario whose structures are baked.
std::string shapeScenario(const std::string& mesh) {
  return "objects:\n  - {name: pointer, kind: pointer, meshes: [" + mesh +
         "], structures: {voxel: 2 mm, refinement: 1, points: 100}}\n"
         "hands: [{name: right, object: pointer}]\n"
         "states: [{name: wait, conditions: [{command: fulfilled}]}]\n";
}

TEST_F(SceneLoaderTest, ShapesAreBakedAndTheirSizesArePartOfTheKey) {
  std::set<std::string> keys;
  const char* const meshes[] = {"{box: [20 mm, 20 mm, 20 mm]}",
                                "{box: [20 mm, 20 mm, 21 mm]}",
                                "{box: [20 mm, 20 mm, 20 mm], at: [5 mm, 0, 0]}",
                                "{sphere: {diameter: 20 mm}}",
                                "{sphere: {diameter: 20 mm, deviation: 1 mm}}",
                                "{cylinder: {diameter: 20 mm, length: 20 mm}}",
                                "{cylinder: {diameter: 20 mm, length: 20 mm}, turn: {axis: x, deg: 90}}"};
  for (const char* mesh : meshes) {
    const auto loaded = load(shapeScenario(mesh));
    ASSERT_TRUE(loaded) << mesh << ": " << loaded.error().what;
    const structures::StructureInfo& info = loaded->scene->objects[0].structures->info;
    keys.insert(info.content_hash);
    EXPECT_NEAR(info.box_M.sizes().minCoeff(), 0.02, 1e-6) << mesh;
    const auto again = load(shapeScenario(mesh));
    ASSERT_TRUE(again);
    EXPECT_EQ(again->scene->objects[0].structures->info.content_hash, info.content_hash) << mesh;
  }
  EXPECT_EQ(keys.size(), std::size(meshes)) << "two shapes have the same structures";
}

TEST_F(SceneLoaderTest, ShapesAndFilesOfAnyUnitMakeOneObject) {
  // a block of 1 x 1 x 1 inch as a file, and a rod upon it
  ASSERT_TRUE(
      bake::writeStl(folder_ / "scene" / "block.stl", bake::makeBox(Vector3::Constant(0.0254)), 0.0254));
  const auto loaded =
      load(shapeScenario("{cylinder: {diameter: 10 mm, length: 20 mm}, at: [0, 0, 20 mm]}, "
                         "{file: block.stl, unit: in}"));
  ASSERT_TRUE(loaded) << loaded.error().what;
  const Eigen::AlignedBox3d& box_M = loaded->scene->objects[0].structures->info.box_M;
  EXPECT_TRUE(box_M.min().isApprox(Vector3::Constant(-0.0127), 1e-5));
  EXPECT_TRUE(box_M.max().isApprox(Vector3(0.0127, 0.0127, 0.03), 1e-5));
}

TEST_F(SceneLoaderTest, FilesOfDifferentUnitsAreAnErrorWithTheLineOfTheMesh) {
  ASSERT_TRUE(
      bake::writeStl(folder_ / "scene" / "block.stl", bake::makeBox(Vector3::Constant(0.0254)), 0.0254));
  const auto none = load(shapeScenario("{file: block.stl, unit: in},\n    {file: block.stl, unit: mm}"));
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().what, HasSubstr("scenario.yaml:3: the meshes of 'pointer' have different units"));
}

TEST_F(SceneLoaderTest, AShippedScenarioWorksUnderAnyName) {
  const fs::path copy = folder_ / "exercise 7";
  fs::copy(test::sourceFolder() / "scenarios" / "peg_and_box", copy);
  // coarse structures are enough here
  std::string text = readText(copy / "scenario.yaml");
  for (const char* fine : {"voxel: 1 mm, refinement: 8", "voxel: 1 mm, refinement: 1"})
    text = test::with(text, fine, "voxel: 4 mm, refinement: 1");
  text = test::with(text, "clearance: 0.5 mm", "sensing: true");
  std::ofstream(copy / "scenario.yaml") << text;
  const auto loaded = loadScene(copy, {.cache = folder_ / "cache", .detail = 0.12});
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_TRUE(fs::exists(folder_ / "cache" / "parts" / "peg_and_box-0.12" / "peg.stl"));
  EXPECT_EQ(loaded->scenario->name, "exercise 7");
}

TEST_F(SceneLoaderTest, AnUnknownPartIsAnErrorWithItsLine) {
  const auto none = load(shapeScenario("{part: gadget}"));
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().what, HasSubstr("scenario.yaml:2: there is no generated part 'gadget'"));
}

TEST_F(SceneLoaderTest, DisplayModelsAreAssetsThatTheListOfTheSceneNames) {
  const auto loaded = load(shapeScenario("{box: [20 mm, 20 mm, 20 mm]}"));
  ASSERT_TRUE(loaded) << loaded.error().what;
  const LoadOptions options{.cache = folder_ / "cache"};
  const auto name = storeAssets(*loaded, options);
  ASSERT_TRUE(name) << name.error().what;
  const wire::AssetStore store(folder_ / "cache" / "assets");
  const auto list = store.get(*name).value();
  const std::string text(list.begin(), list.end());
  EXPECT_THAT(text, testing::StartsWith(R"({"version":1,"compiled":")"));
  EXPECT_THAT(text, HasSubstr(R"(","objects":[[{"model":")"));
  EXPECT_THAT(text, HasSubstr(R"("triangles":12,)"));
  const std::string model = text.substr(text.find("model") + 8, 30);
  EXPECT_TRUE(store.has(model)) << text;

  const std::string compiled = text.substr(text.find("compiled") + 11, 30);
  const auto packed = store.get(compiled);
  ASSERT_TRUE(packed) << packed.error().what;
  const auto scene = simulation::readScene(record::decompress(*packed, 1U << 30U).value());
  ASSERT_TRUE(scene) << scene.error().what;
  EXPECT_EQ((*scene)->objects.size(), loaded->scene->objects.size());

  // made again where it is missing, and the same
  fs::remove(folder_ / "cache" / "assets" / model);
  EXPECT_EQ(storeAssets(*loaded, options).value(), *name);
  EXPECT_TRUE(store.has(model));
}

}  // namespace
}  // namespace tenon::session
