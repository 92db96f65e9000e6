#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include "idl/record/packed_inputs.h"
#include "idl/types/ids.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/journal.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::recorder {

/// What of the streams of 1 kHz and of the journal a recording keeps that does not have all of them:
/// * WorldFrame_1k and DeviceInput: nothing, WorldFrame_100, HandState_100 and the inputs have their content;
/// * HandManifold: of ten ticks, for each hand the one with the largest force;
/// * TickInput: all, packed (record::encodePackedInputs);
/// * Checkpoint: the first one, then one in 10 s, and the next one after a gap.
/// The session can be re-simulated from that, tick by tick.
///
/// Threads: one at a time. Real-time: no.
class StreamReduction {
 public:
  /// Gets what is to be written, its topic among it, and the tick it belongs to.
  using Write = std::function<void(const wire::RawSample& sample, Tick tick)>;

  [[nodiscard]] static bool isOmitted(std::string_view topic);
  /// Whether a topic has what another one has, at a lower rate: no recording has it.
  [[nodiscard]] static bool isCopy(std::string_view topic);
  /// Whether the sample is written by the caller as it is. Others are skipped, or written later.
  [[nodiscard]] bool keeps(const HandManifold& manifold, const wire::RawSample& sample, const Write& write);
  [[nodiscard]] bool keeps(const TickInputPart& part, const wire::RawSample& sample, const Write& write);
  [[nodiscard]] bool keeps(const CheckpointPart& part);
  /// Writes what waits. To be called at the end, and before a new life of the server, whose ticks may begin
  /// before the last one.
  void finish(const Write& write);

 private:
  struct Candidate {
    Tick tick = 0;
    double force = -1.0;  ///< [N] of the coupling; below 0: there is none
    std::int64_t source_ns = 0;
    std::uint64_t sequence = 0;
    std::vector<std::uint8_t> bytes;
  };
  static void write(const Candidate& candidate, const Write& write);
  void writeInputs(const Write& write);

  std::map<HandId, Candidate> strongest_;  ///< of the period that has begun
  record::RecordedInput joined_;           ///< the parts so far
  std::uint32_t next_part_ = 0;
  std::vector<record::RecordedInput> inputs_;
  std::int64_t inputs_ns_ = 0;  ///< source time of the newest one
  std::uint64_t packed_ = 0;
  Tick newest_input_ = 0;
  std::optional<Tick> checkpoint_;  ///< the newest one kept
  bool needs_checkpoint_ = true;
};

}  // namespace tenon::recorder
