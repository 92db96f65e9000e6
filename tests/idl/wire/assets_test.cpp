#include "idl/wire/assets.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace tenon::wire {
namespace {

namespace fs = std::filesystem;

class AssetsTest : public testing::Test {
 protected:
  ~AssetsTest() override { fs::remove_all(folder_); }
  const fs::path folder_ = fs::temp_directory_path() / ("tenon_assets_test_" + std::to_string(getpid()));
  const AssetStore store_{folder_};
  const std::vector<std::uint8_t> bytes_{1, 2, 3};
};

TEST(AssetName, IsTheHashOfTheContent) {
  // `printf abc | b2sum -l 256`
  const std::vector<std::uint8_t> abc{'a', 'b', 'c'};
  EXPECT_EQ(assetName(abc), "bddd813c634239723171ef3fee9857");
  EXPECT_TRUE(isAssetName(assetName(abc)));
  for (const char* text : {"", "..", "bddd813c634239723171ef3fee9857x", "BDDD813C634239723171EF3FEE9857",
                           "../../../../../../../etc/passwd"})
    EXPECT_FALSE(isAssetName(text)) << text;
}

TEST_F(AssetsTest, WhatWasPutIsThere) {
  const auto name = store_.put(bytes_);
  ASSERT_TRUE(name) << name.error().what;
  EXPECT_EQ(*name, assetName(bytes_));
  EXPECT_TRUE(store_.has(*name));
  EXPECT_EQ(store_.get(*name).value(), bytes_);
  EXPECT_EQ(store_.put(bytes_).value(), *name);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(AssetsTest, ADamagedOneIsAnErrorAndIsPutAgain) {
  const std::string name = store_.put(bytes_).value();
  std::ofstream(folder_ / name) << "other";
  const auto damaged = store_.get(name);
  ASSERT_FALSE(damaged);
  EXPECT_THAT(damaged.error().what, testing::HasSubstr("is damaged"));
  ASSERT_TRUE(store_.put(bytes_));
  EXPECT_EQ(store_.get(name).value(), bytes_);
}

TEST_F(AssetsTest, NoOtherFileIsEverRead) {
  fs::create_directories(folder_);
  std::ofstream(folder_ / "secret") << "secret";
  for (const char* name : {"secret", "../secret", "", ".", "012345678901234567890123456789"}) {
    EXPECT_FALSE(store_.get(name)) << name;
    EXPECT_FALSE(store_.has(name)) << name;
  }
}

TEST_F(AssetsTest, AFolderThatCannotBeWrittenIsAnError) {
  std::ofstream(folder_) << "a file";
  EXPECT_FALSE(store_.put(bytes_));
}

}  // namespace
}  // namespace tenon::wire
