#include "idl/wire/profiles.h"

#include <algorithm>
#include <cstdint>

namespace tenon::wire {
namespace {

constexpr std::uint32_t kLockstepDepth = 32;
constexpr Milliseconds kLockstepLease{
    5000};  ///< long enough for a machine that is busy with many lockstep processes

// Longest time a reliable write blocks for a slow reader before it fails. Cyclone DDS blocks writers that
// keep all, alone, while more than its WhcHigh is not acknowledged: 2 MB with the profiles in deploy/dds.
constexpr Milliseconds kBlocking{5};  // in a thread that hears of stops, or receives from all clients
constexpr Milliseconds kRequestBlocking{500};  // of who waits for the answer
constexpr Milliseconds kLockstepBlocking{10000};

dds_duration_t duration(Milliseconds time) { return DDS_MSECS(time.count()); }

Milliseconds blockingTime(const TopicSpec& topic, LinkProfile profile) {
  if (profile == LinkProfile::kLockstep) return kLockstepBlocking;
  return topic.parameters.request ? kRequestBlocking : kBlocking;
}

void setReliability(dds_qos_t* qos, const TopicSpec& topic, LinkProfile profile) {
  const bool lockstep = profile == LinkProfile::kLockstep;
  const bool reliable = topic.qos_class != QosClass::kStream || lockstep;
  dds_qset_reliability(qos, reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       duration(blockingTime(topic, profile)));
}

void setReaderHistory(dds_qos_t* qos, const TopicSpec& topic, LinkProfile profile) {
  // Instances that several writers have: of a server's state, the one of another server must not replace it
  // before it is taken, nor a station's repetition of an emergency stop that of the server.
  const bool of_several_writers =
      topic.qos_class == QosClass::kState && (topic.parameters.of_server || topic.parameters.latched);
  if (topic.qos_class == QosClass::kEvent || of_several_writers) {
    dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, 0);
  } else if (topic.qos_class == QosClass::kStream && profile == LinkProfile::kLockstep) {
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kLockstepDepth);
  } else {
    const bool stream = topic.qos_class == QosClass::kStream;
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST,
                     stream ? static_cast<std::int32_t>(topic.parameters.reader_depth) : 1);
  }
}

/// A lockstep writer keeps every sample until all its readers have it: with a history of limited depth it
/// would replace samples that a recorder on a busy machine has yet to acknowledge.
void setWriterHistory(dds_qos_t* qos, const TopicSpec& topic, LinkProfile profile) {
  if (topic.qos_class == QosClass::kEvent || profile == LinkProfile::kLockstep) {
    dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, 0);
  } else {
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  }
}

/// Samples per key that a late joiner gets; 0: volatile. Streams of a lockstep server have one, because in
/// Cyclone DDS a volatile reader lacks what was written before the writer's first heartbeat has reached it,
/// although the writer knows it by then; a transient-local one gets all from its match on.
std::uint32_t lateJoinerDepth(const TopicSpec& topic, LinkProfile profile) {
  const bool lockstep_frames =
      profile == LinkProfile::kLockstep && topic.parameters.of_server && topic.qos_class == QosClass::kStream;
  return lockstep_frames ? 1 : topic.parameters.late_joiner_depth;
}

dds_qos_t* commonQos(const TopicSpec& topic, LinkProfile profile) {
  dds_qos_t* qos = dds_create_qos();
  setReliability(qos, topic, profile);
  dds_qset_durability(
      qos, lateJoinerDepth(topic, profile) > 0 ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  return qos;
}

}  // namespace

dds_qos_t* participantQos(LinkProfile profile) {
  // of participants Cyclone DDS takes the lease from this policy, or else from its configuration
  dds_qos_t* qos = dds_create_qos();
  if (profile == LinkProfile::kLockstep)
    dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, duration(kLockstepLease));
  return qos;
}

dds_qos_t* writerQos(const TopicSpec& topic, LinkProfile profile) {
  const TopicParameters& parameters = topic.parameters;
  const bool lockstep = profile == LinkProfile::kLockstep;
  dds_qos_t* qos = commonQos(topic, profile);
  setWriterHistory(qos, topic, profile);
  dds_data_representation_id_t xcdr1[] = {DDS_DATA_REPRESENTATION_XCDR1};
  dds_qset_data_representation(qos, 1, xcdr1);
  if (const std::uint32_t depth = lateJoinerDepth(topic, profile); depth > 0) {
    // Cyclone serves late joiners by DURABILITY_SERVICE alone; HISTORY does not matter for them
    dds_qset_durability_service(qos, 0, DDS_HISTORY_KEEP_LAST, static_cast<std::int32_t>(depth),
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  if (parameters.lease != kNever) {
    const bool by_topic = parameters.lease_by_topic && !lockstep;
    const Milliseconds lease = lockstep ? std::max(parameters.lease, kLockstepLease) : parameters.lease;
    dds_qset_liveliness(qos, by_topic ? DDS_LIVELINESS_MANUAL_BY_TOPIC : DDS_LIVELINESS_AUTOMATIC,
                        duration(lease));
  }
  if (parameters.deadline != kNever && !lockstep) dds_qset_deadline(qos, duration(parameters.deadline));
  if (parameters.lifespan != kNever && !lockstep) dds_qset_lifespan(qos, duration(parameters.lifespan));
  dds_qset_writer_data_lifecycle(qos, !parameters.latched);
  return qos;
}

dds_qos_t* readerQos(const TopicSpec& topic, LinkProfile profile, bool keep_all) {
  dds_qos_t* qos = commonQos(topic, profile);
  if (keep_all) {
    dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, 0);
  } else {
    setReaderHistory(qos, topic, profile);
  }
  return qos;
}

}  // namespace tenon::wire
