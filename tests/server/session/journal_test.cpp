#include "server/session/journal.h"

#include <filesystem>
#include <fstream>
#include <functional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/server/session/small_session.h"

namespace tenon {
namespace {

namespace fs = std::filesystem;
using test::kRightHand;
using test::play;
using test::Stage;
using ::testing::HasSubstr;

constexpr Tick kTicks = 2100;

class JournalTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    file_ = folder_ / "session.mcap";
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// Journals the play; `alter` may change an entry, or leave it out by returning false.
  std::uint64_t write(const std::function<bool(JournalEntry&)>& alter = {}) {
    Exercise exercise = Stage::makeExercise(loaded_, 1, {kRightHand});
    auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
    EXPECT_TRUE(journal);
    for (Tick tick = 1; tick <= kTicks; ++tick) {
      JournalEntry entry;
      entry.input = play(tick);
      exercise.tick(entry.input);
      entry.hash = exercise.hash();
      if (tick % kCheckpointEvery == 1) exercise.save(entry.checkpoint);
      if (alter && !alter(entry)) continue;
      EXPECT_TRUE(journal->write(entry));
    }
    EXPECT_TRUE(journal->close({.phase = exercise.phase(), .tick = kTicks, .reason = "done"}));
    return exercise.hash();
  }
  Result<RerunReport> again() {
    Exercise exercise = Stage::makeExercise(loaded_);
    return rerun(file_, exercise);
  }

  LoadedScene loaded_ = test::smallSession();
  fs::path folder_ = fs::temp_directory_path() / ("tenon-journal-test-" + std::to_string(getpid()));
  fs::path file_;
};

TEST_F(JournalTest, RunsAgainToEqualHashes) {
  const std::uint64_t final_hash = write();
  const auto report = again();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->first, 2U) << "the first checkpoint is what the first tick left";
  EXPECT_EQ(report->last, kTicks);
  EXPECT_EQ(report->compared, kTicks - 1);
  EXPECT_EQ(report->gaps, 0U);
  EXPECT_EQ(report->final_hash, final_hash);
  EXPECT_FALSE(report->first_difference);
}

// Whatever a clock has decided is in the inputs: a re-run has no clock.
TEST_F(JournalTest, BudgetsThatChangeOnTheWayAreRepeated) {
  const auto play_with = [](Tick tick) {
    TickInput input = play(tick);
    if (tick % 150 == 0)
      input.changes.push_back({.kind = ChangeKind::kBudget, .value = static_cast<double>(tick % 400)});
    return input;
  };
  Exercise exercise = Stage::makeExercise(loaded_, 1, {kRightHand});
  auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
  ASSERT_TRUE(journal);
  std::uint32_t limited = 0;
  for (Tick tick = 1; tick <= kTicks; ++tick) {
    JournalEntry entry;
    entry.input = play_with(tick);
    exercise.tick(entry.input);
    entry.hash = exercise.hash();
    limited += exercise.environment().work().limited_pairs;
    if (tick % kCheckpointEvery == 1) exercise.save(entry.checkpoint);
    ASSERT_TRUE(journal->write(entry));
  }
  EXPECT_GT(limited, 0U) << "the budgets did limit something";
  ASSERT_TRUE(journal->close({.phase = exercise.phase(), .tick = kTicks, .reason = "done"}));
  const auto report = again();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->compared, kTicks - 1);
  EXPECT_FALSE(report->first_difference);
  EXPECT_EQ(report->final_hash, exercise.hash());
}

TEST_F(JournalTest, SaysWhatItWasMadeWith) {
  write();
  const auto origin = originOf(file_);
  ASSERT_TRUE(origin) << origin.error().what;
  EXPECT_EQ(origin->scenario, "small/scenario.yaml");
  EXPECT_EQ(origin->detail, 0.25);
  const auto made = madeOf(file_);
  ASSERT_TRUE(made) << made.error().what;
  EXPECT_TRUE(changesSince(*made, loaded_).empty());
  EXPECT_EQ(made->structures, fingerprintOf(loaded_).structures);
}

TEST_F(JournalTest, AChangedInputIsFoundAtItsTick) {
  write([](JournalEntry& entry) {
    if (entry.input.tick == 321) entry.input.readings[0].X_WH.translation().x() += 1e-12;
    return true;
  });
  const auto report = again();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->first_difference, Tick{321});
  EXPECT_EQ(report->compared, kTicks - 1) << "the rest is looked at too";
}

TEST_F(JournalTest, AHandThatDoesNotExistIsADifferenceAndNoCrash) {
  write([](JournalEntry& entry) {
    if (entry.input.tick == 321) entry.input.readings[0].hand = HandId{12345};
    return true;
  });
  const auto report = again();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->first_difference, Tick{321});
}

TEST_F(JournalTest, AfterAGapItGoesOnFromTheNextCheckpoint) {
  const std::uint64_t final_hash =
      write([](const JournalEntry& entry) { return entry.input.tick < 300 || entry.input.tick > 310; });
  const auto report = again();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->gaps, 1U);
  EXPECT_EQ(report->compared, (299 - 1) + (kTicks - 1001));
  EXPECT_EQ(report->last, kTicks);
  EXPECT_EQ(report->final_hash, final_hash);
  EXPECT_FALSE(report->first_difference);
}

TEST_F(JournalTest, AJournalThatWasCutRunsAsFarAsItGoes) {
  write();
  fs::resize_file(file_, fs::file_size(file_) - 100);
  const auto report = again();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_GT(report->compared, 0U);
  EXPECT_FALSE(report->first_difference);
  EXPECT_FALSE(report->problem.empty()) << "and says that it was";

  fs::resize_file(file_, 200);
  const auto stump = again();
  ASSERT_FALSE(stump);
  EXPECT_THAT(stump.error().what, HasSubstr("session.mcap"));
}

TEST_F(JournalTest, ASceneOfAnotherScenarioIsRefused) {
  write();
  Exercise other = Stage::makeExercise(test::smallSession(test::smallScenario()));
  const auto report = rerun(file_, other);
  ASSERT_FALSE(report);
  EXPECT_THAT(report.error().what, HasSubstr("session.mcap"));
}

TEST_F(JournalTest, WhatIsNoJournalIsAClearError) {
  const auto missing = again();
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().what, HasSubstr("session.mcap"));

  std::ofstream(file_) << "this is a letter, not a recording\n";
  const auto letter = again();
  ASSERT_FALSE(letter);
  EXPECT_THAT(letter.error().what, HasSubstr("session.mcap"));
  EXPECT_FALSE(originOf(file_));

  {
    auto empty = Journal::open(file_, {"small/scenario.yaml", 1.0});
    ASSERT_TRUE(empty);
    ASSERT_TRUE(empty->close({}));
  }
  EXPECT_THAT(again().error().what, HasSubstr("no ticks"));
  EXPECT_FALSE(Journal::open(file_ / "in a file" / "session.mcap", {}));
}

TEST_F(JournalTest, FlippedBytesNeverPassAsTheSession) {
  write();
  const auto size = static_cast<std::streamoff>(fs::file_size(file_));
  for (int i = 1; i < 12; ++i) {
    const fs::path damaged = folder_ / "damaged.mcap";
    fs::copy_file(file_, damaged, fs::copy_options::overwrite_existing);
    std::fstream bytes(damaged, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(size * i / 12);
    for (int k = 0; k < 8; ++k) bytes.put('\x5A');
    bytes.close();
    Exercise exercise = Stage::makeExercise(loaded_);
    const auto report = rerun(damaged, exercise);
    if (!report) continue;  // an error that says so, or whole chunks left out:
    EXPECT_FALSE(report->first_difference) << i;
  }
}

TEST(ForEachPart, CutsBytesIntoPartsThatFitASample) {
  for (const std::size_t size : {0, 1, 1023, 1024, 1025, 5000}) {
    std::vector<std::uint8_t> bytes(size);
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
    std::vector<std::uint8_t> together;
    std::uint32_t parts = 0;
    forEachPart<CheckpointPart>(9, 4, bytes, [&](const CheckpointPart& part) {
      EXPECT_EQ(part.part, parts++);
      EXPECT_EQ(part.tick, 9U);
      EXPECT_EQ(part.state_hash, 4U);
      EXPECT_LE(part.bytes.size(), 1024U);
      EXPECT_EQ(part.parts, std::max<std::size_t>(1, (size + 1023) / 1024));
      together.insert(together.end(), part.bytes.begin(), part.bytes.end());
    });
    EXPECT_EQ(together, bytes);
    EXPECT_EQ(parts, std::max<std::size_t>(1, (size + 1023) / 1024));
  }
}

}  // namespace
}  // namespace tenon
