#include "idl/wire/endpoint.h"

#include <algorithm>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "idl/wire/raw_subscriber.h"
#include "tests/idl/wire/peer.h"
#include "tests/idl/wire/random_messages.h"

namespace tenon::wire {
namespace {

class EndpointTest : public ::testing::Test {
 protected:
  std::shared_ptr<Participant> participant_ = test::participant(test::ownDomain());
  std::shared_ptr<Participant> other_participant_ = test::participant(test::ownDomain());
  Partition here_{participant_, "s/test"};
  Partition there_{other_participant_, "s/test"};
  Inbox inbox_;
};

TEST_F(EndpointTest, ALateJoinerGetsTheLastStateOfEachKeyAndNoStreamSample) {
  auto grabs = Writer<GrabState>::open(here_, kGrabState);
  auto frames = Writer<WorldFrame>::open(here_, kWorldFrame1k);
  for (std::uint32_t i = 0; i < 6; ++i) {
    GrabState grab;
    grab.object = ObjectId{i % 2};
    grab.epoch = i;
    ASSERT_TRUE(grabs->write(grab));
    ASSERT_TRUE(frames->write({}));
  }
  std::vector<std::uint32_t> epochs;
  int late_frames = 0;
  ASSERT_TRUE(inbox_.on<WorldFrame>(there_, kWorldFrame1k, [&](const WorldFrame&) { ++late_frames; }));
  ASSERT_TRUE(
      inbox_.on<GrabState>(there_, kGrabState, [&](const GrabState& grab) { epochs.push_back(grab.epoch); }));
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return epochs.size() == 2; }));
  std::sort(epochs.begin(), epochs.end());
  EXPECT_EQ(epochs, (std::vector<std::uint32_t>{4, 5}));
  EXPECT_EQ(late_frames, 0);
}

TEST_F(EndpointTest, ALateJoinerGetsTheLastThousandEventsInOrder) {
  auto log = Writer<EventLog>::open(here_, kEventLog);
  for (std::uint64_t seq = 1; seq <= 1500; ++seq) {
    EventLog event;
    event.seq = seq;
    ASSERT_TRUE(log->write(event));
  }
  std::vector<std::uint64_t> received;
  ASSERT_TRUE(
      inbox_.on<EventLog>(there_, kEventLog, [&](const EventLog& event) { received.push_back(event.seq); }));
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return received.size() >= 1000; }));
  ASSERT_EQ(received.size(), 1000U);
  for (std::size_t i = 0; i < received.size(); ++i) EXPECT_EQ(received[i], 501 + i);
}

TEST_F(EndpointTest, EveryEventArrives) {
  int received = 0;
  ASSERT_TRUE(inbox_.on<Command>(there_, kCommand, [&](const Command&) { ++received; }));
  auto commands = Writer<Command>::open(here_, kCommand);
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return commands->matchedReaders() == 1; }));
  for (std::uint32_t id = 0; id < 500; ++id) ASSERT_TRUE(commands->write({.client = ClientId{1}, .id = id}));
  EXPECT_TRUE(test::dispatchUntil(inbox_, [&] { return received == 500; }));
}

TEST_F(EndpointTest, AReaderInAnotherPartitionReceivesNothing) {
  Partition elsewhere(other_participant_, "s/other");
  auto grabs = Writer<GrabState>::open(here_, kGrabState);
  ASSERT_TRUE(grabs->write({}));
  int received_there = 0;
  int received_elsewhere = 0;
  ASSERT_TRUE(inbox_.on<GrabState>(elsewhere, kGrabState, [&](const GrabState&) { ++received_elsewhere; }));
  ASSERT_TRUE(inbox_.on<GrabState>(there_, kGrabState, [&](const GrabState&) { ++received_there; }));
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return received_there == 1; }));
  EXPECT_EQ(received_elsewhere, 0);
}

TEST_F(EndpointTest, ADisposedInstanceIsReportedAsGoneAndOthersStay) {
  auto objects = Writer<SceneObject>::open(here_, kSceneObject);
  for (std::uint32_t id = 0; id < 3; ++id)
    ASSERT_TRUE(objects->write({.object = ObjectId{id}, .name = "part"}));
  std::vector<ObjectId> gone;
  int received = 0;
  ASSERT_TRUE(inbox_.on<SceneObject>(there_, kSceneObject, [&](const SceneObject&) { ++received; }));
  ASSERT_TRUE(inbox_.onGone<SceneObject>(there_, kSceneObject,
                                         [&](const SceneObject& key) { gone.push_back(key.object); }));
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return received == 3; }));
  ASSERT_TRUE(objects->dispose({.object = ObjectId{1}}));
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return !gone.empty(); }));
  EXPECT_EQ(gone, std::vector<ObjectId>{ObjectId{1}});
}

TEST_F(EndpointTest, AnEmergencyStopOutlivesItsWriter) {
  bool engaged = false;
  bool gone = false;
  ASSERT_TRUE(inbox_.on<EmergencyStop>(
      there_, kEmergencyStop, [&](const EmergencyStop& stop) { engaged = stop.who == "instructor"; }));
  ASSERT_TRUE(
      inbox_.onGone<EmergencyStop>(there_, kEmergencyStop, [&](const EmergencyStop&) { gone = true; }));
  {
    auto stops = Writer<EmergencyStop>::open(here_, kEmergencyStop);
    ASSERT_TRUE(stops->write({.client_guid = "a", .counter = 1, .who = "instructor", .reason = "test"}));
    ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return engaged; }));
  }
  inbox_.dispatch(std::chrono::milliseconds(100));
  EXPECT_TRUE(engaged);
  EXPECT_FALSE(gone);
}

// a server and a station have one raise, and who raised it looks for the server among them
TEST_F(EndpointTest, EveryRepetitionOfAnEmergencyStopIsReadHoweverLate) {
  std::vector<Origin> origins;
  ASSERT_TRUE(inbox_.onFrom<EmergencyStop>(
      there_, kEmergencyStop, [&](const EmergencyStop&, const Origin& from) { origins.push_back(from); }));
  auto server = Writer<EmergencyStop>::open(here_, kEmergencyStop);
  auto station = Writer<EmergencyStop>::open(there_, kEmergencyStop);
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return inbox_.matchedWriters() == 2; }));
  for (auto* writer : {&*server, &*station}) {
    ASSERT_TRUE(writer->write({.client_guid = "a", .counter = 1, .who = "instructor", .reason = "test"}));
    ASSERT_TRUE(writer->waitForReaders(std::chrono::seconds(10)));  // and it has not been taken
  }
  ASSERT_TRUE(test::dispatchUntil(inbox_, [&] { return origins.size() == 2; }));
  EXPECT_EQ(origins[0], participant_->origin());
  EXPECT_EQ(origins[1], other_participant_->origin());
}

TEST_F(EndpointTest, AReaderTakesSamplesOneByOne) {
  auto reader = Reader<RunState>::open(there_, kRunState);
  auto writer = Writer<RunState>::open(here_, kRunState);
  ASSERT_TRUE(writer->write({.phase = RunPhase::kRunning, .reason = "go"}));
  RunState state;
  while (!reader->take(state)) std::this_thread::yield();
  EXPECT_EQ(state.phase, RunPhase::kRunning);
  EXPECT_EQ(state.reason, "go");
  EXPECT_FALSE(reader->take(state));
}

TEST_F(EndpointTest, WakeEndsTheWaiting) {
  std::thread waker([this] { inbox_.wake(); });
  inbox_.dispatch(std::chrono::hours(1));
  waker.join();
}

TEST_F(EndpointTest, AMissingConfigurationFileIsAnErrorThatNamesIt) {
  const auto opened = Participant::open({.domain = 7, .config = "no/such/file.xml"});
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().what, "no/such/file.xml: there is no such DDS configuration file");
}

const std::string kWrongConfig = "<CycloneDDS><Domain><Nonsense/></Domain></CycloneDDS>";

TEST(ParticipantTest, AWrongConfigurationIsAnError) {
  const std::uint32_t domain = test::ownDomain();
  const auto opened = Participant::open({.domain = domain, .config = kWrongConfig});
  ASSERT_FALSE(opened);
  EXPECT_TRUE(
      opened.error().what.starts_with("DDS domain " + std::to_string(domain) + " could not be opened: "))
      << opened.error().what;
  EXPECT_NE(opened.error().what.find("Nonsense"), std::string::npos) << opened.error().what;
}

// DDS reads the configuration of a domain with the process's first participant there, and no later one
TEST_F(EndpointTest, AnotherConfigurationOfADomainThatIsOpenIsAnError) {
  const auto opened = Participant::open({.domain = test::ownDomain(), .config = kWrongConfig});
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().what.find("this process has it open with another configuration"),
            std::string::npos)
      << opened.error().what;
}

TEST_F(EndpointTest, ATextThatIsTooLongIsNotWritten) {
  auto log = Writer<EventLog>::open(here_, kEventLog);
  const auto written = log->write({.text = std::string(2000, 'x')});
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().what.find("'text' has 2000"), std::string::npos) << written.error().what;
}

TEST_F(EndpointTest, ARawSubscriberGivesTheBytesOfEncodeAndDisposals) {
  auto subscriber = RawSubscriber::open(there_);
  ASSERT_TRUE(subscriber) << subscriber.error().what;
  auto snapshots = Writer<ObjectSnapshot>::open(here_, kObjectSnapshot);
  while (snapshots->matchedReaders() == 0) std::this_thread::yield();
  const auto sent = test::RandomMessages(9).make<ObjectSnapshot>();
  ASSERT_TRUE(snapshots->write(sent));
  ASSERT_TRUE(snapshots->dispose(sent));
  std::vector<std::uint8_t> bytes;
  bool gone = false;
  while (!gone) {
    subscriber->dispatch(std::chrono::milliseconds(50), [&](const RawSample& sample) {
      EXPECT_EQ(sample.topic, "ObjectSnapshot");
      EXPECT_EQ(sample.type, "tenon::ObjectSnapshot");
      EXPECT_GT(sample.source_ns, 0);
      if (!sample.gone) bytes.assign(sample.bytes.begin(), sample.bytes.end());
      if (sample.gone) {
        gone = true;
        EXPECT_EQ(decode<ObjectSnapshot>(sample.bytes)->state.object, sent.state.object);
      }
    });
  }
  EXPECT_EQ(bytes, *encode(sent));
}

TEST_F(EndpointTest, ARecordedSampleIsReplayedWithItsTimeAndBytes) {
  Partition replay(participant_, "replay/test");
  Partition watcher(other_participant_, "replay/test");
  auto subscriber = RawSubscriber::open(watcher, {"EventLog"});
  auto writer = RawWriter::open(replay, "EventLog");
  ASSERT_TRUE(subscriber);
  ASSERT_TRUE(writer);
  EventLog event;
  event.text = "as it was";
  const auto bytes = encode(event);
  ASSERT_TRUE(writer->write({.source_ns = 1'234'567'890'123, .bytes = *bytes}));
  std::size_t count = 0;
  while (count == 0) {
    count = subscriber->dispatch(std::chrono::milliseconds(50), [&](const RawSample& sample) {
      EXPECT_EQ(sample.source_ns, 1'234'567'890'123);
      EXPECT_TRUE(std::equal(sample.bytes.begin(), sample.bytes.end(), bytes->begin(), bytes->end()));
    });
  }
  EXPECT_EQ(count, 1U);
}

TEST_F(EndpointTest, ARawWriterRefusesBytesThatAreNoSampleOfItsTopic) {
  auto writer = RawWriter::open(here_, "EventLog");
  const std::vector<std::uint8_t> bytes{0, 1, 0, 0, 1, 2, 3};
  const auto written = writer->write({.bytes = bytes});
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().what, "7 bytes are not a tenon::EventLog");
  EXPECT_FALSE(RawWriter::open(here_, "NoSuchTopic"));
}

}  // namespace
}  // namespace tenon::wire
