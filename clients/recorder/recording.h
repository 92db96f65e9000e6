#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/foxglove/displayed_scene.h"
#include "clients/recorder/stream_reduction.h"
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

enum class Streams {
  kAll,      ///< every sample that the server publishes
  kReduced,  ///< what reports, players and a re-simulation need: StreamReduction
};

/// The recording of one session while it is written: samples in the order of arrival.
///
/// Log times are session time, so that a file plays back at the pace of the session. In a real-time session
/// that is the sample's source time. A lockstep session runs as fast as its machines allow: there it is the
/// source time of the first sample plus one millisecond per tick of the sample; one without a tick has that
/// of the newest WorldFrame.
///
/// Beside the samples it has what public viewers display by themselves (foxglove::DisplayedScene): after a
/// seek a viewer knows the newest message of each channel alone, so each entity has a channel of its own,
/// /scene/NAME, and the target /target. Objects that are boxes at the end for lack of their models are named
/// in the metadata "tenon models".
///
/// Threads: one at a time. Real-time: no.
class Recording {
 public:
  /// `models`: has the display models of the session; what it lacks is shown as a box. Fails with a sentence
  /// when the file cannot be written.
  [[nodiscard]] static Result<Recording> open(const std::filesystem::path& file,
                                              const SessionAnnounce& session, Streams streams = Streams::kAll,
                                              const wire::AssetStore& models = wire::AssetStore({}));

  /// From the tick after `tick` on, every sample of the server is expected.
  void joined(Tick tick) { joined_ = tick; }
  /// Whether a server that announces `session` continues with what is recorded here.
  [[nodiscard]] bool continues(const SessionAnnounce& session) const;
  /// It does: notes in the file that a new life of the server begins, and expects its samples from now on.
  /// To be called before samples of that life are added.
  void resumed(const SessionAnnounce& session);
  /// Join::recorded_until, for the server that announces `session`.
  [[nodiscard]] Tick recordedUntil(const SessionAnnounce& session) const;
  /// Writes one sample, or the end of its instance; a failure shows in status(). Omits what of the journal
  /// and of the server's events is there already: a late joiner gets the last ones again.
  void add(const wire::RawSample& sample);
  /// Writes outcome and summary; the recording is complete after that. Fails with the first problem there
  /// was.
  [[nodiscard]] Result<void> close();

  /// As published. Once the file cannot be written `recording` is false and `problem` says why.
  [[nodiscard]] RecorderStatus status() const;
  [[nodiscard]] const std::string& problem() const { return status_.problem; }
  /// What was recorded and what was published, by topic, since joined(): of inputs all ticks, of the rest
  /// the periods that the server has stated and of which no further samples are expected. A period whose
  /// statement is missing counts as one sample of PublishedSamples. What a resumed server published before
  /// this recorder was back is missing too.
  [[nodiscard]] std::vector<TopicCount> counts() const;
  /// Whether the run is over and the server has stated what it published up to its end.
  [[nodiscard]] bool hasStatement() const;
  /// The store of models has got some: what is shown without its model is shown with it from now on.
  void showModels();
  /// Names of objects that are boxes at last because the store has not their models.
  [[nodiscard]] std::vector<std::string> boxes() const { return view_.boxes(); }
  /// So many samples came before the recorder belonged to their server and could not be kept.
  void lostBefore(std::uint64_t samples) { status_.lost = samples; }
  [[nodiscard]] bool runIsOver() const;
  /// The newest one recorded.
  [[nodiscard]] const std::optional<RunState>& run() const { return run_; }

 private:
  Recording(record::McapWriter writer, const SessionAnnounce& session, Streams streams,
            const wire::AssetStore& models);
  [[nodiscard]] std::uint16_t channelOf(std::string_view topic, std::string_view type,
                                        std::string_view schema);
  void writeAnnounce(const SessionAnnounce& session);
  void write(std::uint16_t channel, std::int64_t log_time_ns, std::uint64_t sequence,
             std::span<const std::uint8_t> bytes);
  void writeSample(const wire::RawSample& sample, Tick tick);
  void writeView(const wire::RawSample& sample, Tick tick);
  void writeView(const foxglove::DisplayMessage& message);
  void finishReduction();
  /// Whether the sample is written as it is.
  template <class M>
  [[nodiscard]] bool keeps(const M& message, const wire::RawSample& sample);
  /// Keeps the newest tick, the run state and the counts. The tick of the sample, 0 when it has none; none:
  /// it is recorded already, or by StreamReduction.
  std::optional<Tick> follow(const wire::RawSample& sample);
  void count(const TickInputPart& input);
  [[nodiscard]] bool isNew(const TickInputPart& part);
  [[nodiscard]] bool isNew(const CheckpointPart& part);
  [[nodiscard]] bool isNew(const EventLog& event);
  [[nodiscard]] bool isNew(const PublishedSamples& published);
  void keep(const PublishedSamples& published);
  /// [ns] since 1970, of a sample of `tick`; 0: it has none.
  [[nodiscard]] std::int64_t logTime(std::int64_t source_ns, Tick tick) const;
  /// The tick after which samples of the server are expected.
  [[nodiscard]] Tick heardAfter() const;
  [[nodiscard]] TopicCount inputCount() const;
  [[nodiscard]] TopicCount statementCount() const;
  void keepProblem(const Result<void>& done);

  /// Parts of the journal come in this order.
  struct PartNumber {
    Tick tick = 0;
    std::uint32_t part = 0;
    auto operator<=>(const PartNumber&) const = default;
  };
  record::McapWriter writer_;
  Streams streams_;
  StreamReduction reduction_;
  foxglove::DisplayedScene view_;
  std::int64_t shown_ns_ = 0;  ///< log time of the newest sample for it
  SessionAnnounce session_;
  std::map<std::string, std::uint16_t, std::less<>> channels_;
  RecorderStatus status_;
  std::optional<RunState> run_;
  Tick first_tick_ = 0;   ///< of WorldFrame and HandManifold
  Tick newest_tick_ = 0;  ///< of WorldFrame
  Tick joined_ = 0;
  /// Of PublishedSamples: a resumed server states what it published of a period that a former one began.
  struct Period {
    std::uint32_t life = 0;  ///< of the server
    Tick number = 0;
    auto operator<=>(const Period&) const = default;
  };
  [[nodiscard]] Period periodOf(Tick tick) const;
  std::uint32_t life_ = 0;
  std::map<std::string, std::map<Period, std::uint64_t>, std::less<>> recorded_;  ///< samples by topic
  std::map<Period, PublishedSamples> published_;
  Tick stated_until_ = 0;
  // TickInput: a gap in its ticks prevents re-simulation
  Tick first_input_ = 0;
  PartNumber newest_input_;
  std::map<std::uint32_t, Tick> newest_checkpoint_;  ///< by part, the order in which DDS delivers them
  std::uint64_t newest_event_ = 0;                   ///< EventLog::seq of this life of the server
  std::uint32_t input_parts_ = 0;                    ///< of the newest tick
  Tick parts_of_ = 0;                                ///< that tick
  std::map<Tick, Tick> input_ranges_;  ///< ticks with all their parts: first and last, without a gap
  std::int64_t start_ns_ = 0;          ///< source time of the first sample
  std::uint64_t ended_ = 0;            ///< ended instances written
};

}  // namespace tenon::recorder
