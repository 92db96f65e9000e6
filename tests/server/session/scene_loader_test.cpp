#include "server/session/scene_loader.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/server/session/small_session.h"

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

TEST(DefaultCache, IsTakenFromTheEnvironment) {
  const char* const before = std::getenv("TENON_CACHE");
  const std::string kept = before != nullptr ? before : "";
  setenv("TENON_CACHE", "/somewhere/else", 1);
  EXPECT_EQ(defaultCache(), "/somewhere/else");
  unsetenv("TENON_CACHE");
  EXPECT_NE(defaultCache(), "/somewhere/else");
  if (before != nullptr) setenv("TENON_CACHE", kept.c_str(), 1);
}

}  // namespace
}  // namespace tenon::session
