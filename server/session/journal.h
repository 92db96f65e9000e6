#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "idl/record/mcap_writer.h"
#include "idl/types/result.h"
#include "server/session/exercise.h"
#include "server/session/scene_loader.h"
#include "server/session/tick_io.h"

namespace tenon {

inline constexpr Tick kCheckpointEvery = 1000;  // [ticks] a second

/// What the tick hands to the journal.
struct JournalEntry {
  TickInput input;
  std::uint64_t hash = 0;
  std::vector<std::uint8_t> checkpoint;  ///< of the state the tick left; empty between checkpoints
};

/// Cuts bytes into the numbered parts that fit a sample, and puts them together again.
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

/// What a journal was made with: enough to load the same scene again, and to know whether it is the same.
struct JournalOrigin {
  std::string scenario;  ///< path
  double detail = 1.0;   ///< of generated parts
  Fingerprint made_of;
};

/// The server's own recording on its local disk: every TickInput with the hash of the state it left, and a
/// Checkpoint a second. An MCAP file like any other recording.
///
/// Threads: one (journal).
class Journal {
 public:
  [[nodiscard]] static Result<Journal> open(const std::filesystem::path& file, const JournalOrigin& origin);
  [[nodiscard]] Result<void> write(const JournalEntry& entry);
  [[nodiscard]] Result<void> close(const RunState& run);

 private:
  explicit Journal(McapWriter writer) : writer_(std::move(writer)) {}

  McapWriter writer_;
  std::uint16_t inputs_ = 0;
  std::uint16_t checkpoints_ = 0;
  std::vector<std::uint8_t> bytes_;
};

/// How a re-run went.
struct RerunReport {
  Tick first = 0, last = 0;  ///< ticks compared
  std::uint64_t compared = 0;
  std::uint64_t gaps = 0;  ///< places where ticks were missing: taken up again at the next checkpoint
  std::uint64_t final_hash = 0;
  std::optional<Tick> first_difference;
  std::string problem;  ///< what was wrong with the file, or empty
};

/// Runs the ticks of a journal or recording again, from its first checkpoint on, and compares the hash of
/// every one (DESIGN section 5).
[[nodiscard]] Result<RerunReport> rerun(const std::filesystem::path& file, Exercise& exercise);

/// What a journal or a recording from the bus says of the scene it was made with.
[[nodiscard]] Result<Fingerprint> madeOf(const std::filesystem::path& file);

/// Fails when the file is no journal.
[[nodiscard]] Result<JournalOrigin> originOf(const std::filesystem::path& file);

}  // namespace tenon
