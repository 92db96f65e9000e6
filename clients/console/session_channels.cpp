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

constexpr std::string_view kFrames = "/tf";
constexpr std::uint32_t kMostLives = 0x3fffffff;  // told: pages read it as a number
constexpr std::string_view kModels = "/scene";
constexpr std::string_view kLogLines = "/log";
constexpr std::string_view kConsole = "/console";
constexpr std::string_view kWorld = "world";
constexpr std::string_view kTarget = "target";  ///< entity: the ghost of the part to be mounted
constexpr std::uint64_t kTargetInstance = 1ULL << 32U;

constexpr std::array kForwarded{
    wire::kSceneObject.name,    wire::kSceneHand.name,       wire::kSceneStep.name,
    wire::kObjectSnapshot.name, wire::kWorldFrame30.name,    wire::kWorldFrame100.name,
    wire::kHandState100.name,   wire::kContactPairs100.name, wire::kTickStats100.name,
    wire::kTelemetry.name,      wire::kStepState.name,       wire::kStepProgress.name,
    wire::kRunState.name,       wire::kGrabState.name,       wire::kPresence.name,
    wire::kRecorderStatus.name, wire::kEmergencyStop.name,   wire::kEmergencyClear.name,
    wire::kEventLog.name,       wire::kClientEvent.name};

Delivery deliveryOf(std::string_view topic) {
  const bool is_event = topic == wire::kEventLog.name || topic == wire::kClientEvent.name;
  return is_event ? Delivery::kEach : Delivery::kNewest;
}

std::string_view stateName(LinkState state) {
  constexpr std::array<std::string_view, 5> kNames{"searching", "joined", "refused", "lost", "ended"};
  return kNames[static_cast<std::size_t>(state)];
}

/// The first level of each object in the list of a scene's display models.
std::vector<std::string> firstLevels(const std::vector<std::uint8_t>& list) {
  std::vector<std::string> models;
  const nlohmann::json json = nlohmann::json::parse(list, nullptr, false);
  if (!json.is_object() || !json.contains("objects")) return models;
  for (const nlohmann::json& levels : json["objects"]) {
    const bool has_model = levels.is_array() && !levels.empty() && levels[0].is_object() &&
                           levels[0].contains("model") && levels[0]["model"].is_string();
    models.push_back(has_model ? levels[0]["model"].get<std::string>() : std::string());
  }
  return models;
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

SessionChannels::SessionChannels(wire::AssetStore assets) : assets_(std::move(assets)) {
  const auto add = [this](std::string_view topic, std::string encoding, std::string_view schema_name,
                          std::string schema, std::string schema_encoding, Delivery delivery) {
    const auto id = static_cast<ChannelId>(channels_.size() + 1);
    channels_.push_back({id, std::string(topic), std::move(encoding), std::string(schema_name),
                         std::move(schema), std::move(schema_encoding), delivery});
    ids_.emplace(topic, id);
  };
  const auto addType = [&](std::string_view topic, const MessageType& type, Delivery delivery) {
    add(topic, "cdr", type.name, type.schema, "omgidl", delivery);
  };
  addType(kFrames, frameTransformsType(), Delivery::kNewest);
  addType(kModels, sceneUpdateType(), Delivery::kNewest);
  addType(kLogLines, logType(), Delivery::kEach);
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
  models_.clear();
  if (const auto list = assets_.get(announce.scene_hash)) models_ = firstLevels(*list);
  parts_.clear();
  X_WH_.clear();
  moved_ns_ = 0;
  is_over_ = false;
  ++lives_;
  published_.push_back({});  // channel 0: all that was published before is forgotten
  publish(kModels, kTargetInstance, now_ns, encodeDeletion({}, now_ns));
}

void SessionChannels::setState(LinkState state, const std::string& reason, std::int64_t now_ns) {
  const nlohmann::json json{{"state", stateName(state)},     {"reason", reason},
                            {"life", lives_ & kMostLives},   {"session", announce_.session},
                            {"title", announce_.title},      {"lockstep", announce_.lockstep},
                            {"scene", announce_.scene_hash}, {"protocol", kProtocolVersion}};
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
    publish(kLogLines, instance, sample.source_ns, encodeLog(event, sample.source_ns), sample.writer);
  } else if (decodeIf(sample, wire::kClientEvent, told) != nullptr) {
    instance = kindOf(told.kind, told.client.value);
  }
  publish(sample.topic, instance, sample.source_ns, {sample.bytes.begin(), sample.bytes.end()},
          sample.writer);

  SceneObject object;
  ObjectSnapshot snapshot;
  WorldFrame frame;
  HandState hand;
  StepState step;
  RunState run;
  if (decodeIf(sample, wire::kSceneObject, object) != nullptr) {
    parts_[object.object.value].object = object;
    showOrHide(object.object.value, sample.source_ns);
  } else if (decodeIf(sample, wire::kObjectSnapshot, snapshot) != nullptr) {
    receiveState(snapshot.state, sample.source_ns);
  } else if (decodeIf(sample, wire::kWorldFrame30, frame) != nullptr) {
    for (const ObjectState& state : frame.states) receiveState(state, sample.source_ns);
  } else if (decodeIf(sample, wire::kHandState100, hand) != nullptr) {
    X_WH_[hand.hand.value] = hand.X_WH;  // goes with the next poses of objects
  } else if (decodeIf(sample, wire::kStepState, step) != nullptr) {
    receiveStep(step, sample.source_ns);
  } else if (decodeIf(sample, wire::kRunState, run) != nullptr) {
    is_over_ = tenon::isOver(run.phase);
  }
}

void SessionChannels::receiveState(const ObjectState& state, std::int64_t time_ns) {
  Part& part = parts_[state.object.value];
  part.state = state;
  part.is_placed = true;
  moved_ns_ = std::max(moved_ns_, time_ns);
  showOrHide(state.object.value, time_ns);
}

/// Publishes or removes the entity of an object when it appears or disappears.
void SessionChannels::showOrHide(std::uint32_t id, std::int64_t time_ns) {
  Part& part = parts_[id];
  const bool is_known = !part.object.name.empty();
  const bool is_hidden = part.state.status == static_cast<std::uint8_t>(ObjectStatus::kHidden);
  const bool shows = is_known && part.is_placed && !is_hidden;
  if (shows == part.is_shown) return;
  part.is_shown = shows;
  if (!shows) {
    publish(kModels, id, time_ns, encodeDeletion(part.object.name, time_ns));
    return;
  }
  auto model = modelOf(ObjectId{id});
  const bool own_colors = hasColors(model);
  publish(kModels, id, time_ns,
          encodeEntity({.id = part.object.name,
                        .frame = part.object.name,
                        .X_FE = {},
                        .color = colorOf(part.object.color),
                        .glb = std::move(model),
                        .own_colors = own_colors,
                        .size = part.object.size,
                        .centre = part.object.centre},
                       time_ns));
}

void SessionChannels::receiveStep(const StepState& step, std::int64_t time_ns) {
  const auto part = parts_.find(step.object.value);
  const bool is_active = step.phase == StepPhase::kActive || step.phase == StepPhase::kWaiting;
  if (!step.has_target || !is_active || part == parts_.end()) {
    publish(kModels, kTargetInstance, time_ns, encodeDeletion(kTarget, time_ns));
    return;
  }
  publish(kModels, kTargetInstance, time_ns,
          encodeEntity({.id = std::string(kTarget),
                        .frame = std::string(kWorld),
                        .X_FE = step.X_WG,
                        .color = {0.0, 0.62, 0.45, 0.35},
                        .glb = modelOf(step.object),
                        .size = part->second.object.size,
                        .centre = part->second.object.centre},
                       time_ns));
}

std::vector<std::uint8_t> SessionChannels::modelOf(ObjectId id) const {
  if (id.value >= models_.size() || models_[id.value].empty()) return {};
  auto model = assets_.get(models_[id.value]);
  return model ? std::move(*model) : std::vector<std::uint8_t>();
}

std::vector<Publication> SessionChannels::take() {
  // all frames in each message: viewers may get the newest one alone
  if (moved_ns_ != 0) {
    std::vector<FrameTransform> transforms;
    for (const auto& [id, part] : parts_)
      if (part.is_placed && !part.object.name.empty())
        transforms.push_back({std::string(kWorld), part.object.name, part.state.X_WO});
    for (const auto& [id, X_WH] : X_WH_)
      transforms.push_back({std::string(kWorld), fmt::format("hand_{}", id), X_WH});
    publish(kFrames, 0, moved_ns_, encodeFrameTransforms(transforms, moved_ns_));
    moved_ns_ = 0;
  }
  return std::exchange(published_, {});
}

}  // namespace tenon::console
