#include "clients/recorder/recording.h"

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/instance_state.h"
#include "idl/record/mcap_reader.h"
#include "idl/record/packed_inputs.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/journal.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/objects.h"
#include "idl/wire/codec.h"

namespace tenon::recorder {
namespace {

constexpr std::int64_t kStart = 1'700'000'000'000'000'000;

class RecordingTest : public ::testing::Test {
 protected:
  ~RecordingTest() override { std::filesystem::remove(file_); }

  Recording open(bool lockstep) {
    return std::move(*Recording::open(file_, {.session = "s",
                                              .title = "A peg",
                                              .lockstep = lockstep,
                                              .scenario = "peg",
                                              .detail = 0.25,
                                              .freeze_ticks = 50,
                                              .park_ticks = 1000}));
  }
  template <class M>
  static void add(Recording& recording, const wire::Topic<M>& topic, const M& message, std::int64_t source_ns,
                  bool ended = false) {
    const auto bytes = wire::encode(message);
    recording.add({topic.name, wire::typeName<M>(), source_ns, 0, ended, *bytes});
  }
  /// Log times of a topic's messages.
  std::vector<std::int64_t> times(std::string_view topic) {
    std::vector<std::int64_t> found;
    auto reader = record::McapReader::open(file_);
    for (record::McapMessage message; reader->next(message);)
      if (message.topic == topic) found.push_back(message.log_time_ns);
    return found;
  }

  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("recording_" + std::to_string(getpid()) + ".mcap");
};

// a viewer that seeks is given the newest message of each channel
TEST_F(RecordingTest, PublicViewersFindEachObjectInAChannelOfItsOwnAndAllFramesInOne) {
  constexpr auto kParked = static_cast<std::uint8_t>(ObjectStatus::kParked);
  Recording recording = open(true);
  for (std::uint32_t id = 0; id < 2; ++id) {
    add(recording, wire::kSceneObject, {.object = ObjectId{id}, .name = id == 0 ? "bay" : "peg"}, kStart - 9);
    ObjectSnapshot snapshot;
    snapshot.state.object = ObjectId{id};
    snapshot.state.status = kParked;
    add(recording, wire::kObjectSnapshot, snapshot, kStart - 9);
  }
  StepState step;
  step.object = ObjectId{1};
  step.phase = StepPhase::kActive;
  step.has_target = true;
  add(recording, wire::kStepState, step, kStart);
  WorldFrame frame{.tick = 40};
  frame.states.push_back({.object = ObjectId{1}, .status = kParked});
  add(recording, wire::kWorldFrame30, frame, kStart + 5);
  add(recording, wire::kEventLog, {.seq = 1, .kind = "run", .text = "running"}, kStart + 6);
  ASSERT_TRUE(recording.close());
  const std::int64_t begin = times("SessionAnnounce").at(0);
  for (const char* topic : {"/scene/bay", "/scene/peg", "/target"})
    EXPECT_THAT(times(topic), ::testing::ElementsAre(::testing::Ge(begin))) << topic;
  EXPECT_EQ(times("/tf"), times("WorldFrame_30"));
  EXPECT_EQ(times("/log"), times("EventLog"));
}

TEST_F(RecordingTest, AModelThatComesLateIsShownFromThenOn) {
  const std::filesystem::path folder = file_.string() + "_models";
  const wire::AssetStore store{folder};
  const std::vector<std::uint8_t> model{'a', ' ', 'm', 'o', 'd', 'e', 'l'};
  const std::string list = R"({"objects":[[{"model":")" + wire::assetName(model) + R"("}]]})";
  const auto hash = store.put({reinterpret_cast<const std::uint8_t*>(list.data()), list.size()});
  ASSERT_TRUE(hash);
  Recording recording = std::move(*Recording::open(file_, {.scene_hash = *hash}, Streams::kAll, store));
  add(recording, wire::kSceneObject, {.object = ObjectId{0}, .name = "peg"}, kStart);
  ObjectSnapshot snapshot;
  snapshot.state.object = ObjectId{0};
  snapshot.state.status = static_cast<std::uint8_t>(ObjectStatus::kParked);
  add(recording, wire::kObjectSnapshot, snapshot, kStart);
  EXPECT_THAT(recording.boxes(), ::testing::ElementsAre("peg"));
  WorldFrame frame{.tick = 40};
  add(recording, wire::kWorldFrame30, frame, 2 * kStart);  // after the announcement, which has today's time
  ASSERT_TRUE(store.put(model));
  recording.showModels();
  EXPECT_THAT(recording.boxes(), ::testing::IsEmpty());
  ASSERT_TRUE(recording.close());
  const auto shown = times("/scene/peg");
  ASSERT_EQ(shown.size(), 2U);
  EXPECT_GE(shown[1], shown[0]);
  EXPECT_EQ(shown[1], times("WorldFrame_30").at(0)) << "when it came";
  std::filesystem::remove_all(folder);
}

TEST_F(RecordingTest, InRealTimeTheLogTimeIsTheSourceTime) {
  Recording recording = open(false);
  add(recording, wire::kWorldFrame1k, WorldFrame{.tick = 500}, kStart + 7);
  add(recording, wire::kEventLog, EventLog{.seq = 1, .tick = 500}, kStart + 9);
  ASSERT_TRUE(recording.close());
  EXPECT_THAT(times("EventLog"), testing::ElementsAre(kStart + 9));
}

TEST_F(RecordingTest, InLockstepTheLogTimeAdvancesOneMillisecondPerTick) {
  Recording recording = open(true);
  for (Tick tick = 1; tick <= 3; ++tick) {
    add(recording, wire::kWorldFrame1k, WorldFrame{.tick = 100 * tick}, kStart);
    add(recording, wire::kEventLog, EventLog{.seq = tick, .tick = 100 * tick}, kStart + 5);
  }
  for (const std::uint32_t tick : {310U, 320U, 4'000'000'000U})
    add(recording, wire::kHandState100, HandState{.seq = tick}, kStart + 9);
  ASSERT_TRUE(recording.close());
  const auto found = times("EventLog");
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[1] - found[0], 100'000'000);
  EXPECT_EQ(found[2] - found[1], 100'000'000);
  const auto hands = times("HandState_100");
  ASSERT_EQ(hands.size(), 3U);
  EXPECT_EQ(hands[0] - found[2], 10'000'000) << "whatever arrived before it";
  EXPECT_EQ(hands[1] - found[2], 20'000'000);
  EXPECT_EQ(hands[2] - found[2], 1'000'000'000) << "of a number that is wrong";
}

TEST_F(RecordingTest, FramesOfAnotherServerEpochDoNotAdvanceTheLogTime) {
  Recording recording = open(true);
  add(recording, wire::kWorldFrame1k, WorldFrame{.server_epoch = 0, .tick = 10}, kStart);
  add(recording, wire::kEventLog, EventLog{.seq = 1}, kStart);
  add(recording, wire::kWorldFrame1k, WorldFrame{.server_epoch = 99, .tick = 9999}, kStart);
  add(recording, wire::kEventLog, EventLog{.seq = 2}, kStart);
  ASSERT_TRUE(recording.close());
  const auto found = times("EventLog");
  EXPECT_EQ(found[0], found[1]);
}

TEST_F(RecordingTest, EndedInstancesAreWrittenToTheirOwnChannel) {
  Recording recording = open(false);
  Presence presence{.client = ClientId{4}, .name = "Ada"};
  add(recording, wire::kPresence, presence, kStart);
  add(recording, wire::kPresence, Presence{.client = ClientId{4}}, kStart + 1, true);
  ASSERT_TRUE(recording.close());
  EXPECT_EQ(times("Presence").size(), 1U);
  auto reader = record::McapReader::open(file_);
  int ended = 0;
  for (record::McapMessage message; reader->next(message);) {
    if (message.topic != record::kInstanceStateTopic) continue;
    ++ended;
    const auto instance = record::decodeInstanceGone(message.data);
    ASSERT_TRUE(instance);
    EXPECT_EQ(instance->topic, "Presence");
    EXPECT_EQ(wire::decode<Presence>(instance->key_sample)->client, ClientId{4});
  }
  EXPECT_EQ(ended, 1);
}

TEST_F(RecordingTest, SessionAndOutcomeAreMetadata) {
  Recording recording = open(true);
  EXPECT_FALSE(recording.runIsOver());
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kRunning}, kStart);
  EXPECT_FALSE(recording.runIsOver());
  add(recording, wire::kRunState,
      RunState{.phase = RunPhase::kSucceeded, .tick = 77, .reason = "done", .final_hash = 0xABCDEF}, kStart);
  EXPECT_TRUE(recording.runIsOver());
  ASSERT_TRUE(recording.close());
  auto reader = record::McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_TRUE(reader->complete()) << reader->problem();
  const auto outcome = reader->metadata().find("tenon outcome");
  ASSERT_NE(outcome, reader->metadata().end());
  EXPECT_EQ(outcome->second.at("outcome"), "succeeded");
  EXPECT_EQ(outcome->second.at("final hash"), "0000000000abcdef");
  const auto origin = reader->metadata().find("tenon recording");
  ASSERT_NE(origin, reader->metadata().end());
  EXPECT_EQ(origin->second.at("title"), "A peg");
  for (const auto& [key, value] : std::map<std::string, std::string>{{"scenario", "peg"},
                                                                     {"detail", "0.25"},
                                                                     {"freeze after ticks", "50"},
                                                                     {"park after ticks", "1000"}})
    EXPECT_EQ(origin->second.at(key), value) << key;
}

TEST_F(RecordingTest, MissingTickInputsAreCounted) {
  Recording recording = open(true);
  recording.joined(4);
  for (const Tick tick : {5, 6, 6, 9, 10})
    add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  EXPECT_EQ(recording.status().lost, 2U);
}

TEST_F(RecordingTest, InputsBeforeTheFirstAndAfterTheLastOneReceivedAreMissingToo) {
  Recording recording = open(true);
  for (const Tick tick : {2, 3}) add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  EXPECT_EQ(recording.status().lost, 1U);
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kSucceeded, .tick = 5}, kStart);
  EXPECT_EQ(recording.status().lost, 3U);
}

// In period 1 the server published 3 frames and 2 manifolds a tick, in period 2 nothing is missing.
TEST_F(RecordingTest, WhatTheServerPublishedAndDidNotArriveIsCountedByTopic) {
  Recording recording = open(true);
  const auto addTick = [&](Tick tick, int frames, int manifolds) {
    for (int i = 0; i < frames; ++i) add(recording, wire::kWorldFrame1k, WorldFrame{.tick = tick}, kStart);
    for (int i = 0; i < manifolds; ++i)
      add(recording, wire::kHandManifold, HandManifold{.tick = tick}, kStart);
  };
  addTick(1, 3, 2);
  addTick(1000, 3, 1);
  const PublishedSamples first{1, 1000, {{"WorldFrame_1k", 6}, {"HandManifold", 4}, {"TickStats_100", 2}}};
  add(recording, wire::kPublishedSamples, first, kStart);
  EXPECT_EQ(recording.status().lost, 0U) << "samples of the period may be on their way";
  addTick(1001, 3, 2);
  EXPECT_EQ(recording.status().lost, 1U) << "those of the next period have come";
  const PublishedSamples second{1001, 1001, {{"WorldFrame_1k", 3}, {"HandManifold", 2}}};
  add(recording, wire::kPublishedSamples, second, kStart);
  EXPECT_FALSE(recording.hasStatement());
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kSucceeded, .tick = 1001}, kStart);
  EXPECT_TRUE(recording.hasStatement());
  EXPECT_EQ(recording.status().lost, 3U) << "no statistics came at all";
  ASSERT_TRUE(recording.close());
  auto reader = record::McapReader::open(file_);
  ASSERT_TRUE(reader && reader->complete());
  const auto samples = reader->metadata().find("tenon samples");
  ASSERT_NE(samples, reader->metadata().end());
  EXPECT_EQ(samples->second.at("WorldFrame_1k"), "9 of 9");
  EXPECT_EQ(samples->second.at("HandManifold"), "5 of 6");
  EXPECT_EQ(samples->second.at("TickStats_100"), "0 of 2");
}

TEST_F(RecordingTest, OfThePeriodInWhichItJoinedNothingIsExpected) {
  Recording recording = open(false);
  recording.joined(500);
  add(recording, wire::kPublishedSamples, PublishedSamples{1, 1000, {{"WorldFrame_1k", 1000}}}, kStart);
  add(recording, wire::kPublishedSamples, PublishedSamples{1001, 2000, {{"WorldFrame_1k", 7}}}, kStart);
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kStopped, .tick = 2000}, kStart);
  EXPECT_EQ(recording.status().lost, 7U);
}

// they come before the welcome says when it joined
TEST_F(RecordingTest, OfPeriodsThatLateJoinersAreToldOfNothingIsExpected) {
  Recording recording = open(false);
  add(recording, wire::kPublishedSamples, PublishedSamples{1, 1000, {{"WorldFrame_1k", 1000}}}, kStart);
  recording.joined(1500);
  add(recording, wire::kPublishedSamples, PublishedSamples{2001, 3000, {{"WorldFrame_1k", 7}}}, kStart);
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kStopped, .tick = 3000}, kStart);
  EXPECT_EQ(recording.status().lost, 7U);
}

// a recorder that stood still hears of its seat late, and everything else from the first tick on
TEST_F(RecordingTest, OfAPeriodWhoseFramesCameBeforeTheWelcomeAllIsExpected) {
  Recording recording = open(true);
  for (Tick tick = 1; tick <= 1000; ++tick)
    add(recording, wire::kWorldFrame1k, WorldFrame{.tick = tick}, kStart);
  recording.joined(900);
  add(recording, wire::kPublishedSamples, PublishedSamples{1, 1000, {{"HandManifold", 3}}}, kStart);
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kStopped, .tick = 1000}, kStart);
  EXPECT_EQ(recording.status().lost, 3U);
}

// a recording without all streams has frames of each tenth tick alone
TEST_F(RecordingTest, OfAPeriodWhoseFirstManifoldCameBeforeTheWelcomeAllIsExpected) {
  Recording recording = std::move(*Recording::open(file_, {.session = "s"}, Streams::kReduced));
  add(recording, wire::kHandManifold, HandManifold{.tick = 1}, kStart);
  add(recording, wire::kWorldFrame100, WorldFrame{.tick = 10}, kStart);
  recording.joined(5);
  add(recording, wire::kPublishedSamples, PublishedSamples{1, 1000, {{"WorldFrame_100", 100}}}, kStart);
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kStopped, .tick = 1000}, kStart);
  EXPECT_EQ(recording.status().lost, 99U);
}

TEST_F(RecordingTest, AStatementThatDidNotArriveIsMissingItself) {
  for (const Tick lost : {1, 1001, 2001}) {
    Recording recording = open(true);
    for (const Tick first : {1, 1001, 2001, 3001})
      if (first != lost)
        add(recording, wire::kPublishedSamples, PublishedSamples{first, first + 999, {}}, kStart);
    EXPECT_EQ(recording.status().lost, 1U) << lost;
  }
}

TEST_F(RecordingTest, InputsOfBeforeTheWelcomeAreRecordedAndExpectedFromTheFirstOne) {
  Recording recording = open(false);
  for (const Tick tick : {501, 502, 504})
    add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  recording.joined(503);
  add(recording, wire::kPublishedSamples, PublishedSamples{1, 1000, {{"WorldFrame_1k", 9}}}, kStart);
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kStopped, .tick = 504}, kStart);
  EXPECT_EQ(recording.status().lost, 1U) << "input 503 alone";
}

// DDS delivers the last samples once more to a reader that took their writer for dead
TEST_F(RecordingTest, WhatIsDeliveredOnceMoreIsNotRecordedOnceMore) {
  Recording recording = open(false);
  for (int times = 0; times < 2; ++times) {
    for (const std::uint32_t part : {0U, 1U}) {
      add(recording, wire::kTickInput, TickInputPart{.tick = 1, .part = part, .parts = 2}, kStart);
      add(recording, wire::kCheckpoint, CheckpointPart{.tick = 1, .part = part, .parts = 2}, kStart);
    }
    for (const std::uint64_t seq : {1U, 2U}) add(recording, wire::kEventLog, EventLog{.seq = seq}, kStart);
  }
  add(recording, wire::kTickInput, TickInputPart{.tick = 2}, kStart);
  EXPECT_EQ(recording.status().lost, 0U);
  ASSERT_TRUE(recording.close());
  EXPECT_EQ(times("TickInput").size(), 3U);
  EXPECT_EQ(times("Checkpoint").size(), 2U);
  EXPECT_EQ(times("EventLog").size(), 2U);
}

// DDS delivers by instance, and the part is the key: parts of two checkpoints come interleaved
TEST_F(RecordingTest, AllPartsOfCheckpointsAreRecordedWhateverTheirOrder) {
  Recording recording = open(false);
  for (const std::uint32_t part : {0U, 1U})
    for (const Tick tick : {1, 1001})
      add(recording, wire::kCheckpoint, CheckpointPart{.tick = tick, .part = part, .parts = 2}, kStart);
  ASSERT_TRUE(recording.close());
  EXPECT_EQ(times("Checkpoint").size(), 4U);
}

// its journal ended at tick 12: of 11 and 12 no copy was sent before the server was killed
TEST_F(RecordingTest, AResumedServerFillsWhatTheFormerOneDidNotSend) {
  Recording recording = open(false);
  const auto addInputs = [&](Tick first, Tick last) {
    for (Tick tick = first; tick <= last; ++tick)
      add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  };
  addInputs(1, 10);
  add(recording, wire::kEventLog, EventLog{.seq = 7}, kStart);
  const SessionAnnounce next{.session = "s", .server_epoch = 2, .resumed_after = 12};
  ASSERT_TRUE(recording.continues(next));
  EXPECT_EQ(recording.recordedUntil(next), 9U) << "of the newest one parts may be missing";
  recording.resumed(next);
  addInputs(5, 15);
  add(recording, wire::kEventLog, EventLog{.seq = 1}, kStart);
  EXPECT_EQ(recording.status().lost, 0U);
  ASSERT_TRUE(recording.close());
  EXPECT_EQ(times("TickInput").size(), 15U);
  EXPECT_EQ(times("EventLog").size(), 2U) << "a resumed server numbers its events anew";
}

TEST_F(RecordingTest, ASessionThatWasKilledBeforeItsFirstTickIsContinued) {
  Recording recording = open(false);
  const SessionAnnounce next{.session = "s", .server_epoch = 2};
  EXPECT_TRUE(recording.continues(next)) << "nothing was recorded that the next server could contradict";
  add(recording, wire::kTickInput, TickInputPart{.tick = 1}, kStart);
  EXPECT_FALSE(recording.continues(next)) << "it begins anew";
}

TEST_F(RecordingTest, TicksThatTheJournalDidNotKeepAreThoseOfTheResumedServer) {
  Recording recording = open(false);
  for (Tick tick = 1; tick <= 10; ++tick)
    add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  const SessionAnnounce next{.session = "s", .server_epoch = 2, .resumed_after = 8};
  EXPECT_EQ(recording.recordedUntil(next), 8U);
  recording.resumed(next);
  for (Tick tick = 7; tick <= 12; ++tick)
    add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  EXPECT_EQ(recording.status().lost, 0U);
  ASSERT_TRUE(recording.close());
  EXPECT_EQ(times("TickInput").size(), 14U);
}

//  life 1   ticks 1 to 1200, the recorder gets the inputs up to 1190
//  life 2   1201 to 1300, without the recorder
//  life 3   1301 on, the recorder is back at 1400
TEST_F(RecordingTest, WhatNoLifeOfTheServerSentIsMissingOnce) {
  Recording recording = open(false);
  const auto addTicks = [&](Tick first, Tick last, std::uint32_t epoch) {
    for (Tick tick = first; tick <= last; ++tick) {
      add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
      add(recording, wire::kWorldFrame1k, WorldFrame{.server_epoch = epoch, .tick = tick}, kStart);
    }
  };
  addTicks(1, 1190, 0);
  const PublishedSamples first{1, 1000, {{"WorldFrame_1k", 1000}}};
  add(recording, wire::kPublishedSamples, first, kStart);
  const SessionAnnounce third{.session = "s", .server_epoch = 3, .resumed_after = 1300};
  ASSERT_TRUE(recording.continues(third));
  recording.resumed(third);
  // the third server has read the last 60 ticks of the journal
  for (Tick tick = 1241; tick <= 1399; ++tick)
    add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  addTicks(1400, 2001, 3);
  const PublishedSamples second{1001, 2000, {{"WorldFrame_1k", 700}}};
  for (int times = 0; times < 2; ++times) add(recording, wire::kPublishedSamples, second, kStart);
  for (const TopicCount& count : recording.counts()) {
    if (count.topic == "PublishedSamples") continue;
    EXPECT_EQ(count.recorded, count.topic == "TickInput" ? 2001U - 50U : 1601U) << count.topic;
    EXPECT_EQ(count.published, count.topic == "TickInput" ? 2001U : 1700U) << count.topic;
  }
  ASSERT_TRUE(recording.close());
  EXPECT_EQ(times("PublishedSamples").size(), 2U);
}

TEST_F(RecordingTest, FailsWithASentenceWhenTheFileCannotBeWritten) {
  const auto recording = Recording::open("/proc/no/such/place.mcap", {});
  ASSERT_FALSE(recording);
  EXPECT_THAT(recording.error().what, testing::HasSubstr("/proc/no/such/place.mcap: cannot be written"));
}

TEST_F(RecordingTest, WithoutAllStreamsItHasTheInputsPackedAndTheStrongestManifoldOfTenTicks) {
  Recording recording = std::move(*Recording::open(file_, {.session = "s"}, Streams::kReduced));
  for (Tick tick = 1; tick <= 620; ++tick) {
    for (std::uint32_t part = 0; part < 2; ++part)
      add(recording, wire::kTickInput,
          TickInputPart{.tick = tick, .part = part, .parts = 2, .state_hash = tick, .bytes = {1, 2}}, kStart);
    HandManifold manifold{.hand = HandId{0}, .tick = tick};
    manifold.F_Ho_W.force.x() = tick % 10 == 4 ? 9.0 : 1.0;
    add(recording, wire::kHandManifold, manifold, kStart);
    add(recording, wire::kDeviceInput, DeviceInput{}, kStart);
    add(recording, wire::kWorldFrame1k, WorldFrame{.tick = tick}, kStart);
  }
  const PublishedSamples published{1, 620, {{"WorldFrame_1k", 620}, {"HandManifold", 620}}};
  add(recording, wire::kPublishedSamples, published, kStart);
  add(recording, wire::kRunState, RunState{.phase = RunPhase::kSucceeded, .tick = 620}, kStart);
  EXPECT_EQ(recording.status().lost, 0U) << "what is skipped is not missing";
  ASSERT_TRUE(recording.close());
  EXPECT_THAT(times("WorldFrame_1k"), testing::IsEmpty());
  EXPECT_THAT(times("DeviceInput"), testing::IsEmpty());

  std::vector<Tick> inputs, manifolds;
  auto reader = record::McapReader::open(file_);
  for (record::McapMessage message; reader->next(message);) {
    if (message.topic == "HandManifold") manifolds.push_back(wire::decode<HandManifold>(message.data)->tick);
    if (message.topic != record::kPackedInputsTopic) continue;
    const auto packed = record::decodePackedInputs(message.data);
    ASSERT_TRUE(packed) << packed.error().what;
    for (const record::RecordedInput& input : *packed) {
      inputs.push_back(input.tick);
      EXPECT_EQ(input.state_hash, input.tick);
      EXPECT_EQ(input.bytes.size(), 4U) << "both parts";
    }
  }
  ASSERT_EQ(inputs.size(), 620U);
  EXPECT_EQ(inputs.back(), 620U);
  ASSERT_EQ(manifolds.size(), 63U) << "the last one is of a period that had begun";
  for (std::size_t i = 0; i + 1 < manifolds.size(); ++i) EXPECT_EQ(manifolds[i] % 10, 4U);
}

TEST_F(RecordingTest, WithoutAllStreamsItHasACheckpointInTenSecondsAndOneAfterAGap) {
  Recording recording = std::move(*Recording::open(file_, {.session = "s"}, Streams::kReduced));
  for (Tick tick = 1; tick <= 25'000; ++tick) {
    if (tick >= 14'500 && tick < 14'600) continue;
    add(recording, wire::kTickInput, TickInputPart{.tick = tick, .parts = 1}, kStart);
    if (tick % 1000 == 1)
      for (std::uint32_t part = 0; part < 3; ++part)
        add(recording, wire::kCheckpoint, CheckpointPart{.tick = tick, .part = part, .parts = 3}, kStart);
  }
  ASSERT_TRUE(recording.close());
  std::vector<Tick> checkpoints;
  auto reader = record::McapReader::open(file_);
  for (record::McapMessage message; reader->next(message);)
    if (message.topic == "Checkpoint")
      checkpoints.push_back(wire::decode<CheckpointPart>(message.data)->tick);
  EXPECT_THAT(checkpoints, testing::ElementsAre(1, 1, 1, 10'001, 10'001, 10'001, 15'001, 15'001, 15'001));
}

}  // namespace
}  // namespace tenon::recorder
