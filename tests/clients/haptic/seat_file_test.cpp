#include "clients/haptic/seat_file.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

namespace tenon {
namespace {

namespace fs = std::filesystem;

TEST(SeatFile, GivesBackTheTokenAndToNobodyElse) {
  const fs::path file = fs::temp_directory_path() / ("tenon_seat_" + std::to_string(getpid()));
  EXPECT_EQ(readToken(file), "") << "the first time there is none";
  ASSERT_TRUE(keepToken(file, "0123456789abcdef"));
  ASSERT_TRUE(keepToken(file, "fedcba9876543210"));
  EXPECT_EQ(readToken(file), "fedcba9876543210");
  EXPECT_EQ(fs::status(file).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  std::ofstream(file) << std::string(5000, 'x');
  EXPECT_EQ(readToken(file), "") << "no token is so long";
  fs::remove(file);
}

TEST(SeatFile, WithoutAFileNothingIsKeptAndAnImpossibleOneIsASentence) {
  EXPECT_TRUE(keepToken({}, "0123"));
  const auto kept = keepToken("/nowhere/at/all", "0123");
  ASSERT_FALSE(kept);
  EXPECT_NE(kept.error().what.find("/nowhere/at/all"), std::string::npos);
}

}  // namespace
}  // namespace tenon
