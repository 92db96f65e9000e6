#include "clients/haptic/seat_file.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

namespace tenon::haptic {
namespace {

namespace fs = std::filesystem;

TEST(SeatFile, KeepsTheTokenReadableByItsOwnerOnly) {
  const fs::path file = fs::temp_directory_path() / ("tenon_seat_" + std::to_string(getpid()));
  EXPECT_EQ(readSeatToken(file), "") << "no file";
  ASSERT_TRUE(writeSeatToken(file, "0123456789abcdef"));
  ASSERT_TRUE(writeSeatToken(file, "fedcba9876543210"));
  EXPECT_EQ(readSeatToken(file), "fedcba9876543210");
  EXPECT_EQ(fs::status(file).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  std::ofstream(file) << std::string(5000, 'x');
  EXPECT_EQ(readSeatToken(file), "") << "longer than a token";
  fs::remove(file);
}

TEST(SeatFile, AnEmptyPathWritesNothingAndAnInvalidOneFails) {
  EXPECT_TRUE(writeSeatToken({}, "0123"));
  const auto kept = writeSeatToken("/nowhere/at/all", "0123");
  ASSERT_FALSE(kept);
  EXPECT_NE(kept.error().what.find("/nowhere/at/all"), std::string::npos);
}

}  // namespace
}  // namespace tenon::haptic
