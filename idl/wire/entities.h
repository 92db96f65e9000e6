#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include <dds/dds.h>

#include "idl/wire/origin.h"
#include "idl/wire/topics.h"

/// The DDS entities behind participant.h, deleted with their owners. Internal to idl/wire.
namespace tenon::wire {

/// The text of a DDS return code.
[[nodiscard]] inline std::string ddsReason(dds_return_t code) { return dds_strretcode(-code); }

/// Of a Participant.
struct ParticipantEntities {
  std::shared_ptr<void> domain;  ///< shared by all participants of this domain in the process
  dds_entity_t entity = 0;
  LinkProfile profile = LinkProfile::kLan;
  std::mutex topics_mutex;
  std::map<std::string, dds_entity_t, std::less<>> topics;

  ParticipantEntities() = default;
  ParticipantEntities(const ParticipantEntities&) = delete;
  ParticipantEntities& operator=(const ParticipantEntities&) = delete;
  ~ParticipantEntities() { dds_delete(entity); }
};

/// Of a Partition; keeps its participant alive.
struct PartitionEntities {
  std::shared_ptr<ParticipantEntities> participant;
  std::string name;
  LinkProfile profile = LinkProfile::kLan;
  dds_entity_t publisher = 0;
  dds_entity_t subscriber = 0;
  std::optional<Origin> server;  ///< see Partition::hearOnly

  PartitionEntities() = default;
  PartitionEntities(const PartitionEntities&) = delete;
  PartitionEntities& operator=(const PartitionEntities&) = delete;
  ~PartitionEntities() {
    dds_delete(publisher);
    dds_delete(subscriber);
  }
};

}  // namespace tenon::wire
