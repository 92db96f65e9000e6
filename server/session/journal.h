#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "idl/record/mcap_reader.h"
#include "idl/record/mcap_writer.h"
#include "idl/types/result.h"
#include "server/session/scene_loader.h"
#include "server/session/session_simulation.h"
#include "server/session/tick_io.h"

namespace tenon::session {

inline constexpr Tick kCheckpointEvery = 1000;           // [ticks]
inline constexpr std::int64_t kJournalTick = 1'000'000;  // [ns] of log time
inline constexpr Tick kKeptForRecorders = 16384;         // [ticks] for those that join late or come back

/// Whether the journal entry of this tick has a checkpoint.
[[nodiscard]] constexpr bool hasCheckpoint(Tick tick) { return tick % kCheckpointEvery == 1; }

/// What the tick thread passes to the journal thread.
struct JournalEntry {
  TickInput input;
  std::uint64_t hash = 0;                ///< SessionSimulation::hash after the tick
  std::vector<std::uint8_t> checkpoint;  ///< state after the tick; empty in most ticks
};

/// Splits `bytes` into numbered parts that each fit one sample and calls `emit` for each in order; at least
/// one part, even for no bytes. `Part` is TickInputPart or CheckpointPart.
template <typename Part>
void forEachPart(Tick tick, std::uint64_t hash, std::span<const std::uint8_t> bytes,
                 const std::function<void(const Part&)>& emit) {
  constexpr std::size_t kPartBytes = 1024;
  Part part;
  part.tick = tick;
  part.state_hash = hash;
  part.parts =
      static_cast<std::uint32_t>(std::max<std::size_t>(1, (bytes.size() + kPartBytes - 1) / kPartBytes));
  for (part.part = 0; part.part < part.parts; ++part.part) {
    const auto slice =
        bytes.subspan(part.part * kPartBytes, std::min(kPartBytes, bytes.size() - part.part * kPartBytes));
    part.bytes.assign(slice.begin(), slice.end());
    emit(part);
  }
}

/// The scene of a journal or recording: enough to load it again and to detect changes since.
struct JournalOrigin {
  std::string scenario;     ///< path; of a recording: scenarioName
  double detail = 1.0;      ///< [-] LoadOptions::detail
  Fingerprint fingerprint;  ///< empty when readJournalOrigin made it: see readFingerprint
  LinkLimits limits;
  std::uint32_t server_epoch = 0;  ///< of the server that began a journal; 0: not recorded
};

/// The server's own recording on its local disk, an MCAP file: every TickInput with the state hash after it,
/// and a checkpoint every kCheckpointEvery ticks. Log time is tick times kJournalTick. A journal without an
/// outcome is that of a server that was killed, which readResumePoint takes up.
///
/// Threads: one (journal). Real-time: no.
class Journal {
 public:
  /// Overwrites `file`. Fails when it cannot be written.
  [[nodiscard]] static Result<Journal> open(const std::filesystem::path& file, const JournalOrigin& origin);
  /// Continues the journal of a killed server after its last complete chunk, from where on the life
  /// `server_epoch` of the server follows with the tick after `tick`. Fails as McapWriter::reopen.
  [[nodiscard]] static Result<Journal> reopen(const std::filesystem::path& file, Tick tick,
                                              std::uint32_t server_epoch);
  /// Adds a copy of the scenario's files (scenario_copy.h), before the first entry. After a failure the
  /// journal has none, and is of use where the scenario is.
  [[nodiscard]] Result<void> copyScenario(const game_control::ScenarioFile& scenario);
  [[nodiscard]] Result<void> write(const JournalEntry& entry);
  /// What was written survives the end of this process.
  [[nodiscard]] Result<void> keep() { return writer_.endChunk(); }
  /// Writes the outcome and the file's summary.
  [[nodiscard]] Result<void> close(const RunState& run);

 private:
  explicit Journal(record::McapWriter writer);

  record::McapWriter writer_;
  std::uint16_t input_channel_ = 0;
  std::uint16_t checkpoint_channel_ = 0;
  std::vector<std::uint8_t> bytes_;
};

/// Ticks that a journal or recording does not have, or, at its begin, not with the checkpoint before them.
struct JournalGap {
  Tick first = 0, last = 0;
  /// Of the next checkpoint, from which on ticks are compared again; 0: none follows. Gaps that follow each
  /// other without a checkpoint between them have the same one, and what lies between them is not compared.
  Tick compared_after = 0;
  bool is_at_end = false;  ///< `last` is the last tick of the run, by its outcome
};

/// Result of a re-simulation.
struct ResimulationReport {
  Tick first = 0, last = 0;  ///< ticks compared
  std::uint64_t compared = 0;
  /// All of them, in their order, also where nothing could be compared anyway; of a journal also before its
  /// first checkpoint. The end of a run that is missing is one.
  std::vector<JournalGap> gaps;
  /// In all gaps.
  [[nodiscard]] Tick gapTicks() const;
  bool is_journal = false;  ///< of a server, which --resume continues; else a recording
  Tick reached = 0;         ///< of the newest inputs in the file, also where they are not compared
  /// The file does not record how the run ended, so there may have been ticks after `reached`: its program
  /// was killed, still runs, or could not write it any more. Not of a recording that was closed before that
  /// end.
  bool has_no_end = false;
  std::uint64_t final_hash = 0;
  std::optional<Tick> first_difference;  ///< first tick whose hash differs
  std::string problem;                   ///< damage and truncation found in the file, or empty
  bool is_damaged = false;               ///< beyond a truncation: it may lack what it had
};

/// Re-simulates the ticks of a journal or recording, from its first checkpoint on, and compares the state
/// hash of each. It uses the recorded inputs alone and no clock: budgets chosen by measured time are among
/// the inputs. A difference is reported and the remaining ticks are compared all the same. Fails when `file`
/// cannot be read, is of another scenario, or has no tick after a checkpoint.
/// How far a run went is known by its outcome alone, which is written last: what a server that was killed, or
/// whose disk hung, did after its last write is recorded nowhere.
[[nodiscard]] Result<ResimulationReport> resimulate(const std::filesystem::path& file,
                                                    SessionSimulation& simulation);

/// Why inputs of this journal or recording cannot be read: it was written by another version of the protocol;
/// empty: they can.
[[nodiscard]] std::string refusalByProtocol(const record::McapReader& reader);

/// The fingerprint of the scene that a journal or a recording was made with; empty where it was not recorded.
[[nodiscard]] Result<Fingerprint> readFingerprint(const std::filesystem::path& file);

/// The largest epoch of the servers that wrote this journal; 0 where none is recorded or it cannot be read.
[[nodiscard]] std::uint32_t lastServerEpoch(const std::filesystem::path& journal);

/// What a journal or recording was made with. Fails for a file that does not say so.
[[nodiscard]] Result<JournalOrigin> readJournalOrigin(const std::filesystem::path& file);

/// What a scenario is called wherever it is: its folder, or its file when that is no scenario.yaml.
[[nodiscard]] std::string scenarioName(const std::filesystem::path& scenario);

/// The scenario of a journal or recording: its recorded path, from the working directory or else from the
/// journal's folder, or else the shipped scenario of its name. Fails when there is none.
[[nodiscard]] Result<std::filesystem::path> findScenario(const std::filesystem::path& journal,
                                                         const JournalOrigin& origin);

}  // namespace tenon::session
