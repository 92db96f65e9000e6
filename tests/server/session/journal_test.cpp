#include "server/session/journal.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/types/messages/journal.h"
#include "idl/types/messages/session.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"
#include "tests/server/session/journal_fixture.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

TEST_F(JournalTest, ResimulatesToEqualHashes) {
  const std::uint64_t final_hash = write();
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->first, 2U) << "the first checkpoint is of the state after tick 1";
  EXPECT_EQ(report->last, kJournaledTicks);
  EXPECT_EQ(report->compared, kJournaledTicks - 1);
  EXPECT_TRUE(report->gaps.empty());
  EXPECT_EQ(report->final_hash, final_hash);
  EXPECT_FALSE(report->first_difference);
}

// Budgets chosen by measured time are inputs: a re-simulation uses no clock.
TEST_F(JournalTest, ChangesOfTheBudgetAreRepeated) {
  const auto input_with_budget = [](Tick tick) {
    TickInput input = test::playInput(tick);
    if (tick % 150 == 0)
      input.changes.push_back({.kind = ChangeKind::kBudget, .value = static_cast<double>(tick % 400)});
    return input;
  };
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
  auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
  ASSERT_TRUE(journal);
  std::uint32_t limited = 0;
  for (Tick tick = 1; tick <= kJournaledTicks; ++tick) {
    JournalEntry entry;
    entry.input = input_with_budget(tick);
    simulation.tick(entry.input);
    entry.hash = simulation.hash();
    limited += simulation.environment().work().limited_pairs;
    if (tick % kCheckpointEvery == 1) simulation.save(entry.checkpoint);
    ASSERT_TRUE(journal->write(entry));
  }
  EXPECT_GT(limited, 0U) << "the budgets must limit some queries";
  ASSERT_TRUE(journal->close({.phase = simulation.phase(), .tick = kJournaledTicks, .reason = "done"}));
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->compared, kJournaledTicks - 1);
  EXPECT_FALSE(report->first_difference);
  EXPECT_EQ(report->final_hash, simulation.hash());
}

TEST_F(JournalTest, HasScenarioDetailAndFingerprint) {
  write();
  const auto origin = readJournalOrigin(file_);
  ASSERT_TRUE(origin) << origin.error().what;
  EXPECT_EQ(origin->scenario, "small/scenario.yaml");
  EXPECT_EQ(origin->detail, 0.25);
  const auto fingerprint = readFingerprint(file_);
  ASSERT_TRUE(fingerprint) << fingerprint.error().what;
  EXPECT_TRUE(changesSince(*fingerprint, loaded_).empty());
  EXPECT_EQ(fingerprint->structures, fingerprintOf(loaded_).structures);
}

TEST_F(JournalTest, ItsScenarioIsFoundFromItsOwnFolderTooAndOtherwiseTheErrorSaysWhatToName) {
  const JournalOrigin origin{"beside/scenario.yaml", 1.0, {}};
  const auto missing = findScenario(file_, origin);
  ASSERT_FALSE(missing);
  for (const char* text : {"session.mcap: was recorded with the scenario 'beside/scenario.yaml'",
                           "tenon resimulate", "scenarios/engine_bay"})
    EXPECT_THAT(missing.error().what, HasSubstr(text));

  const auto beside = file_.parent_path() / "beside" / "scenario.yaml";
  std::filesystem::create_directory(beside.parent_path());
  std::ofstream(beside) << "title: any\n";
  EXPECT_EQ(findScenario(file_, origin).value(), beside);
  EXPECT_EQ(findScenario("elsewhere.mcap", {beside.string(), 1.0, {}}).value(), beside);
}

TEST_F(JournalTest, AShippedScenarioIsFoundByItsName) {
  setenv("TENON_SHARE", folder_.c_str(), 1);
  const auto shipped = folder_ / "scenarios" / "small";
  fs::create_directories(shipped);
  for (const char* scenario : {"small", "/elsewhere/scenarios/small/scenario.yaml"})
    EXPECT_EQ(findScenario(file_, {scenario, 1.0, {}}).value(), shipped) << scenario;
  EXPECT_FALSE(findScenario(file_, {"mine", 1.0, {}}));
  unsetenv("TENON_SHARE");
}

TEST(ScenarioName, IsThatOfItsFolderOrFile) {
  EXPECT_EQ(scenarioName("/anywhere/engine_bay/scenario.yaml"), "engine_bay");
  EXPECT_EQ(scenarioName("/anywhere/engine_bay/"), "engine_bay");
  EXPECT_EQ(scenarioName("engine_bay"), "engine_bay");
  EXPECT_EQ(scenarioName("mine/other.yaml"), "other.yaml");
  EXPECT_EQ(scenarioName("scenario.yaml"), std::filesystem::current_path().filename());
}

TEST_F(JournalTest, AChangedInputIsADifferenceAtItsTick) {
  write([](JournalEntry& entry) {
    if (entry.input.tick == 321) entry.input.readings[0].X_WH.translation().x() += 1e-12;
    return true;
  });
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->first_difference, Tick{321});
  EXPECT_EQ(report->compared, kJournaledTicks - 1) << "the ticks after the difference are compared too";
}

TEST_F(JournalTest, AnInputOfAnUnknownHandIsADifference) {
  write([](JournalEntry& entry) {
    if (entry.input.tick == 321) entry.input.readings[0].hand = HandId{12345};
    return true;
  });
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->first_difference, Tick{321});
}

TEST_F(JournalTest, AfterAGapItContinuesFromTheNextCheckpoint) {
  const std::uint64_t final_hash =
      write([](const JournalEntry& entry) { return entry.input.tick < 300 || entry.input.tick > 310; });
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  ASSERT_EQ(report->gaps.size(), 1U);
  EXPECT_EQ(report->compared, (299 - 1) + (kJournaledTicks - 1001));
  EXPECT_EQ(report->last, kJournaledTicks);
  EXPECT_EQ(report->final_hash, final_hash);
  EXPECT_FALSE(report->first_difference);
}

// as on an overloaded machine: of what lies between the first gap and the next checkpoint nothing can be
// compared
TEST_F(JournalTest, AllItsGapsAreCountedAlsoWhereNothingCanBeCompared) {
  const auto isLost = [](Tick tick) {
    return tick == 300 || (tick > 400 && tick <= 450) || tick == 998 || tick == 1500 || tick == 1600;
  };
  write([&](const JournalEntry& entry) { return !isLost(entry.input.tick); });
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  ASSERT_EQ(report->gaps.size(), 5U);
  EXPECT_EQ(report->gapTicks(), 1U + 50U + 1U + 1U + 1U);
  EXPECT_EQ(report->gaps[1].first, 401U);
  EXPECT_EQ(report->gaps[1].last, 450U);
  for (std::size_t gap = 0; gap < 3; ++gap) EXPECT_EQ(report->gaps[gap].compared_after, 1001U);
  for (std::size_t gap = 3; gap < 5; ++gap) EXPECT_EQ(report->gaps[gap].compared_after, 2001U);
  EXPECT_EQ(report->compared, (299 - 1) + (1499 - 1001) + (kJournaledTicks - 2001));
  EXPECT_FALSE(report->first_difference);
}

// as where the chunk before it is damaged: the gap shows with the next input alone
TEST_F(JournalTest, ACheckpointWhoseOwnInputIsMissingIsContinuedFrom) {
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
  auto writer = record::McapWriter::open(file_);
  ASSERT_TRUE(writer) << writer.error().what;
  const auto [inputs, checkpoints] = addChannels(*writer);
  for (Tick tick = 1; tick <= 30; ++tick) {
    const TickInput input = test::playInput(tick);
    simulation.tick(input);
    std::vector<std::uint8_t> bytes, checkpoint;
    appendBytes(input, bytes);
    if (tick < 10 || tick > 20)
      forEachPart<TickInputPart>(tick, simulation.hash(), bytes, [&](const TickInputPart& part) {
        EXPECT_TRUE(writer->write(inputs, 0, 0, *wire::encode(part)));
      });
    if (tick != 1 && tick != 20) continue;
    simulation.save(checkpoint);
    forEachPart<CheckpointPart>(tick, simulation.hash(), checkpoint, [&](const CheckpointPart& part) {
      EXPECT_TRUE(writer->write(checkpoints, 0, 0, *wire::encode(part)));
    });
  }
  ASSERT_TRUE(writer->close());
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  ASSERT_EQ(report->gaps.size(), 1U);
  EXPECT_EQ(report->gaps[0].first, 10U);
  EXPECT_EQ(report->gaps[0].last, 20U);
  EXPECT_EQ(report->gaps[0].compared_after, 20U);
  EXPECT_EQ(report->compared, (9 - 1) + (30 - 20));
  EXPECT_EQ(report->final_hash, simulation.hash());
  EXPECT_FALSE(report->first_difference);
}

TEST_F(JournalTest, WithoutItsFirstCheckpointTheTicksUpToTheNextAreAGap) {
  const std::uint64_t final_hash = write([](const JournalEntry& entry) { return entry.input.tick > 20; });
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  ASSERT_EQ(report->gaps.size(), 1U);
  EXPECT_EQ(report->gaps[0].first, 1U);
  EXPECT_EQ(report->gaps[0].last, 1001U);
  EXPECT_EQ(report->gaps[0].compared_after, 1001U);
  EXPECT_EQ(report->first, 1002U);
  EXPECT_EQ(report->final_hash, final_hash);
}

// as where its disk hangs up to the end of the run, so that no later input shows the gap
TEST_F(JournalTest, ItsMissingEndIsAGap) {
  const std::uint64_t final_hash = write([](const JournalEntry& entry) { return entry.input.tick <= 2000; });
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->last, 2000U);
  ASSERT_EQ(report->gaps.size(), 1U);
  EXPECT_EQ(report->gaps[0].first, 2001U);
  EXPECT_EQ(report->gaps[0].last, kJournaledTicks);
  EXPECT_TRUE(report->gaps[0].is_at_end);
  EXPECT_NE(report->final_hash, final_hash);
  EXPECT_FALSE(report->first_difference);
}

// as a server leaves it that is killed, also while its disk hangs
TEST_F(JournalTest, WithoutTheEndOfItsRunItSaysHowFarItReachesAndThatTheEndIsMissing) {
  write();
  EXPECT_FALSE(resimulateJournal()->has_no_end);
  EXPECT_EQ(resimulateJournal()->reached, kJournaledTicks);
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
  auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
  ASSERT_TRUE(journal);
  for (Tick tick = 1; tick <= 20; ++tick) {
    JournalEntry entry{.input = test::playInput(tick), .hash = 0, .checkpoint = {}};
    simulation.tick(entry.input);
    entry.hash = simulation.hash();
    if (tick == 1) simulation.save(entry.checkpoint);
    const bool is_lost = tick == 15;  // nothing after it is compared, and the file reaches farther
    if (!is_lost) {
      ASSERT_TRUE(journal->write(entry));
    }
  }
  ASSERT_TRUE(journal->keep());
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_TRUE(report->is_journal);
  EXPECT_TRUE(report->has_no_end);
  EXPECT_EQ(report->last, 14U);
  EXPECT_EQ(report->reached, 20U);
}

TEST_F(JournalTest, ARecordingThatWasClosedBeforeTheEndOfTheRunHasNoGapThere) {
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
  auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
  ASSERT_TRUE(journal);
  for (Tick tick = 1; tick <= 10; ++tick) {
    JournalEntry entry{.input = test::playInput(tick), .hash = 0, .checkpoint = {}};
    simulation.tick(entry.input);
    entry.hash = simulation.hash();
    if (tick == 1) simulation.save(entry.checkpoint);
    ASSERT_TRUE(journal->write(entry));
  }
  ASSERT_TRUE(journal->close({.phase = RunPhase::kPaused, .tick = 12, .reason = "paused"}));
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_TRUE(report->gaps.empty());
}

// 401 is lost, 402 to 600 are written; after a kill the server goes on after 400, without input
TEST_F(JournalTest, WhatFollowsAGapIsForgottenWhereAResumedServerBeginsAgain) {
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
  auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
  ASSERT_TRUE(journal);
  std::vector<std::uint8_t> at_400;
  const auto tick = [&](TickInput input, bool has_checkpoint) {
    JournalEntry entry{.input = std::move(input), .hash = 0, .checkpoint = {}};
    simulation.tick(entry.input);
    entry.hash = simulation.hash();
    if (has_checkpoint) simulation.save(entry.checkpoint);
    if (entry.input.tick == 400 && at_400.empty()) simulation.save(at_400);
    const bool is_lost = entry.input.tick == 401 && !has_checkpoint;
    if (!is_lost) {
      EXPECT_TRUE(journal->write(entry));
    }
  };
  for (Tick t = 1; t <= 600; ++t) tick(test::playInput(t), t == 1);
  ASSERT_TRUE(simulation.restore(at_400));
  for (Tick t = 401; t <= 700; ++t) tick({.tick = t}, t == 401);
  ASSERT_TRUE(journal->close({.phase = simulation.phase(), .tick = 700, .reason = "done"}));
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_FALSE(report->first_difference);
  EXPECT_EQ(report->last, 700U);
  EXPECT_EQ(report->compared, (400 - 1) + (700 - 401));
  EXPECT_EQ(report->final_hash, simulation.hash());
}

// in a recording: DDS keeps the order within a topic alone
TEST_F(JournalTest, ACheckpointThatFollowsInputsOfLaterTicksLeavesNoGap) {
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
  auto writer = record::McapWriter::open(file_);
  ASSERT_TRUE(writer) << writer.error().what;
  const auto [inputs, checkpoints] = addChannels(*writer);
  std::vector<std::uint8_t> checkpoint;
  std::uint64_t hash = 0;
  for (Tick tick = 1; tick <= 10; ++tick) {
    const TickInput input = test::playInput(tick);
    simulation.tick(input);
    hash = simulation.hash();
    std::vector<std::uint8_t> bytes;
    appendBytes(input, bytes);
    forEachPart<TickInputPart>(tick, hash, bytes, [&](const TickInputPart& part) {
      EXPECT_TRUE(writer->write(inputs, 0, 0, *wire::encode(part)));
    });
    if (tick == 1) simulation.save(checkpoint);
    if (tick != 4) continue;
    forEachPart<CheckpointPart>(1, 0, checkpoint, [&](const CheckpointPart& part) {
      EXPECT_TRUE(writer->write(checkpoints, 0, 0, *wire::encode(part)));
    });
  }
  ASSERT_TRUE(writer->close());
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_TRUE(report->gaps.empty());
  EXPECT_FALSE(report->has_no_end) << "who recorded it has closed it";
  EXPECT_EQ(report->first, 2U);
  EXPECT_EQ(report->compared, 9U);
  EXPECT_EQ(report->final_hash, hash);
  EXPECT_FALSE(report->first_difference);
}

TEST_F(JournalTest, ATruncatedJournalIsResimulatedUpToItsEnd) {
  write();
  fs::resize_file(file_, fs::file_size(file_) - 100);
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_GT(report->compared, 0U);
  EXPECT_FALSE(report->first_difference);
  EXPECT_FALSE(report->problem.empty()) << "the truncation is reported";

  fs::resize_file(file_, 200);
  const auto remainder = resimulateJournal();
  ASSERT_FALSE(remainder);
  EXPECT_THAT(remainder.error().what, HasSubstr("session.mcap"));
}

TEST_F(JournalTest, AJournalOfAnotherScenarioIsAnError) {
  write();
  SessionSimulation other = test::SessionRig::makeSimulation(test::smallSession(test::smallScenario()));
  const auto report = resimulate(file_, other);
  ASSERT_FALSE(report);
  EXPECT_THAT(report.error().what, HasSubstr("session.mcap"));
}

TEST_F(JournalTest, AJournalOfAnotherProtocolIsRefusedWithBothVersions) {
  auto writer = record::McapWriter::open(file_);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->addMetadata("tenon journal", {{"scenario", "small/scenario.yaml"}, {"detail", "1"}}));
  ASSERT_TRUE(writer->close());
  const auto report = resimulateJournal();
  ASSERT_FALSE(report);
  EXPECT_THAT(report.error().what, HasSubstr("version 3 or older of the protocol"));
  EXPECT_THAT(report.error().what, HasSubstr("version " + std::to_string(kProtocolVersion)));
}

TEST_F(JournalTest, AFileThatIsNoJournalIsAnErrorThatNamesIt) {
  const auto missing = resimulateJournal();
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().what, HasSubstr("session.mcap"));

  std::ofstream(file_) << "plain text, not a recording\n";
  const auto text = resimulateJournal();
  ASSERT_FALSE(text);
  EXPECT_THAT(text.error().what, HasSubstr("session.mcap"));
  EXPECT_FALSE(readJournalOrigin(file_));

  {
    auto empty = Journal::open(file_, {"small/scenario.yaml", 1.0});
    ASSERT_TRUE(empty);
    ASSERT_TRUE(empty->close({}));
  }
  EXPECT_THAT(resimulateJournal().error().what, HasSubstr("no ticks"));
  EXPECT_FALSE(Journal::open(file_ / "in a file" / "session.mcap", {}));
}

TEST(ForEachPart, SplitsBytesIntoPartsThatFitASample) {
  for (const std::size_t size : {0, 1, 1023, 1024, 1025, 5000}) {
    std::vector<std::uint8_t> bytes(size);
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
    std::vector<std::uint8_t> joined;
    std::uint32_t parts = 0;
    forEachPart<CheckpointPart>(9, 4, bytes, [&](const CheckpointPart& part) {
      EXPECT_EQ(part.part, parts++);
      EXPECT_EQ(part.tick, 9U);
      EXPECT_EQ(part.state_hash, 4U);
      EXPECT_LE(part.bytes.size(), 1024U);
      EXPECT_EQ(part.parts, std::max<std::size_t>(1, (size + 1023) / 1024));
      joined.insert(joined.end(), part.bytes.begin(), part.bytes.end());
    });
    EXPECT_EQ(joined, bytes);
    EXPECT_EQ(parts, std::max<std::size_t>(1, (size + 1023) / 1024));
  }
}

}  // namespace
}  // namespace tenon::session
