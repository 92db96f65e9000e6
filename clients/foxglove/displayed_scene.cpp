#include "clients/foxglove/displayed_scene.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "idl/wire/codec.h"

namespace tenon::foxglove {

namespace {

constexpr std::string_view kWorld = "world";

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

/// Calls `use` with the message, where the sample is one of `topic`.
template <class M, class Use>
bool decodeIf(const wire::RawSample& sample, const wire::Topic<M>& topic, const Use& use) {
  if (sample.topic != topic.name) return false;
  if (const auto decoded = wire::decode<M>(sample.bytes)) use(*decoded);
  return true;
}

}  // namespace

void DisplayedScene::begin(const SessionAnnounce& announce) {
  models_.clear();
  if (const auto list = assets_.get(announce.scene_hash)) models_ = firstLevels(*list);
  parts_.clear();
  X_WH_.clear();
  moved_ns_ = 0;
}

std::vector<DisplayMessage> DisplayedScene::receive(const wire::RawSample& sample) {
  std::vector<DisplayMessage> messages;
  const std::int64_t time_ns = sample.source_ns;
  decodeIf(sample, wire::kEventLog,
           [&](const EventLog& event) {
             messages.push_back({kLogLines, {}, 0, time_ns, encodeLog(event, time_ns)});
           }) ||
      decodeIf(sample, wire::kSceneObject,
               [&](const SceneObject& object) {
                 parts_[object.object.value].object = object;
                 showOrHide(object.object.value, time_ns, messages);
               }) ||
      decodeIf(sample, wire::kObjectSnapshot,
               [&](const ObjectSnapshot& snapshot) { receiveState(snapshot.state, time_ns, messages); }) ||
      decodeIf(sample, wire::kWorldFrame30,
               [&](const WorldFrame& frame) {
                 for (const ObjectState& state : frame.states) receiveState(state, time_ns, messages);
               }) ||
      decodeIf(sample, wire::kHandState100,  // goes with the next poses of objects
               [&](const HandState& hand) { X_WH_[hand.hand.value] = hand.X_WH; }) ||
      decodeIf(sample, wire::kStepState,
               [&](const StepState& step) { receiveStep(step, time_ns, messages); });
  return messages;
}

void DisplayedScene::receiveState(const ObjectState& state, std::int64_t time_ns,
                                  std::vector<DisplayMessage>& messages) {
  Part& part = parts_[state.object.value];
  part.state = state;
  part.is_placed = true;
  moved_ns_ = std::max(moved_ns_, time_ns);
  showOrHide(state.object.value, time_ns, messages);
}

/// Shows or deletes the entity of an object when it appears or disappears.
void DisplayedScene::showOrHide(std::uint32_t id, std::int64_t time_ns,
                                std::vector<DisplayMessage>& messages) {
  Part& part = parts_[id];
  const std::string& name = part.object.name;
  const bool is_hidden = part.state.status == static_cast<std::uint8_t>(ObjectStatus::kHidden);
  const bool shows = !name.empty() && part.is_placed && !is_hidden;
  if (shows == part.is_shown) return;
  part.is_shown = shows;
  if (!shows) {
    messages.push_back({kModels, name, id, time_ns, encodeDeletion(name, time_ns)});
    return;
  }
  auto model = modelOf(ObjectId{id});
  const bool own_colors = hasColors(model);
  messages.push_back({kModels, name, id, time_ns,
                      encodeEntity({.id = name,
                                    .frame = name,
                                    .X_FE = {},
                                    .color = colorOf(part.object.color),
                                    .glb = std::move(model),
                                    .own_colors = own_colors,
                                    .size = part.object.size,
                                    .centre = part.object.centre},
                                   time_ns)});
}

void DisplayedScene::receiveStep(const StepState& step, std::int64_t time_ns,
                                 std::vector<DisplayMessage>& messages) {
  const std::string target(kTarget);
  const auto part = parts_.find(step.object.value);
  const bool is_active = step.phase == StepPhase::kActive || step.phase == StepPhase::kWaiting;
  const bool shows = step.has_target && is_active && part != parts_.end();
  messages.push_back({kModels, target, kTargetInstance, time_ns,
                      !shows ? encodeDeletion(kTarget, time_ns)
                             : encodeEntity({.id = target,
                                             .frame = std::string(kWorld),
                                             .X_FE = step.X_WG,
                                             .color = {0.0, 0.62, 0.45, 0.35},
                                             .glb = modelOf(step.object),
                                             .size = part->second.object.size,
                                             .centre = part->second.object.centre},
                                            time_ns)});
}

std::vector<std::uint8_t> DisplayedScene::modelOf(ObjectId id) const {
  if (id.value >= models_.size() || models_[id.value].empty()) return {};
  auto model = assets_.get(models_[id.value]);
  return model ? std::move(*model) : std::vector<std::uint8_t>();
}

std::optional<DisplayMessage> DisplayedScene::frames() {
  if (moved_ns_ == 0) return std::nullopt;
  std::vector<FrameTransform> transforms;
  for (const auto& [id, part] : parts_)
    if (part.is_placed && !part.object.name.empty())
      transforms.push_back({std::string(kWorld), part.object.name, part.state.X_WO});
  for (const auto& [id, X_WH] : X_WH_)
    transforms.push_back({std::string(kWorld), fmt::format("hand_{}", id), X_WH});
  const std::int64_t time_ns = std::exchange(moved_ns_, 0);
  return DisplayMessage{kFrames, {}, 0, time_ns, encodeFrameTransforms(transforms, time_ns)};
}

}  // namespace tenon::foxglove
