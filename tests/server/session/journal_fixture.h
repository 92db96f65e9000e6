#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/mcap_writer.h"
#include "idl/types/messages/journal.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"
#include "server/session/journal.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {

inline constexpr Tick kJournaledTicks = 2100;

/// The channels of inputs and checkpoints, as a Journal has them.
inline std::pair<std::uint16_t, std::uint16_t> addChannels(record::McapWriter& writer) {
  return {writer.addChannel(wire::kTickInput.name, wire::typeName<TickInputPart>(), wire::idlText()),
          writer.addChannel(wire::kCheckpoint.name, wire::typeName<CheckpointPart>(), wire::idlText())};
}

/// A journal of the play of small_session.h, in a folder of its own.
class JournalTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_);
    file_ = folder_ / "session.mcap";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// Journals the play and returns the final hash; `alter` may change an entry, or drop it by returning
  /// false.
  std::uint64_t write(const std::function<bool(JournalEntry&)>& alter = {}) {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_, 1, {test::kRightHand});
    auto journal = Journal::open(file_, {"small/scenario.yaml", 0.25, fingerprintOf(loaded_)});
    EXPECT_TRUE(journal);
    for (Tick tick = 1; tick <= kJournaledTicks; ++tick) {
      JournalEntry entry;
      entry.input = test::playInput(tick);
      simulation.tick(entry.input);
      entry.hash = simulation.hash();
      if (tick % kCheckpointEvery == 1) simulation.save(entry.checkpoint);
      if (alter && !alter(entry)) continue;
      EXPECT_TRUE(journal->write(entry));
    }
    EXPECT_TRUE(journal->close({.phase = simulation.phase(),
                                .tick = kJournaledTicks,
                                .reason = "done",
                                .final_hash = simulation.hash()}));
    return simulation.hash();
  }
  Result<ResimulationReport> resimulateJournal() {
    SessionSimulation simulation = test::SessionRig::makeSimulation(loaded_);
    return resimulate(file_, simulation);
  }

  LoadedScene loaded_ = test::smallSession();
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("tenon-journal-test-" + std::to_string(getpid()));
  std::filesystem::path file_;
};

}  // namespace tenon::session
