#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/record/mcap_writer.h"
#include "idl/types/messages/journal.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/result.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::recorder {

/// Samples of a topic, in the ticks for which the server has stated what it published.
struct TopicCount {
  std::string topic;
  std::uint64_t recorded = 0;  ///< at most `published`: those that are missing are not made up for by others
  std::uint64_t published = 0;
};

/// The recording of one session while it is written: samples in the order of arrival.
///
/// Log times are session time, so that a file plays back at the pace of the session. In a real-time session
/// that is the sample's source time. A lockstep session runs as fast as its machines allow: there it is the
/// source time of the first sample plus one millisecond per tick of the sample; one without a tick has that
/// of the newest WorldFrame_1k.
///
/// Threads: one at a time. Real-time: no.
class Recording {
 public:
  /// Fails with a sentence when the file cannot be written.
  [[nodiscard]] static Result<Recording> open(const std::filesystem::path& file,
                                              const SessionAnnounce& session);

  /// From the tick after `tick` on, every sample of the server is expected.
  void joined(Tick tick) { joined_ = tick; }
  /// Whether a server that announces `session` continues, after `tick`, with what is recorded here.
  [[nodiscard]] bool continues(const SessionAnnounce& session, Tick tick) const;
  /// It does: notes in the file that a new life of the server begins, and expects its samples from now on.
  /// To be called before samples of that life are added.
  void resumed(const SessionAnnounce& session, Tick tick);
  /// Writes one sample, or the end of its instance; a failure shows in status(). Omits what of the journal
  /// and of the server's events is there already: a late joiner gets the last ones again.
  void add(const wire::RawSample& sample);
  /// Writes outcome and summary; the recording is complete after that. Fails with the first problem there
  /// was.
  [[nodiscard]] Result<void> close();

  /// As published. Once the file cannot be written `recording` is false and `problem` says why.
  [[nodiscard]] RecorderStatus status() const;
  [[nodiscard]] const std::string& problem() const { return status_.problem; }
  /// What was recorded and what was published, by topic, since joined(): in periods that the server has
  /// stated, of which no further samples are expected.
  [[nodiscard]] std::vector<TopicCount> counts() const;
  /// Whether the run is over and the server has stated what it published up to its end.
  [[nodiscard]] bool hasStatement() const;
  [[nodiscard]] bool runIsOver() const;
  /// The newest one recorded.
  [[nodiscard]] const std::optional<RunState>& run() const { return run_; }

 private:
  Recording(record::McapWriter writer, const SessionAnnounce& session);
  [[nodiscard]] std::uint16_t channelOf(std::string_view topic, std::string_view type,
                                        std::string_view schema);
  void writeAnnounce(const SessionAnnounce& session);
  void write(std::uint16_t channel, std::int64_t log_time_ns, std::uint64_t sequence,
             std::span<const std::uint8_t> bytes);
  /// Keeps the newest tick, the run state and the counts. The tick of the sample, 0 when it has none; none:
  /// it is recorded already.
  std::optional<Tick> follow(const wire::RawSample& sample);
  void count(const TickInputPart& input);
  [[nodiscard]] bool isNew(const TickInputPart& part);
  [[nodiscard]] bool isNew(const CheckpointPart& part);
  [[nodiscard]] bool isNew(const EventLog& event);
  void keep(const PublishedSamples& published);
  /// [ns] since 1970, of a sample of `tick`; 0: it has none.
  [[nodiscard]] std::int64_t logTime(std::int64_t source_ns, Tick tick) const;
  /// The tick after which samples of the server are expected.
  [[nodiscard]] Tick heardAfter() const;
  [[nodiscard]] TopicCount inputCount() const;
  void keepProblem(const Result<void>& done);

  /// Parts of the journal come in this order.
  struct PartNumber {
    Tick tick = 0;
    std::uint32_t part = 0;
    auto operator<=>(const PartNumber&) const = default;
  };
  record::McapWriter writer_;
  SessionAnnounce session_;
  std::map<std::string, std::uint16_t, std::less<>> channels_;
  RecorderStatus status_;
  std::optional<RunState> run_;
  Tick first_tick_ = 0, newest_tick_ = 0;  ///< of WorldFrame_1k
  Tick joined_ = 0;
  Tick resumed_after_ = 0;  ///< of the newest life of the server
  std::map<std::string, std::map<Tick, std::uint64_t>, std::less<>> recorded_;  ///< samples by topic, period
  std::map<Tick, PublishedSamples> published_;                                  ///< by period
  Tick stated_until_ = 0;
  // TickInput: a gap in its ticks prevents re-simulation
  Tick first_input_ = 0;
  PartNumber newest_input_;
  std::map<std::uint32_t, Tick> newest_checkpoint_;  ///< by part, the order in which DDS delivers them
  std::uint64_t newest_event_ = 0;                   ///< EventLog::seq of this life of the server
  std::uint64_t input_ticks_ = 0, input_parts_ = 0, input_parts_expected_ = 0;
  std::int64_t start_ns_ = 0;  ///< source time of the first sample
  std::uint64_t ended_ = 0;    ///< ended instances written
};

}  // namespace tenon::recorder
