#include "clients/console/session_channels.h"

#include <algorithm>
#include <array>
#include <functional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "idl/record/instance_state.h"
#include "idl/wire/codec.h"

namespace tenon::console {

namespace {

constexpr std::uint32_t kMostLives = 0x3fffffff;  // told: pages read it as a number
constexpr std::string_view kConsole = "/console";

constexpr std::array kForwarded{
    wire::kSceneObject.name,     wire::kSceneHand.name,      wire::kSceneStep.name,
    wire::kSceneSignal.name,     wire::kSceneTitle.name,     wire::kObjectSnapshot.name,
    wire::kWorldFrame30.name,    wire::kWorldFrame100.name,  wire::kHandState100.name,
    wire::kContactPairs100.name, wire::kTickStats100.name,   wire::kTelemetry.name,
    wire::kStepState.name,       wire::kStepProgress.name,   wire::kRunState.name,
    wire::kGrabState.name,       wire::kPresence.name,       wire::kRecorderStatus.name,
    wire::kEmergencyStop.name,   wire::kEmergencyClear.name, wire::kNewestRaise.name,
    wire::kEventLog.name,        wire::kClientEvent.name};

Delivery deliveryOf(std::string_view topic) {
  const bool is_event = topic == wire::kEventLog.name || topic == wire::kClientEvent.name;
  return is_event ? Delivery::kEach : Delivery::kNewest;
}

std::string_view stateName(LinkState state) {
  constexpr std::array<std::string_view, 5> kNames{"searching", "joined", "refused", "lost", "ended"};
  return kNames[static_cast<std::size_t>(state)];
}

/// Whether a server alone writes a topic: its instances end with it, and what it said last stays.
bool isOfServer(std::string_view name) {
  bool found = false;
  wire::forEachTopic([&]<class M>(const wire::Topic<M>& topic) {
    found = found || (topic.name == name && topic.parameters.of_server);
  });
  return found;
}

/// Equal for events of one kind, and of one client where clients tell them.
std::uint64_t kindOf(const std::string& kind, std::uint32_t client = 0) {
  return std::hash<std::string>{}(kind) ^ (std::uint64_t{client} << 32U);
}

/// A message of type M, where the sample is one of `topic`.
template <class M>
const M* decodeIf(const wire::RawSample& sample, const wire::Topic<M>& topic, M& message) {
  if (sample.topic != topic.name || sample.gone) return nullptr;
  auto decoded = wire::decode<M>(sample.bytes);
  if (!decoded) return nullptr;
  message = std::move(*decoded);
  return &message;
}

}  // namespace

std::vector<std::string> SessionChannels::topics() { return {kForwarded.begin(), kForwarded.end()}; }

SessionChannels::SessionChannels(wire::AssetStore assets) : view_(std::move(assets)) {
  const auto add = [this](std::string_view topic, std::string encoding, std::string_view schema_name,
                          std::string schema, std::string schema_encoding, Delivery delivery) {
    const auto id = static_cast<ChannelId>(channels_.size() + 1);
    channels_.push_back({id, std::string(topic), std::move(encoding), std::string(schema_name),
                         std::move(schema), std::move(schema_encoding), delivery});
    ids_.emplace(topic, id);
  };
  const auto addType = [&](std::string_view topic, const foxglove::MessageType& type, Delivery delivery) {
    add(topic, "cdr", type.name, type.schema, "omgidl", delivery);
  };
  addType(foxglove::kFrames, foxglove::frameTransformsType(), Delivery::kNewest);
  addType(foxglove::kModels, foxglove::sceneUpdateType(), Delivery::kNewest);
  addType(foxglove::kLogLines, foxglove::logType(), Delivery::kEach);
  add(kConsole, "json", "tenon.Console", R"({"type":"object"})", "jsonschema", Delivery::kNewest);
  for (const wire::TopicName& name : wire::allTopics())
    if (std::find(kForwarded.begin(), kForwarded.end(), name.topic) != kForwarded.end())
      add(name.topic, "cdr", name.type, std::string(wire::idlText()), "omgidl", deliveryOf(name.topic));
  addType(record::kInstanceStateTopic, {record::kInstanceStateType, std::string(record::kInstanceStateIdl)},
          Delivery::kEach);
}

void SessionChannels::publish(std::string_view topic, std::uint64_t instance, std::int64_t time_ns,
                              std::vector<std::uint8_t> bytes, std::uint64_t writer) {
  published_.push_back({ids_.find(topic)->second, instance, time_ns,
                        std::make_shared<const std::vector<std::uint8_t>>(std::move(bytes)), writer});
}

void SessionChannels::begin(const SessionAnnounce& announce, std::int64_t now_ns) {
  announce_ = announce;
  view_.begin(announce);
  is_over_ = false;
  ++lives_;
  published_.push_back({});  // channel 0: all that was published before is forgotten
  publish(foxglove::kModels, foxglove::kTargetInstance, now_ns, foxglove::encodeDeletion({}, now_ns));
}

void SessionChannels::setState(LinkState state, const std::string& reason, bool is_recorded,
                               std::int64_t now_ns) {
  const nlohmann::json json{{"state", stateName(state)},     {"reason", reason},
                            {"life", lives_ & kMostLives},   {"session", announce_.session},
                            {"title", announce_.title},      {"lockstep", announce_.lockstep},
                            {"scene", announce_.scene_hash}, {"protocol", kProtocolVersion},
                            {"recorded", is_recorded}};
  const std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  publish(kConsole, 0, now_ns, {text.begin(), text.end()});
}

void SessionChannels::receive(const wire::RawSample& sample) {
  const auto channel = ids_.find(sample.topic);
  if (channel == ids_.end()) return;
  if (sample.gone) {
    if (isOfServer(sample.topic)) return;
    published_.push_back({channel->second, sample.instance, sample.source_ns, nullptr, sample.writer});
    publish(
        record::kInstanceStateTopic, 0, sample.source_ns,
        record::encodeInstanceGone({std::string(sample.topic), {sample.bytes.begin(), sample.bytes.end()}}),
        sample.writer);
    return;
  }
  EventLog event;
  ClientEvent told;
  std::uint64_t instance = sample.instance;
  if (decodeIf(sample, wire::kEventLog, event) != nullptr) {
    instance = kindOf(event.kind);
  } else if (decodeIf(sample, wire::kClientEvent, told) != nullptr) {
    instance = kindOf(told.kind, told.client.value);
  }
  for (foxglove::DisplayMessage& message : view_.receive(sample)) {
    const bool is_event = message.topic == foxglove::kLogLines;
    publish(message.topic, is_event ? instance : message.instance, message.time_ns, std::move(message.bytes),
            is_event ? sample.writer : 0);
  }
  publish(sample.topic, instance, sample.source_ns, {sample.bytes.begin(), sample.bytes.end()},
          sample.writer);
  if (RunState run; decodeIf(sample, wire::kRunState, run) != nullptr) is_over_ = tenon::isOver(run.phase);
}

std::vector<Publication> SessionChannels::take() {
  if (auto frames = view_.frames())
    publish(frames->topic, frames->instance, frames->time_ns, std::move(frames->bytes));
  return std::exchange(published_, {});
}

}  // namespace tenon::console
