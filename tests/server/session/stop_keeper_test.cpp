#include "server/session/stop_keeper.h"

#include <array>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

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

constexpr std::uint32_t kEpoch = 3'000'000;  // of a server

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
    const StopChange change = keeper.raise(stop);
    ASSERT_TRUE(change);
    keeper.publish(stop, change);
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
    StopKeeper keeper(file_, writers_, kEpoch);
    ASSERT_TRUE(keeper.restore());
    EXPECT_FALSE(keeper.engaged());
    raise(keeper, raiseOf("a", 1));
    EXPECT_FALSE(keeper.raise(raiseOf("a", 1))) << "repeated";
    EXPECT_TRUE(turnsUntil(keeper, [&] { return truth_.engaged() && !keeper.waits(); }));
    EXPECT_TRUE(readStopFile(file_)->engaged());
  }
  StopKeeper keeper(file_, writers_, kEpoch);
  ASSERT_TRUE(keeper.restore());
  EXPECT_TRUE(keeper.engaged()) << "after a restart";
  keeper.clear("Ben", "all is well");
  EXPECT_FALSE(keeper.engaged());
  EXPECT_TRUE(turnsUntil(keeper, [&] { return !truth_.engaged(); }));
  EXPECT_EQ(truth_.cleared().at("a").who, "Ben");
  EXPECT_FALSE(readStopFile(file_)->engaged());
  EXPECT_FALSE(keeper.raise(raiseOf("a", 1))) << "was cleared";
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
  StopKeeper keeper(file_, writers_, kEpoch);
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
  EXPECT_TRUE(kept->cleared().contains("a"));
}

TEST_F(StopKeeperTest, OfAClientThatRaisesWithoutEndTheNewestRaiseStandsHereAndForThoseWhoHear) {
  StopKeeper keeper(file_, writers_, kEpoch);
  constexpr std::uint32_t kRaises = 200;
  for (std::uint32_t counter = 1; counter <= kRaises; ++counter) raise(keeper, raiseOf("a", counter));
  ASSERT_TRUE(turnsUntil(keeper, [&] { return truth_.stands(raiseOf("a", kRaises)) && !keeper.waits(); }));
  EXPECT_EQ(readStopFile(file_)->standing().size(), 1U);
  EXPECT_EQ(keeper.newest().standing, 1U);
  EXPECT_GT(keeper.newest().number, kRaises - 1);
  wire::Inbox late;
  std::vector<std::uint32_t> heard;
  ASSERT_TRUE(late.on<EmergencyStop>(heard_, wire::kEmergencyStop,
                                     [&](const EmergencyStop& stop) { heard.push_back(stop.counter); }));
  ASSERT_TRUE(test::dispatchUntil(late, [&] { return !heard.empty(); }));
  EXPECT_EQ(heard, std::vector<std::uint32_t>{kRaises}) << "those before it are not kept for who comes later";
  keeper.clear("Ben", "all is well");
  EXPECT_TRUE(turnsUntil(keeper, [&] { return !truth_.engaged(); }));
}

// The client hangs, so that it withdraws none of its raises, and DDS still delivers them.
TEST_F(StopKeeperTest, WhoJoinsLateHearsThatAllRaisesOfAClientThatRepeatsThemAreCleared) {
  StopKeeper keeper(file_, writers_, kEpoch);
  auto client = wire::Writer<EmergencyStop>::open(heard_, wire::kEmergencyStop);
  ASSERT_TRUE(client);
  constexpr std::uint32_t kRaises = 200;
  for (std::uint32_t counter = 1; counter <= kRaises; ++counter) {
    ASSERT_TRUE(client->write(raiseOf("a", counter)));
    raise(keeper, raiseOf("a", counter));
    if (counter % 70 == 0) keeper.clear("Ben", "all is well");
  }
  keeper.clear("Ben", "all is well");
  ASSERT_TRUE(turnsUntil(keeper, [&] { return !keeper.waits() && !truth_.engaged(); }));

  const auto late_bus = test::participant(test::ownDomain());
  wire::Partition late(late_bus, wire::sessionPartition("stop keeper"));
  wire::Inbox inbox;
  StopTruth truth;
  std::set<std::uint32_t> repeated;
  ASSERT_TRUE(inbox.on<EmergencyClear>(late, wire::kEmergencyClear,
                                       [&](const EmergencyClear& cleared) { truth.clear(cleared); }));
  ASSERT_TRUE(inbox.on<EmergencyStop>(late, wire::kEmergencyStop, [&](const EmergencyStop& stop) {
    repeated.insert(stop.counter);
    truth.raise(stop);
  }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return repeated.size() == kRaises && !truth.engaged(); }));
  for (const std::uint32_t counter : repeated)
    EXPECT_FALSE(keeper.raise(raiseOf("a", counter))) << "a station that obeyed it would repeat it";
}

// the disk is slow, and meanwhile the clear of a superfluous raise is forgotten, and it is repeated
TEST_F(StopKeeperTest, ARaiseThatStandsAgainIsNotPublishedAsClearedByWhatWaited) {
  ASSERT_EQ(mkfifo((file_.string() + ".next").c_str(), 0600), 0);
  StopKeeper keeper(file_, writers_, kEpoch);
  constexpr std::uint32_t kMost = StopTruth::kMostClients;
  const auto client = [](std::uint32_t number) { return raiseOf(std::to_string(100'000 + number), 1); };
  for (std::uint32_t number = 0; number < kMost; ++number) raise(keeper, client(number));
  keeper.clear("Ben", "all is well");
  for (std::uint32_t number = kMost; number < 2 * kMost; ++number) raise(keeper, client(number));
  raise(keeper, raiseOf("b", 1));
  keeper.clear("Ben", "all is well");
  raise(keeper, client(0));  // its clear is forgotten
  const int pipe = open((file_.string() + ".next").c_str(), O_RDONLY | O_NONBLOCK);
  readToItsEnd(pipe);
  fs::remove(file_.string() + ".next");
  close(pipe);
  ASSERT_TRUE(
      turnsUntil(keeper, [&] { return !keeper.waits() && truth_.wasCleared(client(2 * kMost - 1)); }));
  EXPECT_TRUE(keeper.engaged());
  EXPECT_TRUE(truth_.stands(client(0)));
}

// a disk on which nothing can be written; a station that has heard the clear is not told of a raise twice
TEST_F(StopKeeperTest, WhoHasHeardAClearThatWasNotKeptIsToldThatTheStopStandsAgain) {
  {
    StopKeeper keeper(file_, writers_, kEpoch);
    raise(keeper, raiseOf("a", 1));
    ASSERT_TRUE(turnsUntil(keeper, [&] { return truth_.engaged() && !keeper.waits(); }));
    fs::create_directory(file_.string() + ".next");
    std::optional<std::string> problem;
    keeper.not_kept = [&](const std::string& why) { problem = why; };
    keeper.clear("Ben", "all is well");
    ASSERT_TRUE(turnsUntil(keeper, [&] { return !truth_.engaged() && problem.has_value(); }));
  }
  const std::uint32_t raised = truth_.raised();
  StopKeeper keeper(file_, writers_, kEpoch + 1);
  ASSERT_TRUE(keeper.restore());
  ASSERT_TRUE(keeper.engaged());
  EXPECT_TRUE(turnsUntil(keeper, [&] { return truth_.engaged(); }));
  EXPECT_GT(truth_.raised(), raised) << "a press that came before counts no more";
  EXPECT_EQ(keeper.newest().who, "Ada");
  fs::remove(file_.string() + ".next");
  keeper.clear("Ben", "all is well");
  EXPECT_TRUE(turnsUntil(keeper, [&] { return !truth_.engaged() && !keeper.waits(); }));
  EXPECT_FALSE(readStopFile(file_)->engaged());
}

TEST_F(StopKeeperTest, ItsOwnRaiseIsNewWhateverOthersHaveRaisedUnderItsName) {
  StopKeeper keeper({}, writers_, kEpoch);
  EXPECT_EQ(keeper.ownRaise("a test").counter, kEpoch);
  for (const std::uint32_t counter : {kEpoch - 1, kEpoch + 7, 0xFFFFFFFFU}) {
    raise(keeper, raiseOf("server", counter));
    EXPECT_TRUE(StopTruth(keeper.truth()).raise(keeper.ownRaise("a test"))) << counter;
    keeper.clear("Ben", "all is well");
    EXPECT_TRUE(StopTruth(keeper.truth()).raise(keeper.ownRaise("a test"))) << counter;
  }
}

TEST_F(StopKeeperTest, ARaiseHasAnotherNumberInTheNextLifeOfTheServer) {
  std::set<std::uint32_t> numbers;
  {
    StopKeeper keeper(file_, writers_, kEpoch);
    ASSERT_TRUE(keeper.restore());
    EXPECT_EQ(keeper.newest().number, 0U) << "none";
    raise(keeper, raiseOf("a", 1));
    numbers.insert(keeper.newest().number);
    keeper.clear("Ben", "all is well");
    raise(keeper, raiseOf("b", 1));
    numbers.insert(keeper.newest().number);
    ASSERT_TRUE(turnsUntil(keeper, [&] { return !keeper.waits(); }));
  }
  StopKeeper keeper(file_, writers_, kEpoch + 1);
  ASSERT_TRUE(keeper.restore());
  ASSERT_EQ(keeper.truth().standing().size(), 2U) << "that of b, and of the server";
  numbers.insert(keeper.newest().number);
  EXPECT_EQ(numbers.size(), 3U) << "the first one, of a, would clear that of b, unseen";
}

TEST_F(StopKeeperTest, ADamagedFileIsAnError) {
  ASSERT_TRUE(writeStopFile(file_, {}));
  EXPECT_TRUE(StopKeeper(file_, writers_, kEpoch).restore());
  for (const std::uintmax_t size : {3U, 0U}) {
    fs::resize_file(file_, size);
    EXPECT_FALSE(StopKeeper(file_, writers_, kEpoch).restore()) << size << " bytes";
  }
  EXPECT_TRUE(StopKeeper({}, writers_, kEpoch).restore()) << "only in memory";
}

}  // namespace
}  // namespace tenon::session
