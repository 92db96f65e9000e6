#include "clients/recorder/recording.h"

#include <chrono>
#include <utility>

#include <fmt/format.h>

#include "idl/record/instance_state.h"
#include "idl/types/messages/journal.h"
#include "idl/types/messages/objects.h"
#include "idl/types/names.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon::recorder {
namespace {

constexpr std::int64_t kNanosecondsPerTick = 1'000'000;
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

  // the announcement belongs to the lobby's partition; it is kept because it names session and title
  const auto bytes = wire::encode(session);
  if (!bytes) return fail(bytes.error().what);
  const std::int64_t now = std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
  recording.add({wire::kSessionAnnounce.name, wire::typeName<SessionAnnounce>(), now, 0, false, *bytes});
  return recording;
}

Recording::Recording(record::McapWriter writer, const SessionAnnounce& session)
    : writer_(std::move(writer)), session_(session) {}

void Recording::add(const wire::RawSample& sample) {
  if (start_ns_ == 0) start_ns_ = sample.source_ns;
  if (sample.gone) {
    const auto bytes =
        record::encodeInstanceGone({std::string(sample.topic), {sample.bytes.begin(), sample.bytes.end()}});
    write(channelOf(record::kInstanceStateTopic, record::kInstanceStateType, record::kInstanceStateIdl),
          sample.source_ns, ended_++, bytes);
    return;
  }
  follow(sample);
  write(channelOf(sample.topic, sample.type, wire::idlText()), sample.source_ns, sample.sequence,
        sample.bytes);
}

void Recording::follow(const wire::RawSample& sample) {
  if (sample.topic == wire::kWorldFrame1k.name) {
    const auto frame = wire::decode<WorldFrame>(sample.bytes);
    if (frame && frame->server_epoch == session_.server_epoch && frame->tick > newest_tick_)
      newest_tick_ = frame->tick;
  } else if (sample.topic == wire::kTickInput.name) {
    const auto input = wire::decode<TickInputPart>(sample.bytes);
    if (!input || input->tick <= newest_input_) return;
    if (newest_input_ != 0) status_.lost += input->tick - newest_input_ - 1;
    newest_input_ = input->tick;
  } else if (sample.topic == wire::kRunState.name) {
    if (auto run = wire::decode<RunState>(sample.bytes)) run_ = std::move(*run);
  }
}

std::int64_t Recording::logTime(std::int64_t source_ns) {
  if (!session_.lockstep || newest_tick_ == 0) return source_ns;
  return start_ns_ + static_cast<std::int64_t>(newest_tick_) * kNanosecondsPerTick;
}

std::uint16_t Recording::channelOf(std::string_view topic, std::string_view type, std::string_view schema) {
  const auto known = channels_.find(topic);
  if (known != channels_.end()) return known->second;
  const std::uint16_t channel = writer_.addChannel(topic, type, schema);
  channels_.emplace(topic, channel);
  return channel;
}

void Recording::write(std::uint16_t channel, std::int64_t source_ns, std::uint64_t sequence,
                      std::span<const std::uint8_t> bytes) {
  if (!status_.recording) return;
  keepProblem(writer_.write(channel, logTime(source_ns), static_cast<std::uint32_t>(sequence), bytes));
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
  const auto closed = writer_.close();
  if (was_whole) keepProblem(closed);
  status_.recording = false;
  if (!status_.problem.empty()) return fail(status_.problem);
  return {};
}

}  // namespace tenon::recorder
