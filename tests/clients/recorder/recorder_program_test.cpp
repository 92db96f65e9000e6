#include "clients/recorder/recorder_program.h"

#include <filesystem>
#include <map>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/mcap_reader.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/wire/codec.h"
#include "tests/idl/wire/peer.h"

namespace tenon::recorder {
namespace {

/// The topics of a server that a recorder depends on.
class ServerMock {
 public:
  explicit ServerMock(std::uint32_t domain) : bus_(test::participant(domain)) {
    EXPECT_TRUE(announce_.write({.session = "class", .title = "Peg and box"}));
    EXPECT_TRUE(objects_.write({.object = ObjectId{0}, .name = "peg"}));
    EXPECT_TRUE(inbox_.on<Join>(lobby_, wire::kJoin, [this](const Join& join) {
      role_ = join.role;
      EXPECT_TRUE(welcome_.write({.client_guid = join.client_guid,
                                  .accepted = accepts_,
                                  .reason = accepts_ ? "" : "the session is full",
                                  .client = accepts_ ? ClientId{3} : ClientId{}}));
    }));
    EXPECT_TRUE(inbox_.on<RecorderStatus>(session_, wire::kRecorderStatus,
                                          [this](const RecorderStatus& status) { status_ = status; }));
  }

  std::shared_ptr<wire::Participant> bus_;
  wire::Partition lobby_{bus_, wire::kLobby};
  wire::Partition session_{bus_, wire::sessionPartition("class")};
  wire::Writer<SessionAnnounce> announce_ =
      std::move(*wire::Writer<SessionAnnounce>::open(lobby_, wire::kSessionAnnounce));
  wire::Writer<Welcome> welcome_ = std::move(*wire::Writer<Welcome>::open(lobby_, wire::kWelcome));
  wire::Writer<SceneObject> objects_ =
      std::move(*wire::Writer<SceneObject>::open(session_, wire::kSceneObject));
  wire::Writer<EventLog> events_ = std::move(*wire::Writer<EventLog>::open(session_, wire::kEventLog));
  wire::Writer<RunState> run_ = std::move(*wire::Writer<RunState>::open(session_, wire::kRunState));
  wire::Inbox inbox_;
  bool accepts_ = true;
  Role role_ = Role::kObserver;
  RecorderStatus status_;
};

class RecorderProgramTest : public ::testing::Test {
 protected:
  ~RecorderProgramTest() override {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    std::filesystem::remove(options_.file);
  }
  void start() {
    thread_ = std::thread([this] { result_ = recordSession(options_, stop_); });
  }
  std::map<std::string, int> counts() const {
    std::map<std::string, int> counts;
    auto reader = record::McapReader::open(options_.file);
    EXPECT_TRUE(reader->complete()) << reader->problem();
    for (record::McapMessage message; reader->next(message);) ++counts[std::string(message.topic)];
    return counts;
  }

  ServerMock server_{test::ownDomain()};
  RecorderOptions options_{
      .file = std::filesystem::temp_directory_path() / ("recorder_" + std::to_string(getpid()) + ".mcap"),
      .session = "class",
      .domain = test::ownDomain()};
  std::atomic<bool> stop_{false};
  Result<RecordingReport> result_;
  std::thread thread_;
};

TEST_F(RecorderProgramTest, RecordsUntilTheRunIsOverAndClosesItsFile) {
  start();
  ASSERT_TRUE(test::dispatchUntil(server_.inbox_, [&] { return server_.status_.recording; }));
  EXPECT_EQ(server_.role_, Role::kRecorder);
  for (std::uint64_t seq = 1; seq <= 50; ++seq) ASSERT_TRUE(server_.events_.write({.seq = seq}));
  ASSERT_TRUE(server_.run_.write({.phase = RunPhase::kSucceeded, .reason = "done"}));
  thread_.join();
  ASSERT_TRUE(result_) << result_.error().what;
  const auto found = counts();
  EXPECT_EQ(found.at("EventLog"), 50);
  EXPECT_EQ(found.at("SceneObject"), 1);
  EXPECT_EQ(found.at("SessionAnnounce"), 1);
  EXPECT_EQ(found.at("RunState"), 1);
  EXPECT_TRUE(test::dispatchUntil(server_.inbox_, [&] { return !server_.status_.recording; }));
}

TEST_F(RecorderProgramTest, StaysWhileAClientFloodsTheBusWithStopsAndNames) {
  constexpr int kStops = 1024, kNames = 5000;
  start();
  ASSERT_TRUE(test::dispatchUntil(server_.inbox_, [&] { return server_.status_.recording; }));
  {
    const auto bus = test::participant(test::ownDomain());
    wire::Partition session(bus, wire::sessionPartition("class"));
    auto stops = wire::Writer<EmergencyStop>::open(session, wire::kEmergencyStop);
    auto names = wire::Writer<Presence>::open(session, wire::kPresence);
    ASSERT_TRUE(stops && names);
    ASSERT_TRUE(test::dispatchUntil(
        server_.inbox_, [&] { return stops->matchedReaders() > 0 && names->matchedReaders() > 0; }));
    for (std::uint32_t i = 0; i < kStops; ++i) ASSERT_TRUE(stops->write({"made up", i, "flood", "flood"}));
    for (std::uint32_t i = 0; i < kNames; ++i)
      ASSERT_TRUE(names->write({.client = ClientId{1000 + i}, .name = "flood"}));
    EXPECT_TRUE(names->waitForReaders(std::chrono::seconds(20)));
  }
  ASSERT_TRUE(server_.events_.write({.seq = 1}));
  ASSERT_TRUE(server_.run_.write({.phase = RunPhase::kSucceeded, .reason = "done"}));
  thread_.join();
  ASSERT_TRUE(result_) << result_.error().what;
  const auto found = counts();
  EXPECT_EQ(found.at("EmergencyStop"), kStops);
  EXPECT_GE(found.at("Presence"), kNames);
  EXPECT_EQ(found.at("EventLog"), 1);
}

TEST_F(RecorderProgramTest, ClosesItsFileWhenStopped) {
  start();
  ASSERT_TRUE(test::dispatchUntil(server_.inbox_, [&] { return server_.status_.recording; }));
  stop_ = true;
  thread_.join();
  ASSERT_TRUE(result_) << result_.error().what;
  EXPECT_EQ(counts().at("SceneObject"), 1);
}

TEST_F(RecorderProgramTest, FailsWithTheReasonOfARefusal) {
  server_.accepts_ = false;
  start();
  ASSERT_TRUE(test::dispatchUntil(server_.inbox_, [&] { return server_.role_ == Role::kRecorder; }));
  thread_.join();
  ASSERT_FALSE(result_);
  EXPECT_EQ(result_.error().what, "the server of session 'class' refuses: the session is full");
}

TEST_F(RecorderProgramTest, WithLockstepItRefusesARealTimeSession) {
  options_.lockstep = true;
  start();
  thread_.join();
  ASSERT_FALSE(result_);
  EXPECT_THAT(result_.error().what, testing::HasSubstr("does not run in lockstep"));
}

TEST_F(RecorderProgramTest, FailsWhenNoServerAnnouncesTheSession) {
  options_.session = "another";
  options_.timeout = std::chrono::seconds(0);
  start();
  thread_.join();
  ASSERT_FALSE(result_);
  EXPECT_THAT(result_.error().what, testing::HasSubstr("no server announced session 'another'"));
}

}  // namespace
}  // namespace tenon::recorder
