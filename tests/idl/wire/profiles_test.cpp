#include "idl/wire/profiles.h"

#include <chrono>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/messages.h"
#include "idl/wire/codec.h"
#include "idl/wire/convert.h"
#include "idl/wire/dds_endpoint.h"
#include "idl/wire/raw_subscriber.h"
#include "tests/idl/wire/peer.h"

namespace tenon::wire {
namespace {

// ---- which policies each topic has: the promises of idl/wire/topics.h, written out in words

const std::string kStream = "best effort, last 1, volatile";
const std::string kLast16 = "best effort, last 16, volatile";  // what the reader keeps
const std::string kLast32 = "best effort, last 32, volatile";
const std::string kLockstepStream = "reliable, last 32, volatile";
const std::string kLockstepFrames = "reliable, last 32, transient local";  // streams of a server
const std::string kState = "reliable, last 1, transient local";
const std::string kStateOfSeveral = "reliable, all, transient local";  // what the reader keeps
const std::string kEvent = "reliable, all, volatile";
const std::string kLateEvent = "reliable, all, transient local";
const std::string kLease1 = ", lease 1000 ms";
const std::string kLease2 = ", lease 2000 ms";
const std::string kLockstepLease = ", lease 5000 ms";

/// What a reader requests, in real time and in lockstep, and what a writer offers beyond it.
struct Row {
  std::string topic;
  std::string reader, lockstep_reader;
  std::string offered, lockstep_offered;
};

const std::vector<Row> kRows{
    {"SessionAnnounce", kState, kState, kLease2 + ", joiners 1", kLockstepLease + ", joiners 1"},
    {"Join", kEvent, kEvent, ", lifespan 5000 ms", ""},
    {"Welcome", kEvent, kEvent, ", lifespan 5000 ms", ""},
    {"Presence", kState, kState, kLease2 + ", joiners 1", kLockstepLease + ", joiners 1"},
    {"DeviceInput", kLast16, kLockstepStream, ", lease 100 ms by topic, deadline 50 ms", kLockstepLease},
    {"WorldFrame_1k", kStream, kLockstepFrames, kLease1, kLockstepLease + ", joiners 1"},
    {"WorldFrame_100", kStream, kLockstepFrames, kLease1, kLockstepLease + ", joiners 1"},
    {"WorldFrame_30", kStream, kLockstepFrames, kLease1, kLockstepLease + ", joiners 1"},
    {"HandManifold", kLast32, kLockstepFrames, kLease1 + ", deadline 100 ms", kLockstepLease + ", joiners 1"},
    {"HandManifold_50", kLast32, kLockstepFrames, kLease1 + ", deadline 100 ms",
     kLockstepLease + ", joiners 1"},
    {"HandState_100", kStream, kLockstepStream, kLease1, kLockstepLease},
    {"ContactPairs_100", kStream, kLockstepFrames, kLease1, kLockstepLease + ", joiners 1"},
    {"TickStats_100", kStream, kLockstepFrames, kLease1, kLockstepLease + ", joiners 1"},
    {"Guidance", kStream, kLockstepFrames, kLease1, kLockstepLease + ", joiners 1"},
    {"ForceContribution", kStream, kLockstepStream, "", ""},
    {"ExternalPose", kStream, kLockstepStream, "", ""},
    {"ClockSync", kStream, kLockstepStream, "", ""},
    {"Telemetry", kStream, kLockstepStream, "", ""},
    {"SceneObject", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"SceneHand", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"SceneStep", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"SceneTitle", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"SceneSignal", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"ObjectSnapshot", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"StepState", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"StepProgress", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"RunState", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"GrabState", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"CollisionMatrix", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"RecorderStatus", kState, kState, ", joiners 1", ", joiners 1"},
    {"EmergencyStop", kStateOfSeveral, kStateOfSeveral, ", joiners 1, outlives its writer",
     ", joiners 1, outlives its writer"},
    {"EmergencyClear", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"NewestRaise", kStateOfSeveral, kStateOfSeveral, ", joiners 1", ", joiners 1"},
    {"Command", kEvent, kEvent, ", lifespan 5000 ms", ""},
    {"CommandAck", kEvent, kEvent, ", lifespan 5000 ms", ""},
    {"EventLog", kLateEvent, kLateEvent, ", joiners 1000", ", joiners 1000"},
    {"ClientEvent", kLateEvent, kLateEvent, ", joiners 1000", ", joiners 1000"},
    {"PublishedSamples", kLateEvent, kLateEvent, ", joiners 8", ", joiners 8"},
    {"TickInput", kLateEvent, kLateEvent, ", joiners 4096", ", joiners 4096"},
    {"Checkpoint", kLateEvent, kLateEvent, ", joiners 1", ", joiners 1"},
};

/// A lockstep writer keeps every sample until all its readers have it.
std::string keepingAll(std::string delivery) {
  const std::size_t at = delivery.find("last ");
  return at == std::string::npos ? delivery : delivery.replace(at, delivery.find(',', at) - at, "all");
}

// ---- what DDS says that an entity has

using Qos = std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)>;

Qos effectiveQos(dds_entity_t entity) {
  Qos qos(dds_create_qos(), &dds_delete_qos);
  EXPECT_EQ(dds_get_qos(entity, qos.get()), DDS_RETCODE_OK);
  return qos;
}

std::string inMilliseconds(dds_duration_t time) { return std::to_string(time / DDS_NSECS_IN_MSEC) + " ms"; }

std::string delivery(const dds_qos_t* qos) {
  dds_reliability_kind_t reliability{};
  dds_history_kind_t history{};
  dds_durability_kind_t durability{};
  dds_destination_order_kind_t order{};
  dds_duration_t blocking = 0;
  std::int32_t depth = 0;
  dds_qget_reliability(qos, &reliability, &blocking);
  dds_qget_history(qos, &history, &depth);
  dds_qget_durability(qos, &durability);
  dds_qget_destination_order(qos, &order);
  std::string said = reliability == DDS_RELIABILITY_RELIABLE ? "reliable" : "best effort";
  said += history == DDS_HISTORY_KEEP_ALL ? ", all" : ", last " + std::to_string(depth);
  said += durability == DDS_DURABILITY_VOLATILE          ? ", volatile"
          : durability == DDS_DURABILITY_TRANSIENT_LOCAL ? ", transient local"
                                                         : ", another durability";
  if (order == DDS_DESTINATIONORDER_BY_SOURCE_TIMESTAMP) said += ", by source time";
  return said;
}

std::string timing(const dds_qos_t* qos) {
  std::string said;
  dds_liveliness_kind_t liveliness{};
  dds_duration_t lease = 0;
  dds_duration_t deadline = 0;
  dds_qget_liveliness(qos, &liveliness, &lease);
  if (lease != DDS_INFINITY) said += ", lease " + inMilliseconds(lease);
  if (liveliness != DDS_LIVELINESS_AUTOMATIC) said += " by topic";
  dds_qget_deadline(qos, &deadline);
  if (deadline != DDS_INFINITY) said += ", deadline " + inMilliseconds(deadline);
  return said;
}

/// Of policies that writers alone have.
std::string ofWriter(const dds_qos_t* qos) {
  std::string said;
  dds_duration_t lifespan = 0;
  dds_qget_lifespan(qos, &lifespan);
  if (lifespan != DDS_INFINITY) said += ", lifespan " + inMilliseconds(lifespan);
  dds_durability_kind_t durability{};
  dds_qget_durability(qos, &durability);
  if (durability == DDS_DURABILITY_TRANSIENT_LOCAL) {
    std::int32_t joiners = 0;
    dds_qget_durability_service(qos, nullptr, nullptr, &joiners, nullptr, nullptr, nullptr);
    said += ", joiners " + std::to_string(joiners);
  }
  bool disposes = true;
  dds_qget_writer_data_lifecycle(qos, &disposes);
  if (!disposes) said += ", outlives its writer";
  return said;
}

dds_duration_t blockingTime(const dds_qos_t* qos) {
  dds_reliability_kind_t reliability{};
  dds_duration_t blocking = 0;
  dds_qget_reliability(qos, &reliability, &blocking);
  return blocking;
}

class ProfilesTest : public ::testing::Test {
 protected:
  Partition partition(const char* name, LinkProfile profile) { return {participant_, name, profile}; }

  std::shared_ptr<Participant> participant_ = test::participant(test::ownDomain());
  Partition lan_ = partition("s/lan", LinkProfile::kLan);
  Partition lockstep_ = partition("s/lockstep", LinkProfile::kLockstep);

  std::string writerOn(const Partition& partition, const TopicSpec& topic) {
    const auto writer = openWriter(partition, topic);
    if (!writer) return writer.error().what;
    const Qos qos = effectiveQos((*writer)->entity());
    return delivery(qos.get()) + timing(qos.get()) + ofWriter(qos.get());
  }
  std::string readerOn(const Partition& partition, const TopicSpec& topic, bool keep_all) {
    const auto reader = openReader(partition, topic, keep_all, nullptr);
    if (!reader) return reader.error().what;
    const Qos qos = effectiveQos((*reader)->entity());
    return delivery(qos.get()) + timing(qos.get());
  }
  static std::vector<TopicSpec> topics() {
    std::vector<TopicSpec> list;
    forEachTopic([&list]<class M>(const Topic<M>& topic) {
      list.push_back({topic.name, &TypeOf<M>::descriptor(), topic.qos_class, topic.parameters});
    });
    return list;
  }
};

TEST_F(ProfilesTest, EntitiesOfEveryTopicHaveThePoliciesOfItsClassOnBothLinks) {
  std::set<std::string> listed;
  for (const Row& row : kRows) listed.insert(row.topic);
  std::set<std::string> there;
  for (const TopicSpec& topic : topics()) {
    there.emplace(topic.name);
    for (const Row& row : kRows) {
      if (row.topic != topic.name) continue;
      const bool is_state =
          topic.qos_class == QosClass::kState;  // of those with several writers, readers keep all
      EXPECT_EQ(writerOn(lan_, topic), (is_state                                         ? kState
                                        : row.reader == kLast16 || row.reader == kLast32 ? kStream
                                                                                         : row.reader) +
                                           row.offered)
          << topic.name;
      EXPECT_EQ(readerOn(lan_, topic, false), row.reader) << topic.name;
      EXPECT_EQ(writerOn(lockstep_, topic), keepingAll(row.lockstep_reader) + row.lockstep_offered)
          << topic.name;
      EXPECT_EQ(readerOn(lockstep_, topic, false), row.lockstep_reader) << topic.name;
    }
  }
  EXPECT_EQ(there, listed);
}

TEST_F(ProfilesTest, ARecorderKeepsAllSamplesOfEveryTopic) {
  for (const TopicSpec& topic : topics()) {
    for (const Partition* partition : {&lan_, &lockstep_})
      EXPECT_NE(readerOn(*partition, topic, true).find(", all, "), std::string::npos) << topic.name;
  }
}

TEST_F(ProfilesTest, WritersUseXcdr1AndWaitLongerForASlowReaderInLockstep) {
  for (const TopicSpec& topic : topics()) {
    const auto on_lan = openWriter(lan_, topic);
    const auto in_lockstep = openWriter(lockstep_, topic);
    ASSERT_TRUE(on_lan && in_lockstep) << topic.name;
    const Qos lan = effectiveQos((*on_lan)->entity());
    const Qos lockstep = effectiveQos((*in_lockstep)->entity());
    EXPECT_LT(blockingTime(lan.get()), blockingTime(lockstep.get())) << topic.name;
    for (const Qos* qos : {&lan, &lockstep}) {
      std::uint32_t count = 0;
      dds_data_representation_id_t* values = nullptr;
      ASSERT_TRUE(dds_qget_data_representation(qos->get(), &count, &values));
      ASSERT_EQ(count, 1U) << topic.name;
      EXPECT_EQ(values[0], DDS_DATA_REPRESENTATION_XCDR1) << topic.name;
      dds_free(values);
    }
  }
}

// Join and Command are written by threads that wait for the answer, all others where stops are heard as well.
TEST_F(ProfilesTest, NoWriteButARequestWaitsLongForASlowReader) {
  for (const TopicSpec& topic : topics()) {
    const auto writer = openWriter(lan_, topic);
    ASSERT_TRUE(writer) << topic.name;
    const bool is_request = topic.name == std::string("Join") || topic.name == std::string("Command");
    EXPECT_EQ(inMilliseconds(blockingTime(effectiveQos((*writer)->entity()).get())),
              is_request ? "500 ms" : "5 ms")
        << topic.name;
  }
  // whatever else a topic has: its own parameter alone says so
  TopicSpec other{wire::kCommand.name, &TypeOf<Command>::descriptor(), wire::kCommand.qos_class,
                  wire::kCommand.parameters};
  other.parameters.request = false;
  const auto writer = openWriter(lan_, other);
  ASSERT_TRUE(writer);
  EXPECT_EQ(inMilliseconds(blockingTime(effectiveQos((*writer)->entity()).get())), "5 ms");
}

// ---- what follows from some of them

/// Writers and readers of one topic in a partition of their own, matched.
template <class M>
struct Matched {
  Matched(Partition& partition, const Topic<M>& topic)
      : reader(*Reader<M>::open(partition, topic)), writer(*Writer<M>::open(partition, topic)) {
    while (reader.matchedWriters() == 0 || writer.matchedReaders() == 0) std::this_thread::yield();
  }
  Reader<M> reader;
  Writer<M> writer;
};

TEST_F(ProfilesTest, AnExpiredCommandIsNotDeliveredInRealTimeAndIsInLockstep) {
  Topic<Command> topic = wire::kCommand;
  topic.parameters.lifespan = Milliseconds(10);
  Matched<Command> on_lan(lan_, topic);
  Matched<Command> in_lockstep(lockstep_, topic);
  ASSERT_TRUE(on_lan.writer.write({.id = 1}));
  ASSERT_TRUE(in_lockstep.writer.write({.id = 1}));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  Command command;
  EXPECT_FALSE(on_lan.reader.take(command));
  EXPECT_TRUE(in_lockstep.reader.take(command));
}

TEST_F(ProfilesTest, AReaderWhoTakesLateGetsTheLast16InputsInRealTimeAndTheLast32InLockstep) {
  Matched<DeviceInput> on_lan(lan_, wire::kDeviceInput);
  Matched<DeviceInput> in_lockstep(lockstep_, wire::kDeviceInput);
  DeviceInput input;
  for (input.sample.seq = 1; input.sample.seq <= 40; ++input.sample.seq) {
    ASSERT_TRUE(on_lan.writer.write(input));
    ASSERT_TRUE(in_lockstep.writer.write(input));
  }
  for (Tick expected = 25; expected <= 40; ++expected) {
    ASSERT_TRUE(on_lan.reader.take(input));
    EXPECT_EQ(input.sample.seq, expected);
  }
  EXPECT_FALSE(on_lan.reader.take(input));
  for (Tick expected = 9; expected <= 40; ++expected) {
    ASSERT_TRUE(in_lockstep.reader.take(input));
    EXPECT_EQ(input.sample.seq, expected);
  }
  EXPECT_FALSE(in_lockstep.reader.take(input));
}

TEST_F(ProfilesTest, AStationWhoseLoopHangsIsGoneInRealTimeAndStaysInLockstep) {
  Inbox inbox;
  int gone_on_lan = 0;
  int gone_in_lockstep = 0;
  ASSERT_TRUE(inbox.onGone<DeviceInput>(lan_, wire::kDeviceInput, [&](const auto&) { ++gone_on_lan; }));
  ASSERT_TRUE(
      inbox.onGone<DeviceInput>(lockstep_, wire::kDeviceInput, [&](const auto&) { ++gone_in_lockstep; }));
  auto on_lan = Writer<DeviceInput>::open(lan_, wire::kDeviceInput);
  auto in_lockstep = Writer<DeviceInput>::open(lockstep_, wire::kDeviceInput);
  ASSERT_TRUE(on_lan->write({}));
  ASSERT_TRUE(in_lockstep->write({}));
  // both writers and their process live on, but write nothing
  EXPECT_TRUE(test::dispatchUntil(inbox, [&] { return gone_on_lan > 0; }));
  EXPECT_EQ(gone_in_lockstep, 0);
}

TEST_F(ProfilesTest, ALateInputMissesItsDeadlineInRealTimeAlone) {
  const auto topic = TopicSpec{wire::kDeviceInput.name, &TypeOf<DeviceInput>::descriptor(),
                               wire::kDeviceInput.qos_class, wire::kDeviceInput.parameters};
  const auto missed = [](dds_entity_t writer) {
    dds_offered_deadline_missed_status_t status{};
    EXPECT_EQ(dds_get_offered_deadline_missed_status(writer, &status), DDS_RETCODE_OK);
    return status.total_count;
  };
  const auto on_lan = openWriter(lan_, topic);
  const auto in_lockstep = openWriter(lockstep_, topic);
  const auto sample = std::make_unique<Wire<DeviceInput>>();
  ASSERT_TRUE(toWire(DeviceInput{}, *sample));
  ASSERT_EQ(dds_write((*on_lan)->entity(), &sample->sample), DDS_RETCODE_OK);
  ASSERT_EQ(dds_write((*in_lockstep)->entity(), &sample->sample), DDS_RETCODE_OK);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_GT(missed((*on_lan)->entity()), 0U);
  EXPECT_EQ(missed((*in_lockstep)->entity()), 0U);
}

}  // namespace
}  // namespace tenon::wire
