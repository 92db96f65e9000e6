#include "server/session/stop_file.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tenon::session {
namespace {

namespace fs = std::filesystem;

class StopFile : public ::testing::Test {
 protected:
  ~StopFile() override { fs::remove_all(folder_); }
  fs::path folder_ = fs::temp_directory_path() / ("tenon-stops-" + std::to_string(getpid()));
  fs::path file_ = folder_ / "below" / "stops";
};

TEST_F(StopFile, HasWhatStandsAndWhatWasCleared) {
  ASSERT_TRUE(readStopFile(file_));
  EXPECT_FALSE(readStopFile(file_)->engaged()) << "no file";
  StopTruth truth;
  truth.raise({"a b\n", 1, "Ada", "hand caught:\ttwo lines\n"});
  truth.raise({"c", 7, "", ""});
  truth.clear({"c", 7, "Ben", "safe"});
  ASSERT_TRUE(writeStopFile(file_, truth));
  const auto back = readStopFile(file_);
  ASSERT_TRUE(back) << back.error().what;
  ASSERT_EQ(back->standing().size(), 1U);
  EXPECT_EQ(back->standing().begin()->first, "a b\n");
  EXPECT_EQ(back->standing().begin()->second.counter, 1U);
  EXPECT_EQ(back->standing().begin()->second.reason, "hand caught:\ttwo lines\n");
  StopTruth again = *back;
  EXPECT_FALSE(again.raise({"c", 7, "", ""})) << "still cleared";
}

TEST_F(StopFile, ThatIsDamagedIsAnErrorAndNotASessionWithoutItsStop) {
  StopTruth truth;
  truth.raise({"a", 1, "Ada", "hand caught"});
  ASSERT_TRUE(writeStopFile(file_, truth));
  const auto size = fs::file_size(file_);
  for (const std::string& wrong : {std::string("raise"), std::string("raise 00"), std::string("lift 00")}) {
    std::ofstream(file_) << wrong << "\n";
    EXPECT_FALSE(readStopFile(file_)) << wrong;
  }
  for (std::uintmax_t left = 0; left < size; ++left) {
    ASSERT_TRUE(writeStopFile(file_, truth));
    fs::resize_file(file_, left);
    const auto cut = readStopFile(file_);
    ASSERT_FALSE(cut) << left << " of " << size << " bytes";
    EXPECT_THAT(cut.error().what, ::testing::HasSubstr("it is not known whether an emergency stop stands"));
  }
  ASSERT_TRUE(writeStopFile(file_, truth));
  std::ifstream in(file_, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string flipped = whole;
    flipped[i] = static_cast<char>(flipped[i] ^ 1);
    std::ofstream(file_, std::ios::binary) << flipped;
    EXPECT_FALSE(readStopFile(file_)) << "byte " << i;
  }
}

TEST_F(StopFile, ThatCannotBeReachedIsAnErrorAndNotASessionWithoutItsStop) {
  fs::create_directories(folder_);
  std::ofstream(folder_ / "below") << "a file where the folder was\n";
  const auto unreachable = readStopFile(file_);
  ASSERT_FALSE(unreachable);
  EXPECT_THAT(unreachable.error().what, ::testing::HasSubstr("cannot be read"));
  EXPECT_THAT(unreachable.error().what,
              ::testing::HasSubstr("it is not known whether an emergency stop stands"));
}

TEST_F(StopFile, ThatIsNoFileIsAnErrorAndNotWaitedFor) {
  fs::create_directories(file_.parent_path());
  fs::create_symlink(folder_ / "nowhere", file_);
  EXPECT_FALSE(readStopFile(file_)) << "a link to nowhere";
  fs::remove(file_);
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  EXPECT_FALSE(readStopFile(file_)) << "a pipe";
}

TEST_F(StopFile, AnEmptyPathKeepsNothing) { EXPECT_TRUE(writeStopFile({}, {})); }

}  // namespace
}  // namespace tenon::session
