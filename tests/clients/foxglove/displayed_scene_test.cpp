#include "clients/foxglove/displayed_scene.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  EXPECT_EQ(frames->bytes, encodeFrameTransforms({{"world", "peg", {}}}, kTime));
  EXPECT_FALSE(scene.frames()) << "no pose since";
  EXPECT_THAT(shown(scene, wire::kObjectSnapshot, snapshotOf(1, ObjectStatus::kHidden)),
              ElementsAre("/scene peg"));
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
