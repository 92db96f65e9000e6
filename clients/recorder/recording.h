#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "idl/record/mcap_writer.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/result.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::recorder {

/// The recording of one session while it is written: samples in the order of arrival.
///
/// Log times are session time, so that a file plays back at the pace of the session. In a real-time session
/// that is the sample's source time. A lockstep session runs as fast as its machines allow: there it is the
/// source time of the first sample plus one millisecond per tick of the newest WorldFrame_1k.
///
/// Threads: one at a time. Real-time: no.
class Recording {
 public:
  /// Fails with a sentence when the file cannot be written.
  [[nodiscard]] static Result<Recording> open(const std::filesystem::path& file,
                                              const SessionAnnounce& session);

  /// Writes one sample, or the end of its instance; a failure shows in status().
  void add(const wire::RawSample& sample);
  /// Writes outcome and summary; the recording is complete after that. Fails with the first problem there
  /// was.
  [[nodiscard]] Result<void> close();

  /// As published. Once the file cannot be written `recording` is false and `problem` says why.
  [[nodiscard]] const RecorderStatus& status() const { return status_; }
  [[nodiscard]] bool runIsOver() const;
  /// The newest one recorded.
  [[nodiscard]] const std::optional<RunState>& run() const { return run_; }

 private:
  Recording(record::McapWriter writer, const SessionAnnounce& session);
  [[nodiscard]] std::uint16_t channelOf(std::string_view topic, std::string_view type,
                                        std::string_view schema);
  void write(std::uint16_t channel, std::int64_t source_ns, std::uint64_t sequence,
             std::span<const std::uint8_t> bytes);
  /// Keeps the newest tick and run state, and counts missing inputs.
  void follow(const wire::RawSample& sample);
  /// [ns] since 1970.
  [[nodiscard]] std::int64_t logTime(std::int64_t source_ns);
  void keepProblem(const Result<void>& done);

  record::McapWriter writer_;
  SessionAnnounce session_;
  std::map<std::string, std::uint16_t, std::less<>> channels_;
  RecorderStatus status_;
  std::optional<RunState> run_;
  Tick newest_tick_ = 0;       ///< of WorldFrame_1k
  Tick newest_input_ = 0;      ///< of TickInput: a gap in these prevents re-simulation
  std::int64_t start_ns_ = 0;  ///< source time of the first sample
  std::uint64_t ended_ = 0;    ///< ended instances written
};

}  // namespace tenon::recorder
