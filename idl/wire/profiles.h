#pragma once

#include <string>
#include <string_view>

#include <dds/dds.h>

#include "idl/wire/endpoint.h"

/// How a promise becomes DDS quality of service on a link. Internal to idl/wire.
namespace tenon::wire {

/// A topic without its message type: what opening an endpoint needs.
struct TopicSpec {
  std::string_view name;
  const dds_topic_descriptor_t* type = nullptr;
  Promise promise = Promise::kStream;
  TopicParameters parameters;
};

/// Delete with dds_delete_qos.
[[nodiscard]] dds_qos_t* writerQos(const TopicSpec& topic, LinkProfile profile);
/// `everything` keeps all samples until they are taken, streams too: for recorders, in a process of their
/// own.
[[nodiscard]] dds_qos_t* readerQos(const TopicSpec& topic, LinkProfile profile, bool everything);

/// The Cyclone configuration used when nobody gives another; the same text as deploy/dds/loopback.xml.
[[nodiscard]] std::string_view loopbackConfig();

}  // namespace tenon::wire
