#include "idl/wire/dds_endpoint.h"

#include <algorithm>
#include <mutex>

namespace tenon::wire {
namespace {

Result<dds_entity_t> topicEntity(ParticipantEntities& participant, const TopicSpec& topic) {
  const std::lock_guard<std::mutex> lock(participant.topics_mutex);
  const auto known = participant.topics.find(topic.name);
  if (known != participant.topics.end()) return known->second;
  const std::string name(topic.name);
  const dds_entity_t entity =
      dds_create_topic(participant.entity, topic.type, name.c_str(), nullptr, nullptr);
  if (entity < 0) return fail("topic '" + name + "' could not be created: " + ddsReason(entity));
  participant.topics.emplace(name, entity);
  return entity;
}

template <class Create>
Result<std::unique_ptr<DdsEndpoint>> openEndpoint(const Partition& partition, const TopicSpec& topic,
                                                  dds_qos_t* qos, Create create) {
  const std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)> owned(qos, &dds_delete_qos);
  if (partition.entities()->publisher < 0 || partition.entities()->subscriber < 0) {
    return fail("partition '" + partition.name() + "' could not be opened");
  }
  const auto topic_entity = topicEntity(*partition.entities()->participant, topic);
  if (!topic_entity) return tl::unexpected(topic_entity.error());
  const dds_entity_t entity = create(*topic_entity);
  if (entity < 0) return fail(ddsError(topic.name, *partition.entities(), entity));
  return std::make_unique<DdsEndpoint>(partition.entities(), entity);
}

}  // namespace

std::string ddsError(std::string_view what, const PartitionEntities& partition, dds_return_t code) {
  return std::string(what) + " in '" + partition.name + "': " + ddsReason(code);
}

Result<std::unique_ptr<DdsEndpoint>> openWriter(const Partition& partition, const TopicSpec& topic) {
  dds_qos_t* qos = writerQos(topic, partition.profile());
  return openEndpoint(partition, topic, qos, [&](dds_entity_t entity) {
    return dds_create_writer(partition.entities()->publisher, entity, qos, nullptr);
  });
}

Result<std::unique_ptr<DdsEndpoint>> openReader(const Partition& partition, const TopicSpec& topic,
                                                bool keep_all, const dds_listener_t* listener) {
  dds_qos_t* qos = readerQos(topic, partition.profile(), keep_all);
  return openEndpoint(partition, topic, qos, [&](dds_entity_t entity) {
    return dds_create_reader(partition.entities()->subscriber, entity, qos, listener);
  });
}

std::size_t matchedWriters(dds_entity_t reader) {
  return static_cast<std::size_t>(std::max(0, dds_get_matched_publications(reader, nullptr, 0)));
}
std::size_t matchedReaders(dds_entity_t writer) {
  return static_cast<std::size_t>(std::max(0, dds_get_matched_subscriptions(writer, nullptr, 0)));
}

const Origin& OriginCache::find(dds_entity_t reader, dds_instance_handle_t writer) {
  static const Origin unknown;
  constexpr std::size_t kManyWriters = 1000;  // bounds the cache in long sessions
  if (const auto found = known_.find(writer); found != known_.end()) return found->second;
  const std::unique_ptr<dds_builtintopic_endpoint_t, void (*)(dds_builtintopic_endpoint_t*)> data(
      dds_get_matched_publication_data(reader, writer), &dds_builtintopic_free_endpoint);
  if (!data) return unknown;
  if (known_.size() >= kManyWriters) known_.clear();
  Origin& origin = known_[writer];
  std::copy_n(data->participant_key.v, origin.guid.size(), origin.guid.begin());
  return origin;
}

bool isHeard(const PartitionEntities& partition, const TopicParameters& topic, const Origin& from) {
  return !topic.of_server || !partition.server || *partition.server == from;
}

bool isGone(const dds_sample_info_t& info, bool latched) {
  if (info.sample_rank != 0) return false;
  return info.instance_state == DDS_NOT_ALIVE_DISPOSED_INSTANCE_STATE ||
         (info.instance_state == DDS_NOT_ALIVE_NO_WRITERS_INSTANCE_STATE && !latched);
}

}  // namespace tenon::wire
