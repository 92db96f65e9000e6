#pragma once

#include <string_view>

#include <dds/dds.h>

#include "idl/wire/topics.h"

/// DDS policies of a topic by QoS class and link profile. Internal to idl/wire.
namespace tenon::wire {

/// A Topic<M> without its C++ type.
struct TopicSpec {
  std::string_view name;
  const dds_topic_descriptor_t* type = nullptr;
  QosClass qos_class = QosClass::kStream;
  TopicParameters parameters;
};

/// The caller deletes the result with dds_delete_qos.
[[nodiscard]] dds_qos_t* participantQos(LinkProfile profile);
/// The caller deletes the result with dds_delete_qos.
[[nodiscard]] dds_qos_t* writerQos(const TopicSpec& topic, LinkProfile profile);
/// `keep_all`: all samples, streams included, are kept until they are taken; for recorders, in processes of
/// their own. The caller deletes the result with dds_delete_qos.
[[nodiscard]] dds_qos_t* readerQos(const TopicSpec& topic, LinkProfile profile, bool keep_all);

/// Cyclone DDS configurations: the texts of deploy/dds/{loopback,lan,wan}.xml, put in at build time.
[[nodiscard]] std::string_view loopbackConfig();
[[nodiscard]] std::string_view lanConfig();
[[nodiscard]] std::string_view wanConfig();

}  // namespace tenon::wire
