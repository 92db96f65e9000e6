#include "clients/recorder/recording.h"

#include <filesystem>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/instance_state.h"
#include "idl/record/mcap_reader.h"
#include "idl/wire/codec.h"

namespace tenon {
namespace {

constexpr std::int64_t kStart = 1'700'000'000'000'000'000;

class RecordingTest : public ::testing::Test {
 protected:
  ~RecordingTest() override { std::filesystem::remove(file_); }

  Recording open(bool lockstep) {
    return std::move(*Recording::open(file_, {.session = "s", .title = "A peg", .lockstep = lockstep}));
  }
  template <class M>
  static void add(Recording& recording, const Topic<M>& topic, const M& message, std::int64_t source_ns,
                  bool gone = false) {
    const auto bytes = encode(message);
    recording.add({topic.name, typeName<M>(), source_ns, 0, gone, *bytes});
  }
  /// Log times of a topic's messages.
  std::vector<std::int64_t> times(std::string_view topic) {
    std::vector<std::int64_t> found;
    auto reader = McapReader::open(file_);
    for (McapMessage message; reader->next(message);)
      if (message.topic == topic) found.push_back(message.log_time_ns);
    return found;
  }

  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("recording_" + std::to_string(getpid()) + ".mcap");
};

TEST_F(RecordingTest, ByTheClockAMessageHasItsSourceTime) {
  Recording recording = open(false);
  add(recording, kWorldFrame1k, WorldFrame{.tick = 500}, kStart + 7);
  add(recording, kEventLog, EventLog{.tick = 500}, kStart + 9);
  ASSERT_TRUE(recording.close());
  EXPECT_THAT(times("EventLog"), testing::ElementsAre(kStart + 9));
}

TEST_F(RecordingTest, InLockstepATickIsAMillisecondHoweverFastItWas) {
  Recording recording = open(true);
  for (Tick tick = 1; tick <= 3; ++tick) {
    add(recording, kWorldFrame1k, WorldFrame{.tick = 100 * tick}, kStart);
    add(recording, kEventLog, EventLog{.tick = 100 * tick}, kStart + 5);
  }
  ASSERT_TRUE(recording.close());
  const auto found = times("EventLog");
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[1] - found[0], 100'000'000);
  EXPECT_EQ(found[2] - found[1], 100'000'000);
}

TEST_F(RecordingTest, FramesOfAnotherServerDoNotMoveTheTime) {
  Recording recording = open(true);
  add(recording, kWorldFrame1k, WorldFrame{.server_epoch = 0, .tick = 10}, kStart);
  add(recording, kEventLog, EventLog{}, kStart);
  add(recording, kWorldFrame1k, WorldFrame{.server_epoch = 99, .tick = 9999}, kStart);
  add(recording, kEventLog, EventLog{}, kStart);
  ASSERT_TRUE(recording.close());
  const auto found = times("EventLog");
  EXPECT_EQ(found[0], found[1]);
}

TEST_F(RecordingTest, WhatLeftTheSessionStandsOnAChannelOfItsOwn) {
  Recording recording = open(false);
  Presence presence{.client = ClientId{4}, .name = "Ada"};
  add(recording, kPresence, presence, kStart);
  add(recording, kPresence, Presence{.client = ClientId{4}}, kStart + 1, true);
  ASSERT_TRUE(recording.close());
  EXPECT_EQ(times("Presence").size(), 1U);
  auto reader = McapReader::open(file_);
  int gone = 0;
  for (McapMessage message; reader->next(message);) {
    if (message.topic != kInstanceStateTopic) continue;
    ++gone;
    const auto instance = decodeInstanceGone(message.data);
    ASSERT_TRUE(instance);
    EXPECT_EQ(instance->topic, "Presence");
    EXPECT_EQ(decode<Presence>(instance->key_sample)->client, ClientId{4});
  }
  EXPECT_EQ(gone, 1);
}

TEST_F(RecordingTest, ItsOutcomeAndWhatItIsOfAreMetadata) {
  Recording recording = open(true);
  EXPECT_FALSE(recording.runIsOver());
  add(recording, kRunState, RunState{.phase = RunPhase::kRunning}, kStart);
  EXPECT_FALSE(recording.runIsOver());
  add(recording, kRunState,
      RunState{.phase = RunPhase::kSucceeded, .tick = 77, .reason = "done", .final_hash = 0xABCDEF}, kStart);
  EXPECT_TRUE(recording.runIsOver());
  ASSERT_TRUE(recording.close());
  auto reader = McapReader::open(file_);
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

TEST_F(RecordingTest, HolesInTheInputsAreCounted) {
  Recording recording = open(true);
  for (const Tick tick : {5, 6, 6, 9, 10}) add(recording, kTickInput, TickInputPart{.tick = tick}, kStart);
  EXPECT_EQ(recording.status().lost, 2U);
}

TEST_F(RecordingTest, AFileThatCannotBeMadeIsOneSentence) {
  const auto recording = Recording::open("/proc/no/such/place.mcap", {});
  ASSERT_FALSE(recording);
  EXPECT_THAT(recording.error().what, testing::HasSubstr("/proc/no/such/place.mcap: cannot be written"));
}

}  // namespace
}  // namespace tenon
