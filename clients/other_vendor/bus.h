#pragma once

#include <chrono>
#include <functional>
#include <stdexcept>
#include <string>

#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

/// Tenon's bus as Fast DDS reaches it: a participant on the loopback interface, partitions, typed readers and
/// writers. Whatever fails throws std::runtime_error with a sentence.
namespace tenon::other_vendor {

namespace dds = eprosima::fastdds::dds;
using SampleOrigin = eprosima::fastrtps::rtps::GuidPrefix_t;  ///< the participant that wrote a sample

/// The quality of service of a topic: the second word after `//@topic` in idl/tenon.idl.
///
/// |        | reliability | durability      | history of writer, reader | late joiners get           |
/// |--------|-------------|-----------------|---------------------------|----------------------------|
/// | stream | best effort | volatile        | keep last 1, keep last 1  | nothing                    |
/// | state  | reliable    | transient local | keep last 1, keep all     | the last sample of each key |
/// | event  | reliable    | volatile        | keep all, keep all        | nothing                    |
///
/// Events with `late_joiner_depth` are transient local, too. Readers ask for no deadline and no lease, so
/// that those never prevent a match; in a session in lockstep streams are offered as reliable, which matches
/// too.
enum class TopicClass { kStream, kState, kEvent };

/// The third and later words that a writer has to offer.
struct WriterLimits {
  std::chrono::milliseconds lease{0};  ///< [ms] without sign of life for so long its instances end; 0: none
  std::chrono::milliseconds lifespan{0};  ///< [ms] older samples are not delivered; 0: none
};

[[nodiscard]] dds::DataReaderQos readerQos(TopicClass topic_class);
[[nodiscard]] dds::DataWriterQos writerQos(TopicClass topic_class, const WriterLimits& limits);

/// Of one session: "s/NAME"; where sessions are announced and joined: "lobby".
struct BusPartition {
  dds::Publisher* publisher = nullptr;
  dds::Subscriber* subscriber = nullptr;
};

/// The participant. Deletes all readers and writers at its end.
///
/// Threads: one. Real-time: no.
class Bus {
 public:
  explicit Bus(std::uint32_t domain);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  [[nodiscard]] BusPartition partition(const std::string& name);
  /// The topic of this name, whose samples have the fully scoped type name of the IDL, as tenon::WorldFrame.
  [[nodiscard]] dds::Topic* topic(const std::string& name, const dds::TypeSupport& type);
  /// Waits until a reader has samples, or the timeout.
  void wait(std::chrono::milliseconds timeout);
  void watch(dds::DataReader* reader);
  void forget(dds::DataReader* reader) { readers_.detach_condition(reader->get_statuscondition()); }

 private:
  dds::DomainParticipant* participant_ = nullptr;
  dds::WaitSet readers_;
};

/// Samples of the type that fastddsgen has made PubSubType for.
template <class PubSubType>
class BusReader {
 public:
  using Sample = typename PubSubType::type;

  BusReader(Bus& bus, const BusPartition& partition, const std::string& topic, TopicClass topic_class)
      : bus_(bus),
        partition_(partition),
        reader_(partition.subscriber->create_datareader(bus.topic(topic, dds::TypeSupport(new PubSubType())),
                                                        readerQos(topic_class))) {
    if (reader_ == nullptr) throw std::runtime_error("topic '" + topic + "' cannot be read");
    bus.watch(reader_);
  }
  ~BusReader() {
    bus_.forget(reader_);
    partition_.subscriber->delete_datareader(reader_);
  }
  BusReader(const BusReader&) = delete;
  BusReader& operator=(const BusReader&) = delete;

  /// Calls `handle` for each sample that has arrived.
  void take(const std::function<void(const Sample&, const SampleOrigin&)>& handle) {
    Sample sample;
    dds::SampleInfo info;
    while (reader_->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) handle(sample, info.sample_identity.writer_guid().guidPrefix);
  }

  [[nodiscard]] bool isMatched() const {
    dds::SubscriptionMatchedStatus status;
    reader_->get_subscription_matched_status(status);
    return status.current_count > 0;
  }

 private:
  Bus& bus_;
  BusPartition partition_;
  dds::DataReader* reader_;
};

template <class PubSubType>
class BusWriter {
 public:
  using Sample = typename PubSubType::type;

  BusWriter(Bus& bus, const BusPartition& partition, const std::string& topic, TopicClass topic_class,
            const WriterLimits& limits)
      : partition_(partition),
        writer_(partition.publisher->create_datawriter(bus.topic(topic, dds::TypeSupport(new PubSubType())),
                                                       writerQos(topic_class, limits))) {
    if (writer_ == nullptr) throw std::runtime_error("topic '" + topic + "' cannot be written");
  }
  ~BusWriter() { partition_.publisher->delete_datawriter(writer_); }
  BusWriter(const BusWriter&) = delete;
  BusWriter& operator=(const BusWriter&) = delete;

  void write(Sample& sample) {
    if (!writer_->write(&sample)) throw std::runtime_error("a sample could not be written");
  }
  /// Ends the instance with the key of this sample, and waits until the readers know.
  void dispose(Sample& sample) {
    writer_->dispose(&sample, dds::InstanceHandle_t());
    writer_->wait_for_acknowledgments({1, 0});
  }

  [[nodiscard]] bool isMatched() const {
    dds::PublicationMatchedStatus status;
    writer_->get_publication_matched_status(status);
    return status.current_count > 0;
  }

 private:
  BusPartition partition_;
  dds::DataWriter* writer_;
};

}  // namespace tenon::other_vendor
