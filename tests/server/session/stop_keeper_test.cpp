#include "server/session/stop_keeper.h"

#include <array>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/session/stop_file.h"
#include "tests/idl/wire/peer.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// The bus of a server, and a program that hears it.
class StopKeeperTest : public ::testing::Test {
 protected:
  StopKeeperTest() {
    if (auto opened = writers_.open(lobby_, session_, std::span<wire::Partition>{}, counts_); !opened)
      throw std::runtime_error(opened.error().what);
    fs::create_directories(folder_);
    (void)inbox_.on<EmergencyStop>(heard_, wire::kEmergencyStop,
                                   [this](const EmergencyStop& stop) { truth_.raise(stop); });
    (void)inbox_.on<EmergencyClear>(heard_, wire::kEmergencyClear,
                                    [this](const EmergencyClear& cleared) { truth_.clear(cleared); });
  }
  ~StopKeeperTest() override { fs::remove_all(folder_); }

  static EmergencyStop raiseOf(const std::string& guid, std::uint32_t counter) {
    return {guid, counter, "Ada", "hand caught"};
  }
  static void raise(StopKeeper& keeper, const EmergencyStop& stop) {
    ASSERT_TRUE(keeper.raise(stop));
    keeper.publish(stop);
  }
  /// Turns of the wire thread until `done`.
  [[nodiscard]] bool turnsUntil(StopKeeper& keeper, const std::function<bool()>& done) {
    return test::dispatchUntil(inbox_, [&] {
      keeper.step();
      return done();
    });
  }

  std::shared_ptr<wire::Participant> bus_ = test::participant(test::ownDomain());
  std::shared_ptr<wire::Participant> other_bus_ = test::participant(test::ownDomain());
  wire::Partition lobby_{bus_, wire::kLobby, wire::LinkProfile::kLan};
  wire::Partition session_{bus_, wire::sessionPartition("stop keeper")};
  wire::Partition heard_{other_bus_, wire::sessionPartition("stop keeper")};
  WriteCounts counts_;
  ServerWriters writers_;
  wire::Inbox inbox_;
  StopTruth truth_;  ///< of the program that hears
  fs::path folder_ = fs::temp_directory_path() / ("tenon-stop-keeper-" + std::to_string(getpid()));
  fs::path file_ = folder_ / "stops";
};

TEST_F(StopKeeperTest, IsEngagedFromARaiseToItsClearAndTakesUpWhatItsFileHas) {
  {
    StopKeeper keeper(file_, writers_);
    ASSERT_TRUE(keeper.restore());
    EXPECT_FALSE(keeper.engaged());
    raise(keeper, raiseOf("a", 1));
    EXPECT_FALSE(keeper.raise(raiseOf("a", 1))) << "repeated";
    EXPECT_TRUE(turnsUntil(keeper, [&] { return truth_.engaged() && !keeper.waits(); }));
    EXPECT_TRUE(readStopFile(file_)->engaged());
  }
  StopKeeper keeper(file_, writers_);
  ASSERT_TRUE(keeper.restore());
  EXPECT_TRUE(keeper.engaged()) << "after a restart";
  keeper.clear("Ben", "all is well");
  EXPECT_FALSE(keeper.engaged());
  EXPECT_TRUE(turnsUntil(keeper, [&] { return !truth_.engaged(); }));
  EXPECT_EQ(truth_.cleared().at({"a", 1}).who, "Ben");
  EXPECT_FALSE(readStopFile(file_)->engaged());
  EXPECT_FALSE(keeper.raise(raiseOf("a", 1))) << "was cleared";
  EXPECT_TRUE(keeper.wasCleared(raiseOf("a", 1)));
  EXPECT_TRUE(keeper.raise(raiseOf("a", 2)));
}

/// Until a writer has come and gone.
void readToItsEnd(int pipe) {
  std::array<char, 4096> text;
  for (bool began = false;;) {
    const ssize_t size = read(pipe, text.data(), text.size());
    if (size == 0 && began) return;
    began = began || size > 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

// The disk is slow: a pipe that nobody reads yet stands where the file is written first.
TEST_F(StopKeeperTest, ARaiseIsPublishedAtOnceAndAClearWhenItIsOnTheDisk) {
  ASSERT_EQ(mkfifo((file_.string() + ".next").c_str(), 0600), 0);
  std::optional<std::string> problem;
  StopKeeper keeper(file_, writers_);
  keeper.not_kept = [&](const std::string& why) { problem = why; };
  raise(keeper, raiseOf("a", 1));
  ASSERT_TRUE(turnsUntil(keeper, [&] { return truth_.engaged(); })) << "without the disk";
  keeper.clear("Ben", "all is well");
  EXPECT_FALSE(keeper.engaged());
  EXPECT_TRUE(keeper.waits());
  for (int turn = 0; turn < 10; ++turn) {
    keeper.step();
    inbox_.dispatch(std::chrono::milliseconds(20));
  }
  EXPECT_TRUE(truth_.engaged()) << "the clear is not on the disk yet";

  const int pipe = open((file_.string() + ".next").c_str(), O_RDONLY | O_NONBLOCK);
  readToItsEnd(pipe);
  fs::remove(file_.string() + ".next");
  close(pipe);
  ASSERT_TRUE(turnsUntil(keeper, [&] { return problem.has_value(); }));
  EXPECT_THAT(*problem, HasSubstr("cannot be written")) << "a pipe cannot be synchronised";
  EXPECT_TRUE(turnsUntil(keeper, [&] { return !truth_.engaged() && !keeper.waits(); }));
  const auto kept = readStopFile(file_);
  ASSERT_TRUE(kept) << kept.error().what;
  EXPECT_TRUE(kept->cleared().contains({"a", 1}));
}

TEST_F(StopKeeperTest, OfAClientThatRaisesWithoutEndABoundedNumberStandsHereAndForThoseWhoHear) {
  StopKeeper keeper(file_, writers_);
  constexpr std::uint32_t kRaises = 200;
  for (std::uint32_t counter = kRaises; counter > 0; --counter) raise(keeper, raiseOf("a", counter));
  for (std::uint32_t counter = 1; counter <= kRaises; ++counter)
    if (keeper.raise(raiseOf("a", counter))) keeper.publish(raiseOf("a", counter));
  ASSERT_TRUE(turnsUntil(keeper, [&] {
    return truth_.standing().size() == StopTruth::kMostOfClient && !keeper.waits() &&
           readStopFile(file_)->standing().size() == StopTruth::kMostOfClient;
  }));
  EXPECT_EQ(readStopFile(file_)->cleared().size(), StopTruth::kMostOfClient);
  EXPECT_TRUE(keeper.engaged());
  EXPECT_GT(keeper.newest().number, kRaises - 1);
  keeper.clear("Ben", "all is well");
  EXPECT_TRUE(turnsUntil(keeper, [&] { return !truth_.engaged(); }));
}

// the disk is slow, and meanwhile the clear of a superfluous raise is forgotten, and it is repeated
TEST_F(StopKeeperTest, ARaiseThatStandsAgainIsNotPublishedAsClearedByWhatWaited) {
  ASSERT_EQ(mkfifo((file_.string() + ".next").c_str(), 0600), 0);
  StopKeeper keeper(file_, writers_);
  constexpr std::uint32_t kMost = StopTruth::kMostOfClient;
  for (std::uint32_t counter = 1; counter <= 3 * kMost; ++counter) raise(keeper, raiseOf("a", counter));
  keeper.clear("Ben", "all is well");
  for (std::uint32_t counter = 4 * kMost; counter < 6 * kMost; ++counter)
    raise(keeper, raiseOf("a", counter));
  raise(keeper, raiseOf("b", 1));
  keeper.clear("Ben", "all is well");
  ASSERT_TRUE(keeper.raise(raiseOf("a", 1))) << "forgotten";
  keeper.publish(raiseOf("a", 1));
  const int pipe = open((file_.string() + ".next").c_str(), O_RDONLY | O_NONBLOCK);
  readToItsEnd(pipe);
  fs::remove(file_.string() + ".next");
  close(pipe);
  ASSERT_TRUE(turnsUntil(keeper, [&] { return !keeper.waits() && !truth_.standing().contains({"b", 1}); }));
  EXPECT_TRUE(keeper.engaged());
  EXPECT_TRUE(truth_.standing().contains({"a", 1}));
}

TEST_F(StopKeeperTest, ADamagedFileIsAnError) {
  ASSERT_TRUE(writeStopFile(file_, {}));
  EXPECT_TRUE(StopKeeper(file_, writers_).restore());
  for (const std::uintmax_t size : {3U, 0U}) {
    fs::resize_file(file_, size);
    EXPECT_FALSE(StopKeeper(file_, writers_).restore()) << size << " bytes";
  }
  EXPECT_TRUE(StopKeeper({}, writers_).restore()) << "only in memory";
}

}  // namespace
}  // namespace tenon::session
