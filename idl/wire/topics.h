#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

/// All topics: name, message type and quality of service. Which there are say the lines `//@topic` of
/// idl/tenon.idl, from which idl/generate.py writes topic_list.h into the build folder. For a new one see
/// CONTRIBUTING.md.
namespace tenon::wire {

/// How samples of a topic are delivered; idl/wire/profiles.cpp maps it to DDS policies. In lockstep, streams
/// are reliable too.
enum class QosClass {
  kStream,  ///< best effort, keep last 1
  kState,   ///< reliable, keep last 1 per key; late joiners get it (transient local)
  kEvent,   ///< reliable, keep all
};

/// Delivery on a link; streams differ by it.
enum class LinkProfile {
  kLan,       ///< loopback or a local network, in real time
  kLockstep,  ///< streams are reliable; writers keep all samples until all readers have them, readers the
              ///< last 32 of a stream; no deadlines, no lifespans
};

using Milliseconds = std::chrono::milliseconds;
inline constexpr Milliseconds kNever{0};  ///< the policy is not set

/// DDS policies of a topic that its QoS class does not determine; writers offer them. Readers request the
/// weakest deadline and liveliness, so that these never prevent a match. On a lockstep link, which may be
/// slower than real time, deadline, lease by topic and lifespan are not offered, and leases are 5 s at least.
struct TopicParameters {
  Milliseconds deadline = kNever;  ///< [ms] DEADLINE: longest time between two samples
  Milliseconds lease =
      kNever;  ///< [ms] LIVELINESS lease: without sign of life for so long, the writer's instances end
  bool lease_by_topic =
      false;  ///< MANUAL_BY_TOPIC: only writing this topic renews the lease, so a hung thread is detected
  Milliseconds lifespan = kNever;  ///< [ms] LIFESPAN: older samples are not delivered
  std::uint32_t late_joiner_depth =
      0;                           ///< samples per key that a late joiner gets (transient local); 0: none
  std::uint32_t reader_depth = 1;  ///< samples per key of a stream that a reader keeps until it takes them
  bool latched = false;            ///< instances outlive their writer
  bool of_server = false;  ///< a server alone writes it: Partition::hearOnly binds its readers to one server
  /// Who writes it waits for the server's answer, and hears no stops in that thread: the write may wait
  /// longer for a slow reader.
  bool request = false;
};

/// A topic of messages M.
template <class M>
struct Topic {
  std::string_view name;
  QosClass qos_class = QosClass::kStream;
  TopicParameters parameters;
};

}  // namespace tenon::wire

// the topics themselves, kSessionAnnounce to kCheckpoint, forEachTopic and TENON_WIRE_MESSAGES
#include "idl/wire/topic_list.h"
