#include "server/session/journal.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/types/messages/journal.h"
#include "idl/types/messages/session.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"
#include "tests/server/session/small_session.h"
#include "tests/support/file_damage.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using test::kRightHand;
using test::playInput;
using test::SessionRig;
using ::testing::HasSubstr;

constexpr Tick kTicks = 2100;

/// The channels of inputs and checkpoints, as a Journal has them.
std::pair<std::uint16_t, std::uint16_t> addChannels(record::McapWriter& writer) {
  return {writer.addChannel(wire::kTickInput.name, wire::typeName<TickInputPart>(), wire::idlText()),
          writer.addChannel(wire::kCheckpoint.name, wire::typeName<CheckpointPart>(), wire::idlText())};
}

class JournalTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    file_ = folder_ / "session.mcap";
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// Journals the play and returns the final hash; `alter` may change an entry, or drop it by returning
  /// false.
  std::uint64_t write(const std::function<bool(JournalEntry&)>& alter = {}) {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
    auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
    EXPECT_TRUE(journal);
    for (Tick tick = 1; tick <= kTicks; ++tick) {
      JournalEntry entry;
      entry.input = test::playInput(tick);
      simulation.tick(entry.input);
      entry.hash = simulation.hash();
      if (tick % kCheckpointEvery == 1) simulation.save(entry.checkpoint);
      if (alter && !alter(entry)) continue;
      EXPECT_TRUE(journal->write(entry));
    }
    EXPECT_TRUE(journal->close({.phase = simulation.phase(), .tick = kTicks, .reason = "done"}));
    return simulation.hash();
  }
  Result<ResimulationReport> resimulateJournal() {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
    return resimulate(file_, simulation);
  }

  LoadedScene loaded_ = test::smallSession();
  fs::path folder_ = fs::temp_directory_path() / ("tenon-journal-test-" + std::to_string(getpid()));
  fs::path file_;
};

TEST_F(JournalTest, ResimulatesToEqualHashes) {
  const std::uint64_t final_hash = write();
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->first, 2U) << "the first checkpoint is of the state after tick 1";
  EXPECT_EQ(report->last, kTicks);
  EXPECT_EQ(report->compared, kTicks - 1);
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
  for (Tick tick = 1; tick <= kTicks; ++tick) {
    JournalEntry entry;
    entry.input = input_with_budget(tick);
    simulation.tick(entry.input);
    entry.hash = simulation.hash();
    limited += simulation.environment().work().limited_pairs;
    if (tick % kCheckpointEvery == 1) simulation.save(entry.checkpoint);
    ASSERT_TRUE(journal->write(entry));
  }
  EXPECT_GT(limited, 0U) << "the budgets must limit some queries";
  ASSERT_TRUE(journal->close({.phase = simulation.phase(), .tick = kTicks, .reason = "done"}));
  const auto report = resimulateJournal();
  ASSERT_TRUE(report) << report.error().what;
  EXPECT_EQ(report->compared, kTicks - 1);
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
  EXPECT_EQ(report->compared, kTicks - 1) << "the ticks after the difference are compared too";
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
  EXPECT_EQ(report->compared, (299 - 1) + (kTicks - 1001));
  EXPECT_EQ(report->last, kTicks);
  EXPECT_EQ(report->final_hash, final_hash);
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

class JournalDamage : public JournalTest {};

TEST_F(JournalDamage, DamagedBytesAreReportedOrSkippedAndNeverADifference) {
  write();
  const auto size = static_cast<std::streamoff>(fs::file_size(file_));
  std::uint64_t compared = 0;
  for (int i = 1; i < 12; ++i) {
    const fs::path damaged = folder_ / "damaged.mcap";
    fs::copy_file(file_, damaged, fs::copy_options::overwrite_existing);
    std::fstream bytes(damaged, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(size * i / 12);
    for (int k = 0; k < 8; ++k) bytes.put('\x5A');
    bytes.close();
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
    const auto report = resimulate(damaged, simulation);
    if (!report) continue;  // else damaged chunks were skipped:
    EXPECT_FALSE(report->first_difference) << i;
    compared += report->compared;
  }
  EXPECT_GT(compared, kTicks) << "what is not damaged is compared";
}

/// Ticks `first` to `first` + `count` of the play, the first with a checkpoint.
std::vector<JournalEntry> playedEntries(const LoadedScene& loaded, Tick first, Tick count) {
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded, 1, {test::kRightHand});
  std::vector<JournalEntry> entries;
  for (Tick tick = 1; tick <= first + count; ++tick) {
    JournalEntry entry;
    entry.input = test::playInput(tick);
    simulation.tick(entry.input);
    entry.hash = simulation.hash();
    if (tick == first) simulation.save(entry.checkpoint);
    if (tick >= first) entries.push_back(std::move(entry));
  }
  return entries;
}

/// Ticks of the play at which hands touch nothing, the part, and the wall of the socket.
constexpr Tick kPlayedTicks[] = {100, 750, 1680};

/// Restores `rounds` damaged checkpoints of each kind. What is accepted must be fit to continue from.
void restoreDamaged(const LoadedScene& loaded, std::uint64_t rounds) {
  std::uint64_t refused = 0;
  std::uint64_t accepted = 0;
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded);
  TickOutput output = simulation.makeOutput();
  for (const Tick first : kPlayedTicks) {
    const std::vector<JournalEntry> entries = playedEntries(loaded, first, 20);
    for (std::uint64_t round = 0; round < rounds; ++round) {
      SCOPED_TRACE(testing::Message() << "checkpoint of tick " << first << ", damage " << round);
      std::vector<std::uint8_t> bytes = entries[0].checkpoint;
      test::FileDamage damage(round);
      if (round % 16 == 0) damage.truncate(bytes);
      damage.damage(bytes);
      if (const auto restored = simulation.restore(bytes); !restored) {
        ++refused;
        ASSERT_FALSE(restored.error().what.empty());
        ASSERT_EQ(restored.error().what.find('\n'), std::string::npos);
        continue;
      }
      ++accepted;
      for (std::size_t i = 1; i < entries.size(); ++i) {
        simulation.tick(entries[i].input);
        simulation.fill(output);
      }
      // an undamaged checkpoint is not affected by what was restored before it
      if (round % 64 != 0) continue;
      ASSERT_TRUE(simulation.restore(entries[0].checkpoint));
      for (std::size_t i = 1; i < entries.size(); ++i) {
        simulation.tick(entries[i].input);
        ASSERT_EQ(simulation.hash(), entries[i].hash);
      }
    }
  }
  EXPECT_GT(refused, rounds / 10);
  EXPECT_GT(accepted, rounds / 10) << "damage of positions and times is not detectable";
}

TEST_F(JournalDamage, ADamagedCheckpointIsRefusedOrGoesOn) { restoreDamaged(loaded_, 1000); }

/// Writes entries as a Journal does, and damages the data of one message before the file gets its checksums.
void writeDamaged(const fs::path& file, const std::vector<JournalEntry>& entries, std::uint64_t seed) {
  test::FileDamage damage(seed);
  auto writer = record::McapWriter::open(file);
  ASSERT_TRUE(writer) << writer.error().what;
  const auto [inputs, checkpoints] = addChannels(*writer);
  std::vector<std::pair<std::uint16_t, std::vector<std::uint8_t>>> messages;
  const auto add = [&](std::uint16_t channel, const auto& part) {
    const auto data = wire::encode(part);
    ASSERT_TRUE(data);
    messages.emplace_back(channel, *data);
  };
  for (const JournalEntry& entry : entries) {
    std::vector<std::uint8_t> bytes;
    appendBytes(entry.input, bytes);
    forEachPart<TickInputPart>(entry.input.tick, entry.hash, bytes,
                               [&](const auto& part) { add(inputs, part); });
    if (entry.checkpoint.empty()) continue;
    forEachPart<CheckpointPart>(entry.input.tick, entry.hash, entry.checkpoint,
                                [&](const auto& part) { add(checkpoints, part); });
  }
  std::vector<std::uint8_t>& data = messages[damage.below(messages.size())].second;
  if (seed % 8 == 0) damage.truncate(data);
  damage.damage(data);
  std::uint32_t sequence = 0;
  for (const auto& [channel, bytes] : messages) {
    ASSERT_TRUE(writer->write(channel, sequence, sequence, bytes));
    ++sequence;
  }
  ASSERT_TRUE(writer->close());
}

/// Re-simulates `rounds` journals of each kind with damage in one message and right checksums.
void resimulateDamaged(const fs::path& file, const LoadedScene& loaded, std::uint64_t rounds) {
  std::uint64_t refused = 0;
  std::uint64_t different = 0;
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded);
  for (const Tick first : kPlayedTicks) {
    const std::vector<JournalEntry> entries = playedEntries(loaded, first, 6);
    for (std::uint64_t round = 0; round < rounds; ++round) {
      SCOPED_TRACE(testing::Message() << "from tick " << first << ", damage " << round);
      ASSERT_NO_FATAL_FAILURE(writeDamaged(file, entries, round));
      const auto report = resimulate(file, simulation);
      if (report) {
        ASSERT_TRUE(report->problem.empty()) << report->problem;
        different += report->first_difference || report->compared < entries.size() - 1 ? 1 : 0;
      } else {
        ++refused;
        ASSERT_THAT(report.error().what, HasSubstr("session.mcap"));
      }
    }
  }
  EXPECT_GT(refused, rounds / 10);
  EXPECT_GT(different, rounds / 10) << "a changed number of an input is a difference at its tick";
}

TEST_F(JournalDamage, DamageBehindRightChecksumsIsRefusedOrADifference) {
  resimulateDamaged(file_, loaded_, 500);
}

class JournalNightly : public JournalTest {};

TEST_F(JournalNightly, ADamagedCheckpointIsRefusedOrGoesOn) { restoreDamaged(loaded_, 20'000); }
TEST_F(JournalNightly, DamageBehindRightChecksumsIsRefusedOrADifference) {
  resimulateDamaged(file_, loaded_, 10'000);
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
