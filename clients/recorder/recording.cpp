#include "clients/recorder/recording.h"

#include <algorithm>
#include <chrono>
#include <concepts>
#include <iterator>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "idl/record/instance_state.h"
#include "idl/types/messages.h"
#include "idl/types/names.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon::recorder {
namespace {

constexpr std::int64_t kNanosecondsPerTick = 1'000'000;
constexpr std::chrono::seconds kChunkAge{1};
constexpr Tick kMostAhead = 1000;  // [ticks] of a hand, of the newest frame

// of complete types alone: this file includes all messages
template <class M>
concept HasTick = requires(const M& message) {
  Tick{message.tick};
};
template <class M>
concept HasEpoch = requires(const M& message) {
  message.server_epoch;
};

}  // namespace

Result<Recording> Recording::open(const std::filesystem::path& file, const SessionAnnounce& session,
                                  Streams streams, const wire::AssetStore& models) {
  auto writer = record::McapWriter::open(file, {.chunk_age = kChunkAge});
  if (!writer) return fail(writer.error().what);
  const auto added =
      writer->addMetadata("tenon recording", {{"session", session.session},
                                              {"title", session.title},
                                              {"protocol", std::to_string(session.protocol_version)},
                                              {"scenario", session.scenario},
                                              {"scenario hash", session.scenario_hash},
                                              {"detail", fmt::format("{}", session.detail)},
                                              {"freeze after ticks", std::to_string(session.freeze_ticks)},
                                              {"park after ticks", std::to_string(session.park_ticks)},
                                              {"lockstep", session.lockstep ? "yes" : "no"}});
  if (!added) return fail(added.error().what);
  Recording recording(std::move(*writer), session, streams, models);
  recording.status_.file = file.string();
  recording.status_.recording = true;

  recording.writeAnnounce(session);
  return recording;
}

/// The announcement belongs to the lobby's partition; it is kept because it names session and title.
void Recording::writeAnnounce(const SessionAnnounce& session) {
  const auto bytes = wire::encode(session);
  if (!bytes) return keepProblem(fail(bytes.error().what));
  const std::int64_t now = std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
  add({wire::kSessionAnnounce.name, wire::typeName<SessionAnnounce>(), now, 0, false, *bytes});
}

bool Recording::continues(const SessionAnnounce& session) const {
  constexpr Tick kMostLost = 1000;  // [ticks] more than a kill loses
  const Tick newest = std::max(newest_tick_, newest_input_.tick);
  // a server that begins anew continues nothing, one that was killed before its first tick begins with that
  const Tick tick = session.resumed_after;
  const bool follows = tick > 0 ? tick + kMostLost >= newest : newest == 0;
  return session.scenario_hash == session_.scenario_hash && session.lockstep == session_.lockstep && follows;
}

Tick Recording::recordedUntil(const SessionAnnounce& session) const {
  // of the newest one parts may be missing
  const Tick until = newest_input_.tick == 0 ? 0 : newest_input_.tick - 1;
  return session.server_epoch == session_.server_epoch ? until : std::min(until, session.resumed_after);
}

void Recording::resumed(const SessionAnnounce& session) {
  const Tick tick = session.resumed_after;
  finishReduction();
  session_ = session;
  ++life_;
  newest_event_ = 0;
  stated_until_ = std::min(stated_until_, tick);
  // ticks of the former life that are not in its journal are computed once more
  const PartNumber last{tick, std::numeric_limits<std::uint32_t>::max()};
  newest_input_ = std::min(newest_input_, last);
  input_ranges_.erase(input_ranges_.upper_bound(tick), input_ranges_.end());
  if (!input_ranges_.empty()) {
    Tick& newest = std::prev(input_ranges_.end())->second;
    newest = std::min(newest, tick);
  }
  for (auto& [part, newest] : newest_checkpoint_) newest = std::min(newest, tick);
  keepProblem(writer_.addMetadata("tenon resumed", {{"after tick", std::to_string(tick)},
                                                    {"server epoch", std::to_string(session.server_epoch)}}));
  writeAnnounce(session);
}

Recording::Recording(record::McapWriter writer, const SessionAnnounce& session, Streams streams,
                     const wire::AssetStore& models)
    : writer_(std::move(writer)), streams_(streams), view_(models), session_(session) {
  view_.begin(session);
}

void Recording::add(const wire::RawSample& sample) {
  if (start_ns_ == 0) start_ns_ = sample.source_ns;
  if (sample.gone) {
    const auto bytes =
        record::encodeInstanceGone({std::string(sample.topic), {sample.bytes.begin(), sample.bytes.end()}});
    write(channelOf(record::kInstanceStateTopic, record::kInstanceStateType, record::kInstanceStateIdl),
          logTime(sample.source_ns, 0), ended_++, bytes);
    return;
  }
  const std::optional<Tick> tick = follow(sample);
  const bool is_omitted = streams_ == Streams::kReduced && StreamReduction::isOmitted(sample.topic);
  if (tick && !is_omitted) writeSample(sample, *tick);
  if (tick) writeView(sample, *tick);
}

void Recording::writeView(const wire::RawSample& sample, Tick tick) {
  wire::RawSample shown = sample;
  // what the server keeps for late joiners has times of before
  shown.source_ns = std::max(logTime(sample.source_ns, tick), start_ns_);
  shown_ns_ = std::max(shown_ns_, shown.source_ns);
  for (const foxglove::DisplayMessage& message : view_.receive(shown)) writeView(message);
  if (sample.topic != wire::kWorldFrame30.name) return;
  if (const auto frames = view_.frames()) writeView(*frames);
}

void Recording::writeView(const foxglove::DisplayMessage& message) {
  const auto add = [&](std::string_view topic, const foxglove::MessageType& type) {
    write(channelOf(topic, type.name, type.schema), message.time_ns, 0, message.bytes);
  };
  if (message.topic == foxglove::kLogLines) return add(message.topic, foxglove::logType());
  if (message.topic == foxglove::kFrames) return add(message.topic, foxglove::frameTransformsType());
  add(message.instance == foxglove::kTargetInstance ? fmt::format("/{}", foxglove::kTarget)
                                                    : fmt::format("{}/{}", foxglove::kModels, message.entity),
      foxglove::sceneUpdateType());
}

void Recording::showModels() {
  for (const foxglove::DisplayMessage& message : view_.showModels(shown_ns_)) writeView(message);
}

void Recording::writeSample(const wire::RawSample& sample, Tick tick) {
  const bool is_packed = sample.type == record::kPackedInputsType;
  write(channelOf(sample.topic, sample.type, is_packed ? record::kPackedInputsIdl : wire::idlText()),
        logTime(sample.source_ns, tick), sample.sequence, sample.bytes);
}

void Recording::finishReduction() {
  reduction_.finish([this](const wire::RawSample& sample, Tick tick) { writeSample(sample, tick); });
}

template <class M>
bool Recording::keeps(const M& message, const wire::RawSample& sample) {
  if (streams_ == Streams::kAll) return true;
  if constexpr (std::same_as<M, HandManifold> || std::same_as<M, TickInputPart>)
    return reduction_.keeps(message, sample,
                            [this](const wire::RawSample& kept, Tick tick) { writeSample(kept, tick); });
  if constexpr (std::same_as<M, CheckpointPart>) return reduction_.keeps(message);
  return true;
}

std::optional<Tick> Recording::follow(const wire::RawSample& sample) {
  std::optional<Tick> tick = 0;
  wire::forEachTopic([&]<class M>(const wire::Topic<M>& topic) {
    if (sample.topic != topic.name) return;
    if constexpr (HasTick<M> || std::same_as<M, PublishedSamples> || std::same_as<M, HandState>) {
      auto message = wire::decode<M>(sample.bytes);
      if (!message) return;
      if constexpr (HasEpoch<M>)
        if (message->server_epoch != session_.server_epoch) return;
      if constexpr (requires { isNew(*message); })
        if (!isNew(*message)) return tick.reset();
      if constexpr (HasTick<M>) {
        tick = message->tick;
        ++recorded_[std::string(topic.name)][periodOf(*tick)];
      }
      if constexpr (std::same_as<M, HandState>)
        // the input of each tick has its number; what is far off is not of this session
        if (session_.lockstep) tick = std::min<Tick>(message->seq, newest_tick_ + kMostAhead);
      if constexpr (std::same_as<M, WorldFrame> || std::same_as<M, HandManifold>)
        if (*tick > 0) first_tick_ = first_tick_ == 0 ? *tick : std::min(first_tick_, *tick);
      if constexpr (std::same_as<M, WorldFrame>) newest_tick_ = std::max(newest_tick_, *tick);
      if constexpr (std::same_as<M, TickInputPart>) count(*message);
      if (!keeps(*message, sample)) tick.reset();
      if constexpr (std::same_as<M, RunState>) run_ = std::move(*message);
      if constexpr (std::same_as<M, PublishedSamples>) keep(*message);
    }
  });
  return tick;
}

void Recording::keep(const PublishedSamples& published) {
  stated_until_ = std::max(stated_until_, published.last_tick);
  // of a period in which this recorder joined a part is not expected
  if (published.last_tick > heardAfter() && (life_ > 0 || published.first_tick > heardAfter()))
    published_[periodOf(published.first_tick)] = published;
}

Recording::Period Recording::periodOf(Tick tick) const {
  return {life_, tick == 0 ? 0 : (tick - 1) / kPublishedSamplesPeriod + 1};
}

/// Frames and manifolds may arrive before the answer that says when this recorder joined.
Tick Recording::heardAfter() const { return first_tick_ == 0 ? joined_ : std::min(joined_, first_tick_ - 1); }

bool Recording::isNew(const TickInputPart& part) {
  const PartNumber number{part.tick, part.part};
  return number > std::exchange(newest_input_, std::max(newest_input_, number));
}
bool Recording::isNew(const CheckpointPart& part) {
  Tick& newest = newest_checkpoint_[part.part];
  return part.tick > std::exchange(newest, std::max(newest, part.tick));
}
bool Recording::isNew(const EventLog& event) {
  return event.seq > std::exchange(newest_event_, std::max(newest_event_, event.seq));
}

bool Recording::isNew(const PublishedSamples& published) { return published.last_tick > stated_until_; }

void Recording::count(const TickInputPart& input) {
  if (first_input_ == 0) first_input_ = input.tick;
  input_parts_ = input.part == 0 ? 1 : input.tick == parts_of_ ? input_parts_ + 1 : 0;
  parts_of_ = input.tick;
  if (input_parts_ != std::max(1U, input.parts)) return;
  const auto newest = input_ranges_.empty() ? input_ranges_.end() : std::prev(input_ranges_.end());
  if (newest != input_ranges_.end() && newest->second + 1 == input.tick) {
    newest->second = input.tick;
  } else {
    input_ranges_[input.tick] = input.tick;
  }
}

/// In ticks. Without a run state that says where the run ended, up to the newest one received; a server that
/// publishes no inputs publishes 0 of them.
TopicCount Recording::inputCount() const {
  // of the newest one parts may be on their way
  const bool is_whole =
      !input_ranges_.empty() && std::prev(input_ranges_.end())->second == newest_input_.tick;
  const Tick newest = newest_input_.tick == 0 || is_whole ? newest_input_.tick : newest_input_.tick - 1;
  const Tick end = runIsOver() ? std::max(newest_input_.tick, run_->tick) : newest;
  const Tick before = first_input_ == 0 ? end : std::min(heardAfter(), first_input_ - 1);
  TopicCount count{std::string(wire::kTickInput.name), 0, end - before};
  for (const auto& [first, last] : input_ranges_)
    if (last > before) count.recorded += last - std::max(first, before + 1) + 1;
  return count;
}

/// Periods follow each other without a gap, so those between two statements were stated, too. What a resumed
/// server stated before this recorder was back cannot be known.
TopicCount Recording::statementCount() const {
  TopicCount count{std::string(wire::kPublishedSamples.name), 0, 0};
  std::optional<Period> before;
  for (const auto& [period, published] : published_) {
    if (period.life == 0 && published.first_tick <= heardAfter()) continue;
    const Tick begin = (heardAfter() + kPublishedSamplesPeriod - 1) / kPublishedSamplesPeriod;
    const Tick last = before && before->life == period.life ? before->number
                      : period.life == 0                    ? begin
                                                            : period.number - 1;
    count.published += period.number - std::min(last, period.number - 1);
    ++count.recorded;
    before = period;
  }
  return count;
}

std::vector<TopicCount> Recording::counts() const {
  std::vector<TopicCount> all;
  std::map<std::string, TopicCount> by_topic;
  for (const auto& [period, published] : published_) {
    // of before this recorder joined: what late joiners get came before it was known when that was
    if (period.life == 0 && published.first_tick <= heardAfter()) continue;
    for (const TopicSamples& topic : published.topics) {
      if (streams_ == Streams::kReduced && StreamReduction::isOmitted(topic.topic)) continue;
      static const std::map<Period, std::uint64_t> kNone;
      const auto found = recorded_.find(topic.topic);
      const auto& recorded = found == recorded_.end() ? kNone : found->second;
      // samples of a period come before those of a later one
      if (!runIsOver() && recorded.upper_bound(period) == recorded.end()) continue;
      const auto in_period = recorded.find(period);
      TopicCount& count = by_topic[topic.topic];
      count.recorded += in_period == recorded.end() ? 0 : std::min(in_period->second, topic.samples);
      count.published += topic.samples;
    }
  }
  by_topic[std::string(wire::kTickInput.name)] = inputCount();
  by_topic[std::string(wire::kPublishedSamples.name)] = statementCount();
  for (auto& [topic, count] : by_topic) {
    count.topic = topic;
    if (count.published > 0) all.push_back(count);
  }
  return all;
}

RecorderStatus Recording::status() const {
  RecorderStatus status = status_;
  for (const TopicCount& count : counts()) status.lost += count.published - count.recorded;
  return status;
}

bool Recording::hasStatement() const { return runIsOver() && stated_until_ >= run_->tick; }

std::int64_t Recording::logTime(std::int64_t source_ns, Tick tick) const {
  if (tick == 0) tick = newest_tick_;
  if (!session_.lockstep || tick == 0) return source_ns;
  return start_ns_ + static_cast<std::int64_t>(tick) * kNanosecondsPerTick;
}

std::uint16_t Recording::channelOf(std::string_view topic, std::string_view type, std::string_view schema) {
  const auto known = channels_.find(topic);
  if (known != channels_.end()) return known->second;
  const std::uint16_t channel = writer_.addChannel(topic, type, schema);
  channels_.emplace(topic, channel);
  return channel;
}

void Recording::write(std::uint16_t channel, std::int64_t log_time_ns, std::uint64_t sequence,
                      std::span<const std::uint8_t> bytes) {
  if (!status_.recording) return;
  keepProblem(writer_.write(channel, log_time_ns, static_cast<std::uint32_t>(sequence), bytes));
  status_.messages = writer_.messages();
}

void Recording::keepProblem(const Result<void>& done) {
  if (done) return;
  status_.recording = false;
  status_.problem = done.error().what;
}

bool Recording::runIsOver() const { return run_ && isOver(run_->phase); }

Result<void> Recording::close() {
  finishReduction();
  const bool was_whole = status_.problem.empty();
  if (run_ && was_whole) {
    keepProblem(
        writer_.addMetadata("tenon outcome", {{"outcome", std::string(runPhaseName(run_->phase))},
                                              {"reason", run_->reason},
                                              {"tick", std::to_string(run_->tick)},
                                              {"final hash", fmt::format("{:016x}", run_->final_hash)}}));
  }
  std::map<std::string, std::string> samples;
  for (const TopicCount& count : counts())
    samples[count.topic] = fmt::format("{} of {}", count.recorded, count.published);
  if (const auto names = boxes(); was_whole && !names.empty())
    keepProblem(
        writer_.addMetadata("tenon models", {{"missing", fmt::format("{}", fmt::join(names, ", "))}}));
  if (was_whole && !samples.empty()) keepProblem(writer_.addMetadata("tenon samples", samples));
  const auto closed = writer_.close();
  if (was_whole) keepProblem(closed);
  status_.recording = false;
  if (!status_.problem.empty()) return fail(status_.problem);
  return {};
}

}  // namespace tenon::recorder
