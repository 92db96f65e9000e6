#include "server/session/journal_writer.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <future>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include "idl/threads/scheduling.h"
#include "server/session/contributions.h"
#include "tests/server/session/hanging_disk.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using test::kRightHand;

class JournalWriterTest : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  Journal openJournal() {
    auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_), {}});
    EXPECT_TRUE(journal);
    return std::move(*journal);
  }
  /// Plays `ticks`, no faster than the file is written.
  void play(JournalWriter& writer, Tick ticks) {
    writer.reserve(simulation_.maxSavedBytes());
    for (Tick i = 0; i < ticks; ++i) {
      const TickInput input = test::playInput(simulation_.now() + 1);
      simulation_.tick(input);
      writer.add(input, simulation_.hash(), simulation_);
      if (i % 100 == 99) std::this_thread::sleep_for(std::chrono::milliseconds(30));
    }
  }

  LoadedScene loaded_ = test::smallSession();
  SessionSimulation simulation_ = test::SessionRig::makeSimulation(loaded_, 1, {kRightHand});
  fs::path folder_ = fs::temp_directory_path() / ("tenon-journal-writer-test-" + std::to_string(getpid()));
  fs::path file_ = folder_ / "session.mcap";
};

TEST_F(JournalWriterTest, AReaderThatHangsLeavesNoGapInTheFile) {
  std::promise<void> continues;
  const std::shared_future<void> until = continues.get_future();
  std::atomic<std::uint64_t> copies = 0;
  JournalWriter writer(openJournal(), [&](const JournalEntry&) {
    until.wait();
    ++copies;
  });
  writer.start();
  play(writer, 5200);
  // the file is complete up to the last pass while the reader still hangs
  for (int i = 0; i < 600 && writer.lostCopies() < 1000; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  continues.set_value();
  writer.end(
      {.phase = simulation_.phase(), .tick = 5200, .reason = "done", .final_hash = simulation_.hash()});
  writer.stop();
  EXPECT_EQ(writer.lostEntries(), 0U);
  EXPECT_GT(writer.lostCopies(), 0U) << "the queue of copies is bounded";
  EXPECT_EQ(writer.lostCopies() + copies, 5200U);
  ASSERT_FALSE(writer.problem()) << *writer.problem();
  SessionSimulation again = test::SessionRig::makeSimulation(loaded_);
  const auto report = resimulate(file_, again);
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->compared, 5199U);
  EXPECT_TRUE(report->gaps.empty());
  EXPECT_FALSE(report->has_no_end);
}

/// [-] of the thread of this process with this name; -1: there is none.
int policyOf(const std::string& name) {
  for (const auto& task : fs::directory_iterator("/proc/self/task")) {
    std::string found;
    std::getline(std::ifstream(task.path() / "comm"), found);
    if (found == name) return sched_getscheduler(std::stoi(task.path().filename())) & ~SCHED_RESET_ON_FORK;
  }
  return -1;
}

// at high load ticks go on, and their entries would wait until the queue is full
TEST_F(JournalWriterTest, TheFilesThreadHasRealTimePriorityWhereItIsPermitted) {
  std::string refused;
  std::thread([&] { refused = threads::raiseThisThread(1); }).join();
  if (!refused.empty()) GTEST_SKIP() << refused;
  JournalWriter writer(openJournal(), [](const JournalEntry&) {});
  writer.start();
  for (int tries = 0; tries < 500 && policyOf("journal") != SCHED_FIFO; ++tries)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(policyOf("journal"), SCHED_FIFO);
  writer.stop();
}

TEST_F(JournalWriterTest, ACopyIsGivenAwayOnlyOnceItsEntryOutlivesTheProcess) {
  Tick newest = 0;
  bool is_behind = false;
  JournalWriter writer(openJournal(), [&](const JournalEntry& entry) {
    newest = entry.input.tick;
    // what another process reads now
    SessionSimulation again = test::SessionRig::makeSimulation(loaded_);
    const auto report = resimulate(file_, again);
    is_behind = is_behind || (newest > 1 && (!report || report->last < newest));
  });
  writer.reserve(simulation_.maxSavedBytes());
  for (Tick tick = 1; tick <= 5; ++tick) {
    simulation_.tick(test::playInput(tick));
    writer.add(test::playInput(tick), simulation_.hash(), simulation_);
    ASSERT_TRUE(writer.isWrittenWithin(std::chrono::minutes(1)));
  }
  EXPECT_EQ(newest, 5U);
  EXPECT_FALSE(is_behind);
}

TEST_F(JournalWriterTest, AFullDiskEndsTheFileAndNotTheCopies) {
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  std::uint64_t copies = 0;
  JournalWriter writer(openJournal(), [&](const JournalEntry&) { ++copies; });
  const rlimit small{20'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  writer.start();
  play(writer, 1000);
  writer.end({.phase = simulation_.phase(), .tick = 1000, .reason = "done"});
  EXPECT_TRUE(writer.isEndedWithin(std::chrono::minutes(1)));
  writer.stop();
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_TRUE(writer.problem());
  EXPECT_THAT(*writer.problem(), testing::HasSubstr("session.mcap: cannot write"));
  EXPECT_EQ(copies, 1000U);
}

TEST_F(JournalWriterTest, InLockstepATickThatTheDiskDoesNotTakeIsAskedForAgainAndCopiedOnce) {
  std::vector<Tick> copies;
  JournalWriter writer(openJournal(), [&](const JournalEntry& entry) { copies.push_back(entry.input.tick); });
  play(writer, 2);
  ASSERT_TRUE(writer.isWrittenWithin(std::chrono::minutes(1)));
  test::HangingDisk disk(file_);
  play(writer, 1);
  for (int times = 0; times < 2; ++times)
    EXPECT_FALSE(writer.isWrittenWithin(std::chrono::milliseconds(100)));
  EXPECT_THAT(copies, testing::ElementsAre(1, 2));
  disk.release();
  EXPECT_TRUE(writer.isWrittenWithin(std::chrono::minutes(1)));
  EXPECT_TRUE(writer.isWrittenWithin(std::chrono::milliseconds(0))) << "nothing was added";
  EXPECT_THAT(copies, testing::ElementsAre(1, 2, 3));
  writer.stop();
}

// All ticks are written, and the disk hangs with the end of the file alone.
TEST_F(JournalWriterTest, AnEndThatTheDiskDoesNotTakeIsWaitedForAsTicksAre) {
  for (const bool has_thread : {true, false}) {
    JournalWriter writer(openJournal(), {});
    if (has_thread) writer.start();
    play(writer, 5);
    if (!has_thread) {
      ASSERT_TRUE(writer.isWrittenWithin(std::chrono::minutes(1)));
    }
    while (writer.waitingEntries() > 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // up to the end of its pass
    test::HangingDisk disk(file_);
    writer.end({.phase = simulation_.phase(), .tick = simulation_.now(), .reason = "done"});
    EXPECT_FALSE(writer.isEndedWithin(std::chrono::milliseconds(300)));
    EXPECT_EQ(writer.waitingEntries(), 0U);
    disk.release();
    EXPECT_TRUE(writer.isEndedWithin(std::chrono::minutes(1)));
  }
}

TEST(Contributions, OfEachClientAFewWaitAndTheNewestOfEachSource) {
  Contributions contributions;
  InputBuffer buffer(1);
  const auto force = [](std::uint32_t source, double newton) {
    return Change{.kind = ChangeKind::kContributeForce,
                  .object = ObjectId{0},
                  .index = source,
                  .F_Oo_W = {{newton, 0.0, 0.0}, Vector3::Zero()}};
  };
  EXPECT_TRUE(contributions.put(ClientId{1}, force(1, 1.0)));
  EXPECT_TRUE(contributions.put(ClientId{1}, force(1, 2.0)));
  for (std::uint32_t source = 2; source < 1000; ++source)
    EXPECT_EQ(contributions.put(ClientId{1}, force(source, 0.0)), source <= Contributions::kMostOfClient);
  EXPECT_TRUE(contributions.put(ClientId{2}, force(1, 5.0))) << "another client has places of its own";
  contributions.forward(buffer);
  TickInput input;
  buffer.collect(1, input);
  ASSERT_EQ(input.changes.size(), Contributions::kMostOfClient + 1);
  EXPECT_EQ(input.changes.begin()[0].F_Oo_W.force.x(), 2.0);
  EXPECT_EQ(input.changes.begin()[1].F_Oo_W.force.x(), 5.0) << "clients take turns";
}

TEST(Contributions, OfAClientThatLeavesNothingWaitsAndItsForcesEnd) {
  Contributions contributions;
  InputBuffer buffer(1);
  const auto force = [](std::uint32_t source, double newton) {
    return Change{.kind = ChangeKind::kContributeForce,
                  .object = ObjectId{0},
                  .index = source,
                  .lifetime_ticks = 100,
                  .F_Oo_W = {{newton, 0.0, 0.0}, Vector3::Zero()}};
  };
  const auto next = [&] {
    contributions.forward(buffer);
    TickInput input;
    buffer.collect(1, input);
    return std::vector<Change>(input.changes.begin(), input.changes.end());
  };
  contributions.put(ClientId{1}, force(1, 1.0));
  contributions.put(ClientId{1}, force(2, 2.0));
  ASSERT_EQ(next().size(), 2U);
  contributions.put(ClientId{2}, force(2, 3.0));
  ASSERT_EQ(next().size(), 1U);
  contributions.put(ClientId{1}, force(3, 4.0));
  contributions.end(ClientId{1});
  const auto ends = next();
  ASSERT_EQ(ends.size(), 1U) << "what waited is dropped, and source 2 is client 2's by now";
  EXPECT_EQ(ends[0].index, 1U);
  EXPECT_EQ(ends[0].F_Oo_W.force, Vector3::Zero());
  EXPECT_EQ(ends[0].lifetime_ticks, 1U) << "0 would not overwrite the force";
  contributions.end(ClientId{1});
  contributions.end(ClientId{7});
  EXPECT_TRUE(next().empty());
  for (std::uint32_t source = 0; source < 1000; ++source) {
    contributions.put(ClientId{3}, force(source, 1.0));
    (void)next();
  }
  contributions.end(ClientId{3});
  EXPECT_LE(next().size(), Contributions::kMostEnded);
}

TEST(Contributions, LeaveHalfOfTheQueueToCommands) {
  Contributions contributions;
  InputBuffer buffer(1);
  for (std::uint32_t client = 1; client < 1000; ++client)
    contributions.put(ClientId{client}, {.kind = ChangeKind::kPlaceObject, .object = ObjectId{0}});
  contributions.forward(buffer);
  EXPECT_GE(buffer.freeChanges(), InputBuffer::kChanges / 2 - 1);
}

}  // namespace
}  // namespace tenon::session
