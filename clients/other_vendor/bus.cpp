#include "clients/other_vendor/bus.h"

#include <memory>

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

namespace tenon::other_vendor {
namespace {

constexpr const char* kLoopback = "127.0.0.1";
// as deploy/dds/loopback.xml: so many participants are found by unicast, at port 7410 + 250 domain + 2 i
constexpr std::uint32_t kMostParticipants = 120;

eprosima::fastrtps::Duration_t duration(std::chrono::milliseconds time) {
  return {static_cast<std::int32_t>(time.count() / 1000),
          static_cast<std::uint32_t>(time.count() % 1000) * 1000000U};
}

/// UDP on the loopback interface alone, without multicast and shared memory: Cyclone DDS has neither there.
dds::DomainParticipantQos loopbackQos() {
  auto transport = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  transport->interfaceWhiteList = {kLoopback};
  transport->maxInitialPeersRange = kMostParticipants;
  dds::DomainParticipantQos qos = dds::PARTICIPANT_QOS_DEFAULT;
  qos.name("tenon-other-vendor");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(transport);
  eprosima::fastrtps::rtps::Locator_t here;  // port 0: the one that follows from domain and participant
  eprosima::fastrtps::rtps::IPLocator::setIPv4(here, kLoopback);
  auto& builtin = qos.wire_protocol().builtin;
  builtin.initialPeersList.push_back(here);
  builtin.metatrafficUnicastLocatorList.push_back(here);  // so that it does not listen for multicast
  builtin.discovery_config.leaseDuration = {2, 0};
  builtin.discovery_config.leaseDuration_announcementperiod = {1, 0};
  return qos;
}

/// Reliability, durability and data representation, of readers and of writers; no limits of their own.
template <class Qos>
void setCommon(Qos& qos, TopicClass topic_class) {
  const bool is_stream = topic_class == TopicClass::kStream, is_state = topic_class == TopicClass::kState;
  qos.reliability().kind = is_stream ? dds::BEST_EFFORT_RELIABILITY_QOS : dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = is_state ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.resource_limits().max_samples = 0;
  qos.resource_limits().max_instances = 0;
  qos.resource_limits().max_samples_per_instance = 0;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.data_sharing().off();
}

}  // namespace

dds::DataReaderQos readerQos(TopicClass topic_class) {
  dds::DataReaderQos qos = dds::DATAREADER_QOS_DEFAULT;
  setCommon(qos, topic_class);
  const bool is_stream = topic_class == TopicClass::kStream;
  qos.history().kind = is_stream ? dds::KEEP_LAST_HISTORY_QOS : dds::KEEP_ALL_HISTORY_QOS;
  qos.history().depth = 1;
  return qos;
}

dds::DataWriterQos writerQos(TopicClass topic_class, const WriterLimits& limits) {
  dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
  setCommon(qos, topic_class);
  const bool is_event = topic_class == TopicClass::kEvent;
  qos.history().kind = is_event ? dds::KEEP_ALL_HISTORY_QOS : dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 1;
  qos.representation().m_value = {dds::XCDR_DATA_REPRESENTATION};
  if (limits.lease.count() > 0) {
    qos.liveliness().lease_duration = duration(limits.lease);
    qos.liveliness().announcement_period = duration(limits.lease / 2);
  }
  if (limits.lifespan.count() > 0) qos.lifespan().duration = duration(limits.lifespan);
  return qos;
}

Bus::Bus(std::uint32_t domain)
    : participant_(dds::DomainParticipantFactory::get_instance()->create_participant(domain, loopbackQos())) {
  if (participant_ == nullptr)
    throw std::runtime_error("DDS domain " + std::to_string(domain) + " cannot be joined on loopback");
}

Bus::~Bus() {
  participant_->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

BusPartition Bus::partition(const std::string& name) {
  dds::PublisherQos publisher = dds::PUBLISHER_QOS_DEFAULT;
  dds::SubscriberQos subscriber = dds::SUBSCRIBER_QOS_DEFAULT;
  publisher.partition().push_back(name.c_str());
  subscriber.partition().push_back(name.c_str());
  const BusPartition partition{participant_->create_publisher(publisher),
                               participant_->create_subscriber(subscriber)};
  if (partition.publisher == nullptr || partition.subscriber == nullptr)
    throw std::runtime_error("partition '" + name + "' cannot be opened");
  return partition;
}

dds::Topic* Bus::topic(const std::string& name, const dds::TypeSupport& type) {
  participant_->register_type(type);
  dds::Topic* const topic = participant_->create_topic(name, type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  if (topic == nullptr) throw std::runtime_error("topic '" + name + "' cannot be created");
  return topic;
}

void Bus::watch(dds::DataReader* reader) {
  dds::StatusCondition& condition = reader->get_statuscondition();
  condition.set_enabled_statuses(dds::StatusMask::data_available());
  readers_.attach_condition(condition);
}

void Bus::wait(std::chrono::milliseconds timeout) {
  dds::ConditionSeq with_samples;
  readers_.wait(with_samples, duration(timeout));
}

}  // namespace tenon::other_vendor
