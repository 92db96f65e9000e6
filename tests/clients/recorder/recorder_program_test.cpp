#include "clients/recorder/recorder_program.h"

#include <atomic>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

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
#include "tests/idl/wire/range_server.h"

namespace tenon::recorder {
namespace {

/// The topics of a server that a recorder depends on.
class ServerMock {
 public:
  explicit ServerMock(std::uint32_t domain) : bus_(test::participant(domain)) {
    announce({});
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

  void announce(const std::string& scene_hash) {
    EXPECT_TRUE(announce_.write({.session = "class", .title = "Peg and box", .scene_hash = scene_hash}));
  }

  std::shared_ptr<wire::Participant> bus_;
  wire::Partition lobby_{bus_, wire::kLobby};
  wire::Partition session_{bus_, wire::sessionPartition("class")};
  wire::Writer<SessionAnnounce> announce_ =
      std::move(*wire::Writer<SessionAnnounce>::open(lobby_, wire::kSessionAnnounce));
  wire::Writer<Welcome> welcome_ = std::move(*wire::Writer<Welcome>::open(lobby_, wire::kWelcome));
  wire::Writer<SceneObject> objects_ =
      std::move(*wire::Writer<SceneObject>::open(session_, wire::kSceneObject));
  wire::Writer<ObjectSnapshot> snapshots_ =
      std::move(*wire::Writer<ObjectSnapshot>::open(session_, wire::kObjectSnapshot));
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

/// A recorder with an empty cache, of a session of one object with a display model.
class RecorderModelsTest : public RecorderProgramTest {
 protected:
  RecorderModelsTest() {
    options_.assets = folder_;
    options_.report = [this](const std::string& line) {
      lines_ += line + "\n";
      if (line.find("display models") != std::string::npos) is_said_ = true;
    };
    server_.announce(wire::assetName(bytesOf(list_)));
    ObjectSnapshot snapshot;
    snapshot.state.object = ObjectId{0};
    snapshot.state.status = static_cast<std::uint8_t>(ObjectStatus::kParked);
    EXPECT_TRUE(server_.snapshots_.write(snapshot));
  }
  ~RecorderModelsTest() override { std::filesystem::remove_all(folder_); }
  static std::vector<std::uint8_t> bytesOf(const std::string& text) { return {text.begin(), text.end()}; }
  void recordUntilModelsAreSaid() {
    start();
    ASSERT_TRUE(test::dispatchUntil(server_.inbox_, [&] { return server_.status_.recording && is_said_; }));
    ASSERT_TRUE(server_.run_.write({.phase = RunPhase::kSucceeded, .reason = "done"}));
    thread_.join();
    ASSERT_TRUE(result_) << result_.error().what;
  }

  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("recorder_cache_" + std::to_string(getpid()));
  const std::string model_ = "a model of a peg";
  const std::string list_ = R"({"objects":[[{"model":")" + wire::assetName(bytesOf(model_)) + R"("}]]})";
  std::string lines_;
  std::atomic<bool> is_said_{false};
};

TEST_F(RecorderModelsTest, ModelsThatItsCacheLacksComeFromAConsoleAtTheServer) {
  const test::RangeServer assets({bytesOf(list_), bytesOf(model_)});
  options_.assets_url = assets.url();
  recordUntilModelsAreSaid();
  EXPECT_THAT(lines_, testing::HasSubstr("fetched display models: 1"));
  EXPECT_THAT(result_->boxes, testing::IsEmpty());
  std::string newest;
  auto reader = record::McapReader::open(options_.file);
  for (record::McapMessage message; reader->next(message);)
    if (message.topic == "/scene/peg") newest.assign(message.data.begin(), message.data.end());
  EXPECT_THAT(newest, testing::HasSubstr(model_));
  EXPECT_EQ(reader->metadata().count("tenon models"), 0U);
}

TEST_F(RecorderModelsTest, WithoutThemItRecordsBoxesAndSaysSo) {
  options_.assets_url = "http://127.0.0.1:1";
  recordUntilModelsAreSaid();
  EXPECT_THAT(lines_, testing::HasSubstr("display models are not fetched, objects without them are boxes: "
                                         "http://127.0.0.1:1: does not answer"));
  EXPECT_THAT(result_->boxes, testing::ElementsAre("peg"));
  auto reader = record::McapReader::open(options_.file);
  ASSERT_EQ(reader->metadata().count("tenon models"), 1U);
  EXPECT_EQ(reader->metadata().find("tenon models")->second.at("missing"), "peg");
  EXPECT_EQ(counts().at("/scene/peg"), 1);
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
