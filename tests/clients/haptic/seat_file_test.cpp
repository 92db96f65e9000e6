#include "clients/haptic/seat_file.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

namespace tenon::haptic {
namespace {

namespace fs = std::filesystem;

TEST(SeatFile, KeepsTheKeyReadableByItsOwnerOnly) {
  const fs::path file = fs::temp_directory_path() / ("tenon_seat_" + std::to_string(getpid()));
  EXPECT_FALSE(readSeatKey(file)) << "no file";
  const wire::SeatKey seat = wire::SeatKey::random();
  ASSERT_TRUE(writeSeatKey(file, wire::SeatKey::random()));
  ASSERT_TRUE(writeSeatKey(file, seat));
  ASSERT_TRUE(readSeatKey(file));
  EXPECT_EQ(readSeatKey(file)->seed, seat.seed);
  EXPECT_TRUE(mayBeSeatFile(file));
  EXPECT_EQ(fs::status(file).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  std::ofstream(file) << std::string(5000, 'x');
  EXPECT_FALSE(readSeatKey(file)) << "no key";
  EXPECT_FALSE(mayBeSeatFile(file));
  fs::remove(file);
}

TEST(SeatFile, AnEmptyPathWritesNothingAndAnInvalidOneFails) {
  EXPECT_TRUE(writeSeatKey({}, {}));
  const auto kept = writeSeatKey("/nowhere/at/all", {});
  ASSERT_FALSE(kept);
  EXPECT_NE(kept.error().what.find("/nowhere/at/all"), std::string::npos);
}

}  // namespace
}  // namespace tenon::haptic
