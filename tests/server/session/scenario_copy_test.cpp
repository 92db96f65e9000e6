#include "server/session/scenario_copy.h"

#include <cstdlib>
#include <fstream>
#include <map>
#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/record/compression.h"
#include "server/game_control/scenario.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class ScenarioCopy : public ::testing::Test {
 protected:
  ScenarioCopy() {
    std::string name = (fs::temp_directory_path() / "tenon-copy-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    scenario_.path = put("mine/scenario.yaml", "objects: []\n");
    scenario_.objects.resize(1);
    scenario_.objects[0].meshes.resize(2);
    scenario_.objects[0].meshes[0].file = put("mine/small.stl", "solid small");
    scenario_.objects[0].meshes[1].file = put("parts/large.stl", std::string(5000, 'x'));
  }
  ~ScenarioCopy() override { fs::remove_all(folder_); }

  fs::path put(const std::string& name, const std::string& text) const {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file) << text;
    return file;
  }
  static std::string textOf(const fs::path& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }

  /// A journal with these files, which are said to be `list`.
  void forge(const std::map<std::string, std::string>& files,
             const std::map<std::string, std::string>& list) const {
    auto writer = record::McapWriter::open(journalFile());
    ASSERT_TRUE(writer);
    for (const auto& [name, text] : files) {
      const auto bytes = record::compress({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
      ASSERT_TRUE(writer->addAttachment("scenario/" + name, record::kCompressedType, *bytes));
    }
    ASSERT_TRUE(writer->addMetadata("tenon scenario files", list));
    ASSERT_TRUE(writer->close());
  }
  [[nodiscard]] Result<fs::path> unpacked() const {
    const auto reader = record::McapReader::open(journalFile());
    if (!reader) return fail(reader.error().what);
    return unpackScenario(*reader, folder_ / "out" / "here");
  }
  void copy(std::uintmax_t most) const {
    auto writer = record::McapWriter::open(journalFile());
    ASSERT_TRUE(writer);
    ASSERT_TRUE(addScenarioFiles(*writer, scenario_, most));
    ASSERT_TRUE(writer->close());
  }
  [[nodiscard]] fs::path journalFile() const { return folder_ / "journal.mcap"; }

  fs::path folder_;
  game_control::ScenarioFile scenario_;
};

TEST_F(ScenarioCopy, IsUnpackedAsItWas) {
  copy(kMostScenarioBytes);
  const auto scenario = unpacked();
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_EQ(textOf(*scenario), "objects: []\n");
  EXPECT_EQ(textOf(scenario->parent_path() / "small.stl"), "solid small");
  EXPECT_EQ(textOf(scenario->parent_path().parent_path() / "parts" / "large.stl").size(), 5000U);
}

TEST_F(ScenarioCopy, NamesWhatWasTooLargeWithItsSizeAndHash) {
  copy(4999);
  const auto scenario = unpacked();
  ASSERT_FALSE(scenario);
  EXPECT_THAT(scenario.error().what, HasSubstr("parts/large.stl (5000 bytes, hash "));
}

TEST_F(ScenarioCopy, WritesNothingOutsideOfItsFolder) {
  for (const std::string name : {"../beside", "a/../../beside", "/tmp/tenon-absolute-name"}) {
    forge({{name, "x"}}, {{"scenario", name}});
    const auto scenario = unpacked();
    ASSERT_FALSE(scenario) << name;
    EXPECT_THAT(scenario.error().what, HasSubstr("outside of its scenario"));
  }
  EXPECT_FALSE(fs::exists(folder_ / "out" / "beside"));
  EXPECT_FALSE(fs::exists("/tmp/tenon-absolute-name"));
}

TEST_F(ScenarioCopy, AFileThatIsNotWhatWasWrittenOrIsNotThereIsDamage) {
  forge({{"a/s.yaml", "other"}}, {{"scenario", "a/s.yaml"}, {"file a/s.yaml", "4 0000000000000000"}});
  EXPECT_THAT(unpacked().error().what, HasSubstr("is damaged: its copy of a/s.yaml"));
  forge({{"a/s.yaml", "other"}}, {{"scenario", "a/s.yaml"}, {"file a/part.stl", "4 0000000000000000"}});
  EXPECT_THAT(unpacked().error().what, HasSubstr("is damaged: its copy of a/part.stl"));
  forge({}, {{"scenario", "a/none.yaml"}});
  EXPECT_FALSE(unpacked());
}

}  // namespace
}  // namespace tenon::session
