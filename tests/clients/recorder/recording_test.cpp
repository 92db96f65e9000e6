#include "clients/recorder/recording.h"

#include <filesystem>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/instance_state.h"
#include "idl/record/mcap_reader.h"
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
    return std::move(*Recording::open(file_, {.session = "s", .title = "A peg", .lockstep = lockstep}));
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

TEST_F(RecordingTest, InRealTimeTheLogTimeIsTheSourceTime) {
  Recording recording = open(false);
  add(recording, wire::kWorldFrame1k, WorldFrame{.tick = 500}, kStart + 7);
  add(recording, wire::kEventLog, EventLog{.tick = 500}, kStart + 9);
  ASSERT_TRUE(recording.close());
  EXPECT_THAT(times("EventLog"), testing::ElementsAre(kStart + 9));
}

TEST_F(RecordingTest, InLockstepTheLogTimeAdvancesOneMillisecondPerTick) {
  Recording recording = open(true);
  for (Tick tick = 1; tick <= 3; ++tick) {
    add(recording, wire::kWorldFrame1k, WorldFrame{.tick = 100 * tick}, kStart);
    add(recording, wire::kEventLog, EventLog{.tick = 100 * tick}, kStart + 5);
  }
  ASSERT_TRUE(recording.close());
  const auto found = times("EventLog");
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[1] - found[0], 100'000'000);
  EXPECT_EQ(found[2] - found[1], 100'000'000);
}

TEST_F(RecordingTest, FramesOfAnotherServerEpochDoNotAdvanceTheLogTime) {
  Recording recording = open(true);
  add(recording, wire::kWorldFrame1k, WorldFrame{.server_epoch = 0, .tick = 10}, kStart);
  add(recording, wire::kEventLog, EventLog{}, kStart);
  add(recording, wire::kWorldFrame1k, WorldFrame{.server_epoch = 99, .tick = 9999}, kStart);
  add(recording, wire::kEventLog, EventLog{}, kStart);
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
}

TEST_F(RecordingTest, MissingTickInputsAreCounted) {
  Recording recording = open(true);
  for (const Tick tick : {5, 6, 6, 9, 10})
    add(recording, wire::kTickInput, TickInputPart{.tick = tick}, kStart);
  EXPECT_EQ(recording.status().lost, 2U);
}

TEST_F(RecordingTest, FailsWithASentenceWhenTheFileCannotBeWritten) {
  const auto recording = Recording::open("/proc/no/such/place.mcap", {});
  ASSERT_FALSE(recording);
  EXPECT_THAT(recording.error().what, testing::HasSubstr("/proc/no/such/place.mcap: cannot be written"));
}

}  // namespace
}  // namespace tenon::recorder
