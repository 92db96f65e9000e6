#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

#include <dds/dds.h>

#include "idl/types/result.h"
#include "idl/wire/entities.h"
#include "idl/wire/participant.h"
#include "idl/wire/profiles.h"

/// DDS readers and writers, independent of message types. Internal to idl/wire.
namespace tenon::wire {

/// A DDS reader or writer; keeps its partition alive.
class DdsEndpoint {
 public:
  DdsEndpoint(std::shared_ptr<PartitionEntities> partition, dds_entity_t entity)
      : partition_(std::move(partition)), entity_(entity) {}
  ~DdsEndpoint() { dds_delete(entity_); }
  DdsEndpoint(const DdsEndpoint&) = delete;
  DdsEndpoint& operator=(const DdsEndpoint&) = delete;
  [[nodiscard]] dds_entity_t entity() const { return entity_; }
  [[nodiscard]] const std::shared_ptr<PartitionEntities>& partition() const { return partition_; }

 private:
  std::shared_ptr<PartitionEntities> partition_;
  dds_entity_t entity_;
};

Result<std::unique_ptr<DdsEndpoint>> openWriter(const Partition& partition, const TopicSpec& topic);
Result<std::unique_ptr<DdsEndpoint>> openReader(const Partition& partition, const TopicSpec& topic,
                                                bool keep_all, const dds_listener_t* listener);

[[nodiscard]] std::size_t matchedWriters(dds_entity_t reader);
[[nodiscard]] std::size_t matchedReaders(dds_entity_t writer);

/// Whether the instance of this sample has ended: disposed or, unless `latched`, without writers. True only
/// for the last taken sample of an instance (sample rank 0), so the end is reported once and after its data.
[[nodiscard]] bool isGone(const dds_sample_info_t& info, bool latched);

/// Caches the origin of each writer of a reader, because the DDS call locks and allocates.
class OriginCache {
 public:
  /// An unknown origin when the writer has gone.
  [[nodiscard]] const Origin& find(dds_entity_t reader, dds_instance_handle_t writer);

 private:
  std::unordered_map<dds_instance_handle_t, Origin> known_;
};

/// Whether samples of `topic` by `from` are delivered to a reader of `partition`: see Partition::hearOnly.
[[nodiscard]] bool isHeard(const PartitionEntities& partition, const TopicParameters& topic,
                           const Origin& from);

/// "WorldFrame_1k in 's/demo': <text of the DDS return code>"
[[nodiscard]] std::string ddsError(std::string_view what, const PartitionEntities& partition,
                                   dds_return_t code);

}  // namespace tenon::wire
