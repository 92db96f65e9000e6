#include "clients/recorder/recording.h"

#include <algorithm>
#include <chrono>
#include <concepts>
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

// of complete types alone: this file includes all messages
template <class M>
concept HasTick = requires(const M& message) {
  Tick{message.tick};
};
template <class M>
concept HasEpoch = requires(const M& message) {
  message.server_epoch;
};

/// Number of the period of PublishedSamples.
Tick periodOf(Tick tick) { return tick == 0 ? 0 : (tick - 1) / kPublishedSamplesPeriod + 1; }
}  // namespace

Result<Recording> Recording::open(const std::filesystem::path& file, const SessionAnnounce& session) {
  auto writer = record::McapWriter::open(file);
  if (!writer) return fail(writer.error().what);
  const auto added =
      writer->addMetadata("tenon recording", {{"session", session.session},
                                              {"title", session.title},
                                              {"protocol", std::to_string(session.protocol_version)},
                                              {"scenario hash", session.scenario_hash},
                                              {"lockstep", session.lockstep ? "yes" : "no"}});
  if (!added) return fail(added.error().what);
  Recording recording(std::move(*writer), session);
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

bool Recording::continues(const SessionAnnounce& session, Tick tick) const {
  constexpr Tick kMostLost = 1000;  // [ticks] more than a kill loses
  return session.scenario_hash == session_.scenario_hash && session.lockstep == session_.lockstep &&
         tick > 0 && tick + kMostLost >= std::max(newest_tick_, newest_input_.tick);
}

void Recording::resumed(const SessionAnnounce& session, Tick tick) {
  session_ = session;
  resumed_after_ = tick;
  newest_event_ = 0;
  // ticks of the former life that are not in its journal are computed once more
  const PartNumber last{tick, std::numeric_limits<std::uint32_t>::max()};
  newest_input_ = std::min(newest_input_, last);
  for (auto& [part, newest] : newest_checkpoint_) newest = std::min(newest, tick);
  keepProblem(writer_.addMetadata("tenon resumed", {{"after tick", std::to_string(tick)},
                                                    {"server epoch", std::to_string(session.server_epoch)}}));
  writeAnnounce(session);
}

Recording::Recording(record::McapWriter writer, const SessionAnnounce& session)
    : writer_(std::move(writer)), session_(session) {}

void Recording::add(const wire::RawSample& sample) {
  if (start_ns_ == 0) start_ns_ = sample.source_ns;
  if (sample.gone) {
    const auto bytes =
        record::encodeInstanceGone({std::string(sample.topic), {sample.bytes.begin(), sample.bytes.end()}});
    write(channelOf(record::kInstanceStateTopic, record::kInstanceStateType, record::kInstanceStateIdl),
          logTime(sample.source_ns, 0), ended_++, bytes);
    return;
  }
  if (const std::optional<Tick> tick = follow(sample))
    write(channelOf(sample.topic, sample.type, wire::idlText()), logTime(sample.source_ns, *tick),
          sample.sequence, sample.bytes);
}

std::optional<Tick> Recording::follow(const wire::RawSample& sample) {
  std::optional<Tick> tick = 0;
  wire::forEachTopic([&]<class M>(const wire::Topic<M>& topic) {
    if (sample.topic != topic.name) return;
    if constexpr (HasTick<M> || std::same_as<M, PublishedSamples>) {
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
      if constexpr (std::same_as<M, WorldFrame>)
        if (topic.name == wire::kWorldFrame1k.name) {
          if (first_tick_ == 0) first_tick_ = *tick;
          newest_tick_ = std::max(newest_tick_, *tick);
        }
      if constexpr (std::same_as<M, TickInputPart>) count(*message);
      if constexpr (std::same_as<M, RunState>) run_ = std::move(*message);
      if constexpr (std::same_as<M, PublishedSamples>) keep(*message);
    }
  });
  return tick;
}

void Recording::keep(const PublishedSamples& published) {
  stated_until_ = std::max(stated_until_, published.last_tick);
  // of a period in which this recorder joined, or came back, a part is not expected
  if (published.first_tick > std::max(heardAfter(), resumed_after_))
    published_[periodOf(published.first_tick)] = published;
}

/// Frames may arrive before the answer that says when this recorder joined.
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

void Recording::count(const TickInputPart& input) {
  ++input_parts_;
  if (input.part != 0) return;
  if (first_input_ == 0) first_input_ = input.tick;
  ++input_ticks_;
  input_parts_expected_ += input.parts;
}

/// In ticks. Without a run state that says where the run ended, up to the newest one received; a server that
/// publishes no inputs publishes 0 of them.
TopicCount Recording::inputCount() const {
  const Tick end = std::max(newest_input_.tick, runIsOver() ? run_->tick : 0);
  const Tick before = first_input_ == 0 ? end : std::min(heardAfter(), first_input_ - 1);
  TopicCount count{std::string(wire::kTickInput.name), std::min(input_ticks_, end - before), end - before};
  const std::uint64_t parts = std::min(input_parts_, input_parts_expected_);
  count.recorded -= std::min(count.recorded, input_parts_expected_ - parts);
  return count;
}

std::vector<TopicCount> Recording::counts() const {
  std::vector<TopicCount> all;
  std::map<std::string, TopicCount> by_topic;
  for (const auto& [period, published] : published_) {
    for (const TopicSamples& topic : published.topics) {
      static const std::map<Tick, std::uint64_t> kNone;
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
  if (was_whole && !samples.empty()) keepProblem(writer_.addMetadata("tenon samples", samples));
  const auto closed = writer_.close();
  if (was_whole) keepProblem(closed);
  status_.recording = false;
  if (!status_.problem.empty()) return fail(status_.problem);
  return {};
}

}  // namespace tenon::recorder
