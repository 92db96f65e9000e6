#include <cstdint>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/messages/journal.h"
#include "idl/wire/codec.h"
#include "server/session/journal.h"
#include "tests/server/session/journal_fixture.h"
#include "tests/server/session/small_session.h"
#include "tests/support/file_damage.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

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
  EXPECT_GT(compared, kJournaledTicks) << "what is not damaged is compared";
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

}  // namespace
}  // namespace tenon::session
