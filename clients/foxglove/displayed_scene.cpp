#include "clients/foxglove/displayed_scene.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "idl/wire/codec.h"

namespace tenon::foxglove {

namespace {

constexpr std::string_view kWorld = "world";

/// Frame and entity of an object.
std::string frameOf(const std::string& name) { return "object/" + name; }

/// Calls `use` with the message, where the sample is one of `topic`.
template <class M, class Use>
bool decodeIf(const wire::RawSample& sample, const wire::Topic<M>& topic, const Use& use) {
  if (sample.topic != topic.name) return false;
  if (const auto decoded = wire::decode<M>(sample.bytes)) use(*decoded);
  return true;
}

}  // namespace

std::vector<std::string> firstLevels(std::span<const std::uint8_t> list) {
  std::vector<std::string> models;
  const nlohmann::json json = nlohmann::json::parse(list.begin(), list.end(), nullptr, false);
  if (!json.is_object() || !json.contains("objects")) return models;
  for (const nlohmann::json& levels : json["objects"]) {
    const bool has_model = levels.is_array() && !levels.empty() && levels[0].is_object() &&
                           levels[0].contains("model") && levels[0]["model"].is_string();
    models.push_back(has_model ? levels[0]["model"].get<std::string>() : std::string());
  }
  return models;
}

void DisplayedScene::begin(const SessionAnnounce& announce) {
  scene_hash_ = announce.scene_hash;
  readList();
  target_ = {};
  is_target_box_ = false;
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
    messages.push_back({kModels, name, id, time_ns, encodeDeletion(frameOf(name), time_ns)});
    return;
  }
  messages.push_back(objectMessage(id, time_ns, modelOf(ObjectId{id})));
}

DisplayMessage DisplayedScene::objectMessage(std::uint32_t id, std::int64_t time_ns, Model model) {
  Part& part = parts_[id];
  part.is_box = model.is_missing;
  const bool own_colors = hasColors(model.bytes);
  return {kModels, part.object.name, id, time_ns,
          encodeEntity({.id = frameOf(part.object.name),
                        .frame = frameOf(part.object.name),
                        .X_FE = {},
                        .color = colorOf(part.object.color),
                        .glb = std::move(model.bytes),
                        .own_colors = own_colors,
                        .size = part.object.size,
                        .centre = part.object.centre},
                       time_ns)};
}

void DisplayedScene::receiveStep(const StepState& step, std::int64_t time_ns,
                                 std::vector<DisplayMessage>& messages) {
  const bool is_active = step.phase == StepPhase::kActive || step.phase == StepPhase::kWaiting;
  if (step.has_target && is_active && parts_.contains(step.object.value)) {
    target_ = step;
    messages.push_back(targetMessage(time_ns, modelOf(step.object)));
    return;
  }
  is_target_box_ = false;
  messages.push_back(
      {kModels, std::string(kTarget), kTargetInstance, time_ns, encodeDeletion(kTarget, time_ns)});
}

DisplayMessage DisplayedScene::targetMessage(std::int64_t time_ns, Model model) {
  is_target_box_ = model.is_missing;
  const SceneObject& object = parts_[target_.object.value].object;
  return {kModels, std::string(kTarget), kTargetInstance, time_ns,
          encodeEntity({.id = std::string(kTarget),
                        .frame = std::string(kWorld),
                        .X_FE = target_.X_WG,
                        .color = {0.0, 0.62, 0.45, 0.35},
                        .glb = std::move(model.bytes),
                        .size = object.size,
                        .centre = object.centre},
                       time_ns)};
}

void DisplayedScene::readList() {
  const auto list = assets_.get(scene_hash_);
  has_list_ = list.has_value();
  models_ = has_list_ ? firstLevels(*list) : std::vector<std::string>();
}

DisplayedScene::Model DisplayedScene::modelOf(ObjectId id) const {
  if (!has_list_) return {{}, !scene_hash_.empty()};
  if (id.value >= models_.size() || models_[id.value].empty()) return {};
  auto model = assets_.get(models_[id.value]);
  return model ? Model{std::move(*model)} : Model{{}, true};
}

std::vector<DisplayMessage> DisplayedScene::showModels(std::int64_t time_ns) {
  if (!has_list_) readList();
  std::vector<DisplayMessage> messages;
  for (const auto& [id, part] : parts_) {
    if (!part.is_box || !part.is_shown) continue;
    if (Model model = modelOf(ObjectId{id}); !model.is_missing)
      messages.push_back(objectMessage(id, time_ns, std::move(model)));
  }
  if (!is_target_box_) return messages;
  if (Model model = modelOf(target_.object); !model.is_missing)
    messages.push_back(targetMessage(time_ns, std::move(model)));
  return messages;
}

std::vector<std::string> DisplayedScene::boxes() const {
  std::vector<std::string> names;
  for (const auto& [id, part] : parts_)
    if (part.is_box) names.push_back(part.object.name);
  return names;
}

std::optional<DisplayMessage> DisplayedScene::frames() {
  if (moved_ns_ == 0) return std::nullopt;
  std::vector<FrameTransform> transforms;
  for (const auto& [id, part] : parts_)
    if (part.is_placed && !part.object.name.empty())
      transforms.push_back({std::string(kWorld), frameOf(part.object.name), part.state.X_WO});
  for (const auto& [id, X_WH] : X_WH_)
    transforms.push_back({std::string(kWorld), fmt::format("hand_{}", id), X_WH});
  const std::int64_t time_ns = std::exchange(moved_ns_, 0);
  return DisplayMessage{kFrames, {}, 0, time_ns, encodeFrameTransforms(transforms, time_ns)};
}

}  // namespace tenon::foxglove
