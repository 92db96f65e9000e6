#include "server/session/resume.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "server/session/journal.h"
#include "server/session/seat_list.h"
#include "server/session/session_registry.h"
#include "server/session/session_server.h"
#include "tests/idl/wire/peer.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using test::kRightHand;
using ::testing::HasSubstr;

constexpr Tick kPass = 20;  // [ticks] after which the journal is kept

/// A server without a network: plays ticks, journals them, and is killed between two.
class ResumeTest : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  /// Runs the ticks up to `last` of one life of the server.
  void run(SessionSimulation& simulation, Journal& journal, Tick last, bool is_resumed = false) {
    const Tick first = simulation.now() + 1;
    for (Tick tick = first; tick <= last; ++tick) {
      JournalEntry entry{.input = test::playInput(tick)};
      if (is_resumed && tick == first) {
        entry.input.changes.push_back({.kind = ChangeKind::kContinue});
        for (const HandId hand : {HandId{0}, HandId{1}, HandId{2}})
          entry.input.changes.push_back({.kind = ChangeKind::kAttach, .hand = hand});
      }
      simulation.tick(entry.input);
      entry.hash = hashes_[tick] = simulation.hash();
      if (hasCheckpoint(tick) || tick == first) simulation.save(entry.checkpoint);
      ASSERT_TRUE(journal.write(entry));
      if (tick % kPass != 0) continue;
      ASSERT_TRUE(journal.keep());
    }
  }
  /// The file as the operating system has it when the server is killed now.
  fs::path kill(const fs::path& file) const {
    const fs::path left = folder_ / ("killed " + file.filename().string());
    fs::copy_file(file, left, fs::copy_options::overwrite_existing);
    return left;
  }
  /// The journal of a server that is killed after tick `last`.
  fs::path journalUpTo(Tick last) {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {kRightHand});
    auto journal =
        Journal::open(folder_ / "a.mcap", {"small/scenario.yaml", 0.25, fingerprintOf(loaded_), {}});
    EXPECT_TRUE(journal);
    run(simulation, *journal, last);
    return kill(folder_ / "a.mcap");
  }
  std::string refusal(const fs::path& file, const LoadedScene& loaded) {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded);
    const auto point = readResumePoint(file, loaded, simulation);
    return point ? "" : point.error().what;
  }

  LoadedScene loaded_ = test::smallSession();
  fs::path folder_ = fs::temp_directory_path() / ("tenon-resume-test-" + std::to_string(getpid()));
  std::map<Tick, std::uint64_t> hashes_;
};

TEST_F(ResumeTest, TheStateIsThatAfterTheLastTickThatWasKept) {
  const fs::path left = journalUpTo(1493);
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
  const auto point = readResumePoint(left, loaded_, simulation);
  ASSERT_TRUE(point) << point.error().what;
  EXPECT_EQ(point->tick, 1480U);
  EXPECT_EQ(point->checkpoint, 1001U) << "earlier ticks are not simulated again";
  EXPECT_EQ(point->problem, "");
  EXPECT_EQ(simulation.hash(), hashes_[1480]);
}

// its clock may have been set back since
TEST_F(ResumeTest, AServerThatResumesHasALargerEpochThanAllBeforeIt) {
  constexpr std::uint32_t kFuture = 4'000'000'000;
  const fs::path file = folder_ / "a.mcap";
  fs::path left;
  {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {kRightHand});
    auto journal =
        Journal::open(file, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_), {}, kFuture - 5});
    ASSERT_TRUE(journal) << journal.error().what;
    run(simulation, *journal, 40);
    left = kill(file);
  }
  EXPECT_EQ(lastServerEpoch(left), kFuture - 5);
  {
    auto journal = Journal::reopen(left, 40, kFuture);
    ASSERT_TRUE(journal) << journal.error().what;
    left = kill(left);
  }
  EXPECT_EQ(lastServerEpoch(left), kFuture);
  auto server = SessionServer::open(
      loaded_, {.name = "epoch", .domain = test::ownDomain(), .journal = left, .resume = true});
  ASSERT_TRUE(server) << server.error().what;
  const std::atomic<bool> stop = true;
  const auto report = (*server)->run(stop);
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->run.server_epoch, kFuture + 1);
  EXPECT_EQ(lastServerEpoch(left), kFuture + 1);
  EXPECT_EQ(lastServerEpoch(folder_ / "none.mcap"), 0U);
}

TEST_F(ResumeTest, AJournalOfThreeLivesResimulates) {
  fs::path file = journalUpTo(1493);
  for (const Tick last : {1711U, 2100U}) {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
    ASSERT_TRUE(readResumePoint(file, loaded_, simulation));
    auto journal = Journal::reopen(file, simulation.now(), static_cast<std::uint32_t>(last));
    ASSERT_TRUE(journal) << journal.error().what;
    run(simulation, *journal, last, true);
    if (last != 2100U) {
      file = kill(file);
      continue;
    }
    ASSERT_TRUE(journal->close({.phase = simulation.phase(), .tick = last, .reason = "done"}));
  }
  SessionSimulation again = test::SessionRig::makeSimulation(loaded_);
  const auto report = resimulate(file, again);
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->compared, 2099U);
  EXPECT_TRUE(report->gaps.empty());
  EXPECT_FALSE(report->first_difference);
  EXPECT_EQ(report->final_hash, hashes_[2100]);
  EXPECT_EQ(report->problem, "") << "a continued file is complete";
}

// a recorder may have been away for all of the second life
TEST_F(ResumeTest, ForRecordersThereAreTheLastTicksOfAllLivesWithTheirCheckpoints) {
  fs::path file = journalUpTo(493);
  {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
    ASSERT_TRUE(readResumePoint(file, loaded_, simulation));
    auto journal = Journal::reopen(file, simulation.now(), 2);
    ASSERT_TRUE(journal) << journal.error().what;
    run(simulation, *journal, 1050, true);
    file = kill(file);
  }
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
  const auto point = readResumePoint(file, loaded_, simulation);
  ASSERT_TRUE(point) << point.error().what;
  EXPECT_EQ(point->checkpoint, 1001U);
  ASSERT_EQ(point->entries.size(), 1040U);
  for (Tick tick = 1; tick <= 1040; ++tick) {
    const JournalEntry& entry = point->entries[tick - 1];
    EXPECT_EQ(entry.input.tick, tick);
    EXPECT_EQ(entry.hash, hashes_[tick]);
    EXPECT_EQ(!entry.checkpoint.empty(), tick == 1 || tick == 481 || tick == 1001) << tick;
  }
}

TEST_F(ResumeTest, WhereverTheEndIsTornTheKeptTicksBeforeItAreThere) {
  const fs::path left = journalUpTo(1100);
  const auto whole = fs::file_size(left);
  for (const std::uintmax_t cut : {1U, 9U, 50U, 200U, 700U}) {
    fs::resize_file(left, whole - cut);
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
    ASSERT_TRUE(readResumePoint(left, loaded_, simulation));
    EXPECT_GE(simulation.now(), 1100 - 2 * kPass);
    EXPECT_EQ(simulation.hash(), hashes_[simulation.now()]);
    const fs::path copy = kill(left);
    ASSERT_TRUE(Journal::reopen(copy, simulation.now(), 7));
    const auto report = resimulate(copy, simulation);
    ASSERT_TRUE(report) << report.error().what;
    EXPECT_TRUE(report->gaps.empty());
  }
}

TEST_F(ResumeTest, AfterDamageTheSessionGoesOnFromTheLastStateThatCanBeComputed) {
  const fs::path left = journalUpTo(1900);
  // a byte in a chunk of about tick 1500
  std::fstream file(left, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(fs::file_size(left) * 3 / 4));
  file.put('\x5a');
  file.close();
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
  const auto point = readResumePoint(left, loaded_, simulation);
  ASSERT_TRUE(point) << point.error().what;
  EXPECT_LT(point->tick, 1900U);
  EXPECT_EQ(simulation.hash(), hashes_[point->tick]);
  EXPECT_THAT(point->problem, HasSubstr("has no tick " + std::to_string(point->tick + 1)));
}

TEST_F(ResumeTest, ADamagedEndIsSaidAndATornOneIsNone) {
  const fs::path left = journalUpTo(1100);
  const auto whole = fs::file_size(left);
  const auto problemOf = [&](const fs::path& file) {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
    const auto point = readResumePoint(file, loaded_, simulation);
    EXPECT_TRUE(point);
    EXPECT_EQ(simulation.hash(), hashes_[simulation.now()]);
    return point ? point->problem : "";
  };
  // in the last chunk, before its indices
  std::fstream file(left, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(static_cast<std::streamoff>(whole - 700));
  const char byte = static_cast<char>(file.get() ^ 1);
  file.seekp(static_cast<std::streamoff>(whole - 700));
  file.put(byte);
  file.close();
  EXPECT_THAT(problemOf(left), HasSubstr("; the session continues after the last chunk that can be read"));
  fs::resize_file(left, whole - 701);
  EXPECT_EQ(problemOf(left), "");
}

// as a block of the disk that was never written, in the middle of the file: the lengths of records in it are
// lost, by which all after it would be
TEST_F(ResumeTest, AfterALostBlockTheSessionGoesOnFromTheEndAndTheLossStaysKnown) {
  const fs::path left = journalUpTo(3900);
  const auto whole = fs::file_size(left);
  std::fstream file(left, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(whole / 2));
  for (int byte = 0; byte < 4096; ++byte) file.put('\0');
  file.close();
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
  const auto point = readResumePoint(left, loaded_, simulation);
  ASSERT_TRUE(point) << point.error().what;
  EXPECT_EQ(point->tick, 3900U);
  EXPECT_EQ(simulation.hash(), hashes_[3900]);
  EXPECT_THAT(point->problem, HasSubstr("is damaged between bytes "));
  {
    auto journal = Journal::reopen(left, simulation.now(), 2);
    ASSERT_TRUE(journal) << journal.error().what;
    run(simulation, *journal, 4100, true);
    ASSERT_TRUE(journal->close({.phase = simulation.phase(), .tick = 4100, .reason = "done"}));
  }
  EXPECT_GE(fs::file_size(left), whole) << "nothing is cut off";
  SessionSimulation again = test::SessionRig::makeSimulation(loaded_);
  const auto report = resimulate(left, again);
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_TRUE(report->is_damaged);
  EXPECT_THAT(report->problem, HasSubstr("is damaged between bytes "));
  ASSERT_EQ(report->gaps.size(), 1U);
  EXPECT_LT(report->gaps[0].last, 3900U);
  EXPECT_FALSE(report->first_difference);
  EXPECT_EQ(report->last, 4100U);
}

TEST_F(ResumeTest, WhatCannotBeResumedIsRefusedWithFileAndRemedy) {
  const fs::path left = journalUpTo(1100);
  EXPECT_THAT(
      refusal(left, test::smallSession(test::smallScenario())),
      testing::AllOf(HasSubstr("killed a.mcap"), HasSubstr("another scenario"), HasSubstr("--journal")));
  EXPECT_THAT(refusal(folder_ / "missing.mcap", loaded_), HasSubstr("missing.mcap"));
  fs::resize_file(left, 2000);
  EXPECT_THAT(refusal(left, loaded_), testing::AllOf(HasSubstr("names no scenario"), HasSubstr("--journal")));
  std::ofstream(folder_ / "text.mcap") << "plain text, not a recording\n";
  EXPECT_THAT(refusal(folder_ / "text.mcap", loaded_), HasSubstr("not a recording"));

  const fs::path ended = folder_ / "a.mcap";  // closed by the end of journalUpTo
  EXPECT_THAT(refusal(ended, loaded_), HasSubstr("nothing to resume"));
  EXPECT_THAT(Journal::reopen(ended, 1, 1).error().what, HasSubstr("complete"));
}

TEST_F(ResumeTest, AServerThatWasKilledBeforeItsFirstTickBeginsInTheSameFile) {
  const fs::path left = journalUpTo(0);
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {kRightHand});
  const auto point = readResumePoint(left, loaded_, simulation);
  ASSERT_TRUE(point) << point.error().what;
  EXPECT_EQ(point->tick, 0U);
  auto journal = Journal::reopen(left, 0, 2);
  ASSERT_TRUE(journal) << journal.error().what;
  run(simulation, *journal, 100, true);
  ASSERT_TRUE(journal->close({.phase = simulation.phase(), .tick = 100, .reason = "done"}));
  const auto report = resimulate(left, simulation);
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->compared, 99U);
  EXPECT_EQ(readJournalOrigin(left)->scenario, "small/scenario.yaml") << "it can be resumed again";
  EXPECT_FALSE(report->first_difference);
}

TEST_F(ResumeTest, AStateThatComesOutDifferentlyIsRefused) {
  const fs::path file = folder_ / "a.mcap";
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {kRightHand});
  auto journal = Journal::open(file, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_), {}});
  for (Tick tick = 1; tick <= 100; ++tick) {
    JournalEntry entry{.input = test::playInput(tick)};
    simulation.tick(entry.input);
    entry.hash = simulation.hash() + (tick == 70 ? 1 : 0);
    if (tick == 1) simulation.save(entry.checkpoint);
    ASSERT_TRUE(journal->write(entry));
  }
  ASSERT_TRUE(journal->keep());
  EXPECT_THAT(refusal(kill(file), loaded_), testing::AllOf(HasSubstr("tick 70"), HasSubstr("same build")));
}

TEST_F(ResumeTest, WithTheKeyOfASeatComesItsFormerId) {
  const game_control::ScenarioFile& scenario = *loaded_.scenario;
  SessionRegistry before(scenario, 1, false);
  const auto join = [](SessionRegistry& registry, const std::string& guid, char key, std::uint32_t epoch) {
    return registry.join({.client_guid = guid,
                          .server_epoch = epoch,
                          .name = "Ada\nB",
                          .role = Role::kTrainee,
                          .seat_key = std::string(64, key),
                          .protocol_version = kProtocolVersion},
                         {.seat = true, .key = false}, 0);
  };
  ASSERT_TRUE(join(before, "first", 'a', 1).accepted);
  const ClientId second = join(before, "second", 'b', 1).client;
  const fs::path file = seatFileOf(folder_ / "session.mcap");
  ASSERT_TRUE(writeSeats(file, before.seatsToKeep()));
  const auto seats = readSeats(file);
  ASSERT_TRUE(seats) << seats.error().what;

  SessionRegistry after(scenario, 2, false);
  after.resume(*seats);
  EXPECT_FALSE(after.isRolePresent(Role::kTrainee)) << "nobody is on a seat before they join";
  EXPECT_EQ(join(after, "third", 'c', 2).client, ClientId{3}) << "a new key does not get the seat of another";
  EXPECT_EQ(join(after, "fourth", 'b', 2).client, second);
  FixedVector<Change, kMaxChanges> changes;
  after.takeChanges(changes);
  EXPECT_EQ(changes.begin()->kind, ChangeKind::kContinue) << "before all others";

  std::vector<KeptSeat> closed = *seats;
  closed[1].is_closed = true;
  ASSERT_TRUE(writeSeats(file, closed));
  const auto kept = readSeats(file);
  ASSERT_TRUE(kept) << kept.error().what;
  SessionRegistry later(scenario, 2, false);
  later.resume(*kept);
  EXPECT_FALSE(join(later, "fifth", 'b', 2).accepted) << "a removed person's seat stays closed";

  fs::resize_file(file, fs::file_size(file) - 2);
  EXPECT_THAT(readSeats(file).error().what, HasSubstr("session.mcap.seats:3")) << "cut";
  ASSERT_TRUE(writeSeats(file, closed));
  std::ofstream(file, std::ios::app) << "17 x\n";
  EXPECT_THAT(readSeats(file).error().what, HasSubstr("session.mcap.seats:3"));
  std::ofstream(file, std::ios::trunc).close();
  EXPECT_THAT(readSeats(file).error().what, HasSubstr("session.mcap.seats:1")) << "empty";
}

TEST_F(ResumeTest, TheSeatKeeperWritesTheNewestListAndSaysWhenItCannot) {
  const auto first = [](std::size_t count) {
    std::vector<KeptSeat> seats(count);
    for (std::size_t i = 0; i < count; ++i) seats[i].client = ClientId{static_cast<std::uint32_t>(i + 1)};
    return seats;
  };
  {
    SeatKeeper keeper(folder_ / "seats");
    for (std::size_t count = 1; count <= 50; ++count) keeper.keep(first(count));
  }
  const auto kept = readSeats(folder_ / "seats");
  ASSERT_TRUE(kept) << kept.error().what;
  EXPECT_EQ(kept->size(), 50u);

  // a limit on the size of files is an error of the write, as a full disk is
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{10, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  const auto cut = writeSeats(folder_ / "seats", first(50));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(cut);
  EXPECT_THAT(cut.error().what, HasSubstr("seats: cannot be written (File too large)"));
  EXPECT_EQ(readSeats(folder_ / "seats")->size(), 50U) << "the former file stays";

  SeatKeeper nowhere(folder_ / "missing" / "seats");
  nowhere.keep(first(1));
  std::optional<std::string> error;
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!(error = nowhere.takeError()) && std::chrono::steady_clock::now() < until)
    std::this_thread::yield();
  ASSERT_TRUE(error);
  EXPECT_THAT(*error, HasSubstr("missing/seats: cannot be written"));
  EXPECT_FALSE(nowhere.takeError()) << "once";
}

//   grip o   the part is parked where it was; the hand comes back 25 cm away, and nothing moves
//        | 25 cm   before it is where it held the part
//   hand o
TEST(ReturningHand, HoldsItsObjectAgainWhereItHeldIt) {
  test::SessionRig rig;
  rig.attach(kRightHand, {0.2, 0.01, 0.129});
  rig.tick();
  rig.change({.kind = ChangeKind::kGameCommand});
  const ObjectId part = rig.loaded().scenario->objectNamed("part");
  for (Tick tick = 1; !rig.object("part").holder.valid() && tick < 3000; ++tick) {
    rig.move(kRightHand, test::playInput(std::min<Tick>(tick, 699)).readings[0].X_WH.translation());
    rig.tick();
  }
  ASSERT_EQ(rig.hand(kRightHand).object, part);
  const Vector3 p_WH = rig.hand(kRightHand).X_WH.translation();
  const Pose X_HO = rig.hand(kRightHand).X_HO;
  const Pose X_WO = rig.object("part").X_WO;

  rig.change({.kind = ChangeKind::kContinue});
  rig.change({.kind = ChangeKind::kAttach, .hand = kRightHand});
  rig.move(kRightHand, p_WH + Vector3(0.0, 0.0, 0.25));
  rig.tick(50);
  EXPECT_FALSE(rig.object("part").holder.valid());
  EXPECT_EQ(rig.object("part").X_WO.translation(), X_WO.translation());
  rig.move(kRightHand, p_WH + Vector3(0.0, 0.0, 0.001));
  rig.tick();
  EXPECT_EQ(rig.object("part").holder, kRightHand);
  EXPECT_LT((rig.hand(kRightHand).X_HO.translation() - X_HO.translation()).norm(), 0.0011);
  EXPECT_LT((rig.object("part").X_WO.translation() - X_WO.translation()).norm(), 1e-9);
}

}  // namespace
}  // namespace tenon::session
