#include "clients/foxglove/displayed_scene.h"

#include <algorithm>
#include <filesystem>
#include <span>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/wire/codec.h"

namespace tenon::foxglove {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::int64_t kTime = 5'000'000'007;

template <class M>
std::vector<std::string> shown(DisplayedScene& scene, const wire::Topic<M>& topic, const M& message) {
  const auto bytes = wire::encode(message);
  std::vector<std::string> all;
  for (const DisplayMessage& one : scene.receive({topic.name, wire::typeName<M>(), kTime, 0, false, *bytes}))
    all.push_back(std::string(one.topic) + " " + one.entity);
  return all;
}

std::span<const std::uint8_t> bytesOf(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

ObjectSnapshot snapshotOf(std::uint32_t id, ObjectStatus status) {
  ObjectSnapshot snapshot;
  snapshot.state.object = ObjectId{id};
  snapshot.state.status = static_cast<std::uint8_t>(status);
  return snapshot;
}

TEST(DisplayedSceneTest, AnObjectIsAnEntityFromItsFirstPoseUntilItIsHidden) {
  DisplayedScene scene{wire::AssetStore({})};
  scene.begin({});
  EXPECT_THAT(shown(scene, wire::kSceneObject, {.object = ObjectId{1}, .name = "peg"}), IsEmpty());
  EXPECT_FALSE(scene.frames());
  EXPECT_THAT(shown(scene, wire::kObjectSnapshot, snapshotOf(1, ObjectStatus::kParked)),
              ElementsAre("/scene peg"));
  EXPECT_THAT(shown(scene, wire::kObjectSnapshot, snapshotOf(1, ObjectStatus::kHeld)), IsEmpty());
  const auto frames = scene.frames();
  ASSERT_TRUE(frames);
  EXPECT_EQ(frames->bytes, encodeFrameTransforms({{"world", "object/peg", {}}}, kTime));
  EXPECT_FALSE(scene.frames()) << "no pose since";
  EXPECT_THAT(shown(scene, wire::kObjectSnapshot, snapshotOf(1, ObjectStatus::kHidden)),
              ElementsAre("/scene peg"));
}

TEST(DisplayedSceneTest, NoNameOfAnObjectIsThatOfAnotherFrameOrEntity) {
  DisplayedScene scene{wire::AssetStore({})};
  scene.begin({});
  const std::vector<std::string> names{"world", "hand_0", "target"};
  std::vector<FrameTransform> frames;
  for (std::uint32_t id = 0; id < names.size(); ++id) {
    static_cast<void>(shown(scene, wire::kSceneObject, {.object = ObjectId{id}, .name = names[id]}));
    const auto bytes = wire::encode(snapshotOf(id, ObjectStatus::kParked));
    const auto messages = scene.receive(
        {wire::kObjectSnapshot.name, wire::typeName<ObjectSnapshot>(), kTime, 0, false, *bytes});
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_EQ(
        messages[0].bytes,
        encodeEntity({.id = "object/" + names[id], .frame = "object/" + names[id], .color = colorOf("")},
                     kTime));
    frames.push_back({"world", "object/" + names[id], {}});
  }
  static_cast<void>(shown(scene, wire::kHandState100, {.hand = HandId{0}}));
  frames.push_back({"world", "hand_0", {}});
  EXPECT_EQ(scene.frames()->bytes, encodeFrameTransforms(frames, kTime));
}

TEST(DisplayedSceneTest, AModelThatComesLateReplacesTheBox) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("displayed_" + std::to_string(getpid()));
  const wire::AssetStore store{folder};
  const std::string model = "a model", name = wire::assetName(bytesOf(model));
  const std::string list = R"({"objects":[[{"model":")" + name + R"("}]]})";
  DisplayedScene scene{store};
  scene.begin({.scene_hash = wire::assetName(bytesOf(list))});
  static_cast<void>(shown(scene, wire::kSceneObject, {.object = ObjectId{0}, .name = "peg"}));
  static_cast<void>(shown(scene, wire::kObjectSnapshot, snapshotOf(0, ObjectStatus::kParked)));
  StepState step;
  step.object = ObjectId{0};
  step.phase = StepPhase::kActive;
  step.has_target = true;
  static_cast<void>(shown(scene, wire::kStepState, step));
  EXPECT_THAT(scene.boxes(), ElementsAre("peg"));
  ASSERT_TRUE(store.put(bytesOf(list)));
  EXPECT_THAT(scene.showModels(kTime), IsEmpty());
  ASSERT_TRUE(store.put(bytesOf(model)));
  const auto messages = scene.showModels(kTime + 1);
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].entity, "peg");
  EXPECT_EQ(messages[1].entity, "target");
  for (const DisplayMessage& message : messages)
    EXPECT_NE(std::search(message.bytes.begin(), message.bytes.end(), model.begin(), model.end()),
              message.bytes.end());
  EXPECT_THAT(scene.boxes(), IsEmpty());
  EXPECT_THAT(scene.showModels(kTime + 2), IsEmpty()) << "once";
  std::filesystem::remove_all(folder);
}

TEST(DisplayedSceneTest, TheTargetIsThatOfTheActiveStep) {
  DisplayedScene scene{wire::AssetStore({})};
  static_cast<void>(shown(scene, wire::kSceneObject, {.object = ObjectId{1}, .name = "peg"}));
  StepState step;
  step.object = ObjectId{1};
  step.phase = StepPhase::kActive;
  step.has_target = true;
  EXPECT_THAT(shown(scene, wire::kStepState, step), ElementsAre("/scene target"));
}

TEST(DisplayedSceneTest, AnEventIsALineOfTheLog) {
  DisplayedScene scene{wire::AssetStore({})};
  EXPECT_THAT(shown(scene, wire::kEventLog, {.kind = "run", .text = "running"}), ElementsAre("/log "));
}

}  // namespace
}  // namespace tenon::foxglove
