#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "idl/record/mcap_writer.h"
#include "idl/types/messages.h"
#include "idl/types/result.h"
#include "idl/wire/tap.h"

namespace tenon {

/// The file of one session while it is written: what the bus brought, in the order in which it came.
///
/// Log times are session time, so that a file plays at the pace at which people lived it. By the clock that
/// is the sample's source time. A lockstep session runs as fast as its machines allow: there the time is that
/// of the start of the session plus one millisecond for each tick of the newest WorldFrame_1k.
///
/// Threads: one at a time. Real-time: no.
class Recording {
 public:
  [[nodiscard]] static Result<Recording> open(const std::filesystem::path& file,
                                              const SessionAnnounce& session);

  void add(const RawSample& sample);
  /// Writes outcome and summary; the file takes nothing more.
  [[nodiscard]] Result<void> close();

  /// What others are told. Once the file cannot be written `recording` is false and `problem` says why.
  [[nodiscard]] const RecorderStatus& status() const { return status_; }
  [[nodiscard]] bool runIsOver() const;
  [[nodiscard]] const std::optional<RunState>& run() const { return run_; }

 private:
  Recording(McapWriter writer, const SessionAnnounce& session);
  [[nodiscard]] std::uint16_t channelOf(std::string_view topic, std::string_view type,
                                        std::string_view schema);
  void write(std::uint16_t channel, std::int64_t source_ns, std::uint64_t sequence,
             std::span<const std::uint8_t> bytes);
  void follow(const RawSample& sample);
  [[nodiscard]] std::int64_t logTime(std::int64_t source_ns);
  void note(const Result<void>& done);

  McapWriter writer_;
  SessionAnnounce session_;
  std::map<std::string, std::uint16_t, std::less<>> channels_;
  RecorderStatus status_;
  std::optional<RunState> run_;
  Tick newest_tick_ = 0;       ///< of WorldFrame_1k
  Tick newest_input_ = 0;      ///< of TickInput: a hole in these cannot be run again
  std::int64_t start_ns_ = 0;  ///< source time of the first sample
  std::uint64_t gone_ = 0;
};

}  // namespace tenon
