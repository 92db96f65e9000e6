#include "clients/console/session_channels.h"

#include <filesystem>
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "idl/wire/codec.h"

namespace tenon::console {
namespace {

namespace fs = std::filesystem;
using foxglove::colorOf;
using foxglove::encodeFrameTransforms;
using foxglove::Rgba;

class SessionChannelsTest : public testing::Test {
 protected:
  SessionChannelsTest() {
    const std::string model = "glTF: a peg";
    const auto asset = assets_.put(bytesOf(model));
    const std::string list =
        R"({"version":1,"objects":[[],[{"model":")" + *asset + R"(","triangles":1,"error":0}]]})";
    announce_.scene_hash = assets_.put(bytesOf(list)).value();
    channels_.begin(announce_, 1);
    channels_.setState(LinkState::kJoined, "", false, 1);
    static_cast<void>(channels_.take());
  }
  ~SessionChannelsTest() override { fs::remove_all(folder_); }

  static std::vector<std::uint8_t> bytesOf(const std::string& text) { return {text.begin(), text.end()}; }
  template <class M>
  void receive(const wire::Topic<M>& topic, const M& message, bool gone = false) {
    const auto bytes = wire::encode(message);
    channels_.receive({topic.name, wire::typeName<M>(), 5'000'000'007, 0, gone, *bytes, 42});
  }
  void place(std::uint32_t id, ObjectStatus status, const Vector3& p_WO = Vector3::Zero()) {
    ObjectSnapshot snapshot;
    snapshot.state.object = ObjectId{id};
    snapshot.state.X_WO = Pose(p_WO);
    snapshot.state.status = static_cast<std::uint8_t>(status);
    receive(wire::kObjectSnapshot, snapshot);
  }
  /// The contents of what is published to a topic since the last call.
  std::vector<std::string> taken(std::string_view topic) {
    std::vector<std::string> contents;
    for (const Publication& publication : channels_.take())
      if (publication.payload != nullptr && channels_.channels()[publication.channel - 1].topic == topic)
        contents.emplace_back(publication.payload->begin(), publication.payload->end());
    return contents;
  }

  const fs::path folder_ = fs::temp_directory_path() / ("tenon_channels_test_" + std::to_string(getpid()));
  wire::AssetStore assets_{folder_};
  SessionAnnounce announce_{.session = "demo", .title = "Peg and box"};
  SessionChannels channels_{assets_};
};

TEST_F(SessionChannelsTest, HasNoChannelOfWhatClientsProveThemselvesWithNorOneAt1kHz) {
  std::set<std::string> topics;
  for (const Channel& channel : channels_.channels()) {
    EXPECT_TRUE(topics.insert(channel.topic).second) << channel.topic;
    EXPECT_EQ(channel.id, topics.size());
    EXPECT_FALSE(channel.schema.empty());
  }
  for (const char* none : {"Join", "Welcome", "Command", "WorldFrame_1k", "DeviceInput", "HandManifold",
                           "TickInput", "Checkpoint"})
    EXPECT_FALSE(topics.contains(none)) << none;
  for (const char* one :
       {"/tf", "/scene", "/log", "/console", "WorldFrame_30", "WorldFrame_100", "StepState", "EmergencyStop"})
    EXPECT_TRUE(topics.contains(one)) << one;
}

TEST_F(SessionChannelsTest, ForwardsTheBytesAsTheyAre) {
  RunState run{.tick = 7, .reason = "for a test"};
  receive(wire::kRunState, run);
  const auto bytes = wire::encode(run);
  EXPECT_EQ(taken("RunState"), (std::vector<std::string>{{bytes->begin(), bytes->end()}}));
  EXPECT_FALSE(channels_.isOver());
  run.phase = RunPhase::kSucceeded;
  receive(wire::kRunState, run);
  EXPECT_TRUE(channels_.isOver());
}

TEST_F(SessionChannelsTest, AnObjectIsShownOnceWithItsModelAndRemovedWhenItIsHidden) {
  receive(wire::kSceneObject, {.object = ObjectId{1}, .name = "peg", .color = "#ff8000"});
  EXPECT_TRUE(taken("/scene").empty()) << "where it is is not known yet";
  place(1, ObjectStatus::kParked);
  auto shown = taken("/scene");
  ASSERT_EQ(shown.size(), 1U);
  EXPECT_NE(shown[0].find("glTF: a peg"), std::string::npos);
  EXPECT_NE(shown[0].find("model/gltf-binary"), std::string::npos);
  place(1, ObjectStatus::kHeld);
  EXPECT_TRUE(taken("/scene").empty()) << "it moves by its frame";
  place(1, ObjectStatus::kHidden);
  shown = taken("/scene");
  ASSERT_EQ(shown.size(), 1U);
  EXPECT_EQ(shown[0].find("glTF"), std::string::npos);
  EXPECT_NE(shown[0].find("peg"), std::string::npos);
}

TEST_F(SessionChannelsTest, AnObjectWithoutAModelIsABox) {
  receive(wire::kSceneObject, {.object = ObjectId{0}, .name = "box", .color = "#ff8000", .size = {1, 2, 3}});
  place(0, ObjectStatus::kFixed);
  const auto shown = taken("/scene");
  ASSERT_EQ(shown.size(), 1U);
  EXPECT_EQ(shown[0].find("model/gltf-binary"), std::string::npos);
}

TEST_F(SessionChannelsTest, FramesOfAllObjectsAreInEachMessage) {
  for (std::uint32_t id = 0; id < 2; ++id)
    receive(wire::kSceneObject, {.object = ObjectId{id}, .name = "object " + std::to_string(id)});
  place(0, ObjectStatus::kFixed);
  place(1, ObjectStatus::kParked, {1, 2, 3});
  static_cast<void>(taken("/tf"));
  WorldFrame frame;
  frame.states.push_back({.object = ObjectId{1}, .X_WO = Pose(Vector3(4, 5, 6))});
  receive(wire::kWorldFrame30, frame);
  const auto frames = taken("/tf");
  ASSERT_EQ(frames.size(), 1U);
  // CDR: two transforms, their stamps 5 s and 7 ns
  std::vector<std::uint8_t> expected = encodeFrameTransforms(
      {{"world", "object/object 0", {}}, {"world", "object/object 1", Pose(Vector3(4, 5, 6))}},
      5'000'000'007);
  EXPECT_EQ(frames[0], std::string(expected.begin(), expected.end()));
  EXPECT_EQ(expected[0], 0);
  EXPECT_EQ(expected[1], 1) << "little-endian";
  EXPECT_EQ(expected[4], 2) << "transforms";
  EXPECT_EQ(expected[8], 5) << "seconds";
  EXPECT_EQ(expected[12], 7) << "nanoseconds";
  EXPECT_TRUE(taken("/tf").empty());
}

// that a warning which repeats does not push it out of what late viewers get
TEST_F(SessionChannelsTest, WhatAStationTellsIsCountedByItsKindAndClient) {
  const auto kindOf = [&](std::uint32_t client, const char* kind, const char* text) {
    receive(wire::kClientEvent, {.client = ClientId{client}, .kind = kind, .text = text});
    return channels_.take().back().instance;
  };
  const std::uint64_t device = kindOf(1, "device", "hand right: falcon, workspace radius 0.050 m");
  EXPECT_EQ(kindOf(1, "device", "hand left: falcon, workspace radius 0.050 m"), device);
  EXPECT_NE(kindOf(1, "warning", "hand right: ahead of the contact set"), device);
  EXPECT_NE(kindOf(2, "device", "hand right: falcon, workspace radius 0.050 m"), device);
}

TEST_F(SessionChannelsTest, TheEndOfAnInstanceIsToldAndForgotten) {
  receive(wire::kPresence, {.client = ClientId{3}, .name = "somebody"});
  static_cast<void>(channels_.take());
  receive(wire::kPresence, {.client = ClientId{3}}, true);
  const auto published = channels_.take();
  ASSERT_EQ(published.size(), 2U);
  EXPECT_EQ(published[0].payload, nullptr);
  EXPECT_EQ(published[0].instance, 42U);
  EXPECT_EQ(channels_.channels()[published[1].channel - 1].topic, "__instance_state");
}

TEST_F(SessionChannelsTest, WhatAServerSaidLastStaysWhenItHasGone) {
  receive(wire::kSceneObject, {.object = ObjectId{1}, .name = "peg"});
  static_cast<void>(channels_.take());
  receive(wire::kSceneObject, {.object = ObjectId{1}}, true);
  EXPECT_TRUE(channels_.take().empty());
}

TEST_F(SessionChannelsTest, AnotherSessionForgetsTheOneBefore) {
  receive(wire::kSceneObject, {.object = ObjectId{1}, .name = "peg"});
  place(1, ObjectStatus::kParked);
  static_cast<void>(channels_.take());
  channels_.begin(announce_, 8);
  channels_.setState(LinkState::kJoined, "", false, 8);
  const auto before = nlohmann::json::parse(*channels_.take()[2].payload);
  channels_.begin(announce_, 9);
  channels_.setState(LinkState::kJoined, "", false, 9);
  const auto published = channels_.take();
  ASSERT_EQ(published.size(), 3U);
  EXPECT_EQ(published[0].channel, 0U) << "nothing of before is kept";
  const auto state = nlohmann::json::parse(*published[2].payload);
  EXPECT_NE(state["life"], before["life"]);
  EXPECT_GE(state["life"], 0);
  EXPECT_EQ(state["state"], "joined");
  EXPECT_EQ(state["title"], "Peg and box");
  place(1, ObjectStatus::kParked);
  EXPECT_TRUE(taken("/scene").empty()) << "its name is not known any more";
}

TEST(ColorOf, ReadsColorsWithAndWithoutOpacity) {
  EXPECT_EQ(colorOf("#ff0080"), (Rgba{1.0, 0.0, 128 / 255.0, 1.0}));
  EXPECT_EQ(colorOf("#00ff0033"), (Rgba{0.0, 1.0, 0.0, 0.2}));
  for (const char* none : {"", "red", "#12345", "#gggggg", "#12345g"})
    EXPECT_EQ(colorOf(none)[3], 1.0) << none;
}

}  // namespace
}  // namespace tenon::console
