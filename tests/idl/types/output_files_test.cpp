#include "idl/types/output_files.h"

#include <cstdlib>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

namespace tenon {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class OutputFiles : public testing::Test {
 protected:
  OutputFiles() { std::ofstream(there_) << "kept"; }
  ~OutputFiles() override { fs::remove_all(folder_); }

  static fs::path makeFolder() {
    std::string name = (fs::temp_directory_path() / "tenon_outputs_XXXXXX").string();
    return ::mkdtemp(name.data());
  }

  fs::path folder_ = makeFolder();
  fs::path there_ = folder_ / "part.stl";
};

TEST_F(OutputFiles, AFileThatExistsIsRefusedWithoutOverwrite) {
  const auto refusal = refuseOutputs({.outputs = {folder_ / "new.stl", there_}});
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->exit_code, 1);
  EXPECT_THAT(refusal->what, HasSubstr("part.stl: exists; --overwrite"));
  EXPECT_FALSE(refuseOutputs({.outputs = {there_}, .overwrite = true}));
  EXPECT_FALSE(refuseOutputs({.outputs = {folder_ / "new.stl", {}}}));
}

TEST_F(OutputFiles, AnInputIsRefusedUnderEveryNameAndWithOverwriteToo) {
  fs::create_symlink(there_, folder_ / "link.stl");
  fs::create_hard_link(there_, folder_ / "same.stl");
  for (const fs::path& output :
       {there_, folder_ / "." / "part.stl", folder_ / "link.stl", folder_ / "same.stl"}) {
    for (const bool overwrite : {false, true}) {
      const auto refusal = refuseOutputs({{output}, {{}, there_}, overwrite});
      ASSERT_TRUE(refusal) << output;
      EXPECT_EQ(refusal->exit_code, 2);
      EXPECT_THAT(refusal->what, HasSubstr(output.string() + ": is an input"));
    }
  }
}

TEST_F(OutputFiles, DevicesAndPipesAreWrittenInPlaceAndNeverRefused) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const fs::path& output : {fs::path("/dev/null"), pipe}) {
    EXPECT_FALSE(refuseOutputs({{output}, {output}, false})) << output;
    EXPECT_TRUE(isWrittenInPlace(output)) << output;
  }
  EXPECT_FALSE(isWrittenInPlace(there_));
  EXPECT_FALSE(isWrittenInPlace(folder_ / "new.stl"));
}

TEST_F(OutputFiles, AFolderIsRefusedAlways) {
  const auto refusal = refuseOutputs({.outputs = {folder_}, .overwrite = true});
  ASSERT_TRUE(refusal);
  EXPECT_THAT(refusal->what, HasSubstr("is a folder"));
}

}  // namespace
}  // namespace tenon
