#include "idl/wire/asset_fetch.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/idl/wire/range_server.h"

namespace tenon::wire {
namespace {

namespace fs = std::filesystem;
using test::RangeServer;
using testing::HasSubstr;

std::vector<std::uint8_t> content() {
  std::vector<std::uint8_t> bytes(std::size_t{40} << 20U);  // more than two ranges
  std::uint32_t number = 1;
  for (std::uint8_t& byte : bytes)
    byte = static_cast<std::uint8_t>((number = number * 1664525U + 1013904223U) >> 24U);
  return bytes;
}

class AssetFetchTest : public testing::Test {
 protected:
  ~AssetFetchTest() override { fs::remove_all(folder_); }
  const fs::path folder_ = fs::temp_directory_path() / ("tenon_fetch_test_" + std::to_string(getpid()));
  const AssetStore store_{folder_};
  const std::vector<std::uint8_t> bytes_ = content();
  const std::string name_ = assetName(bytes_);
  const std::atomic<bool> stop_ = false;
};

TEST_F(AssetFetchTest, FetchesOnceSaysHowFarAndKeepsIt) {
  RangeServer server({bytes_});
  std::uint64_t last = 0;
  const auto fetched = fetchAsset(
      store_, name_, server.url(),
      [&](std::uint64_t there, std::uint64_t of) {
        EXPECT_EQ(of, bytes_.size());
        EXPECT_GE(there, last);
        last = there;
      },
      stop_);
  ASSERT_TRUE(fetched) << fetched.error().what;
  EXPECT_EQ(*fetched, bytes_);
  EXPECT_EQ(last, bytes_.size());
  EXPECT_EQ(server.requests, 3);
  EXPECT_EQ(fetchAsset(store_, name_, server.url(), {}, stop_).value(), bytes_);
  EXPECT_EQ(server.requests, 3);
  EXPECT_EQ(fetchAsset(store_, name_, "", {}, stop_).value(), bytes_);
}

TEST_F(AssetFetchTest, GoesOnWhereItWasInterrupted) {
  RangeServer server({bytes_});
  server.most_bytes = 10U << 20U;
  const std::atomic<bool> stop = false;
  // the connection ends again and again, and so does the program
  std::atomic<bool> stopped = false;
  const auto first = fetchAsset(
      store_, name_, server.url(),
      [&](std::uint64_t there, std::uint64_t) { stopped = there >= (std::size_t{15} << 20U); }, stopped);
  EXPECT_FALSE(first);
  ASSERT_TRUE(fs::exists(folder_ / (name_ + ".part")));
  const auto second = fetchAsset(store_, name_, server.url(), {}, stop);
  ASSERT_TRUE(second) << second.error().what;
  EXPECT_EQ(*second, bytes_);
  EXPECT_LT(server.sent, bytes_.size() + (std::size_t{12} << 20U));
  EXPECT_FALSE(fs::exists(folder_ / (name_ + ".part")));
}

TEST_F(AssetFetchTest, OfProgramsThatShareAFolderOneFetches) {
  RangeServer server({bytes_});
  std::vector<std::vector<std::uint8_t>> got(4);
  std::vector<std::thread> programs;
  for (auto& mine : got)
    programs.emplace_back([&] {
      const auto fetched = fetchAsset(store_, name_, server.url(), {}, stop_);
      if (fetched) mine = *fetched;
    });
  for (std::thread& program : programs) program.join();
  for (const auto& mine : got) EXPECT_EQ(mine, bytes_);
  EXPECT_EQ(server.requests, 3);
}

TEST_F(AssetFetchTest, WhatHasAnotherHashIsRefusedAndNotKept) {
  RangeServer server({bytes_});
  server.damages = true;
  const auto fetched = fetchAsset(store_, name_, server.url(), {}, stop_);
  ASSERT_FALSE(fetched);
  EXPECT_THAT(fetched.error().what, HasSubstr("another hash"));
  EXPECT_FALSE(store_.has(name_));
  server.damages = false;
  EXPECT_TRUE(fetchAsset(store_, name_, server.url(), {}, stop_));
}

TEST_F(AssetFetchTest, WhatIsNotThereIsASentence) {
  EXPECT_THAT(fetchAsset(store_, name_, "", {}, stop_).error().what, HasSubstr(name_));
  EXPECT_THAT(fetchAsset(store_, name_, "ftp://there", {}, stop_).error().what,
              HasSubstr("expected http://"));
  std::string nobody;
  {
    const RangeServer gone({bytes_});
    nobody = gone.url();
  }
  EXPECT_THAT(fetchAsset(store_, name_, nobody, {}, stop_).error().what, HasSubstr("does not answer"));
  EXPECT_FALSE(fetchAsset(store_, "../../etc/passwd", "http://127.0.0.1:1", {}, stop_));
}

}  // namespace
}  // namespace tenon::wire
