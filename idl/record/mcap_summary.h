#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "idl/record/mcap_format.h"

namespace tenon::record::mcap {

/// Where a chunk is in the file, and its message indices.
struct ChunkIndex {
  std::int64_t first_time = 0, last_time = 0;  ///< [ns]
  std::uint64_t offset = 0, length = 0;        ///< [bytes]
  std::map<std::uint16_t, std::uint64_t> message_indices;
  std::uint64_t indices_length = 0, compressed = 0, plain = 0;  ///< [bytes]
  std::string compression;
};

/// What the summary at the end of a file repeats of its content, gathered while it is written.
///
/// Threads: one at a time. Real-time: no.
struct Summary {
  std::map<std::string, std::uint16_t> schema_ids;   ///< by type name
  std::map<std::string, std::uint16_t> channel_ids;  ///< by topic
  FieldWriter schemas, channels, attachment_index, metadata_index;
  std::map<std::uint16_t, std::uint64_t> counts;  ///< messages by channel
  std::vector<ChunkIndex> chunks;
  std::uint64_t messages = 0;
  std::uint32_t attachments = 0, metadata = 0;
  std::int64_t start = std::numeric_limits<std::int64_t>::max();  ///< [ns] of messages in chunks
  std::int64_t end = 0;                                           ///< [ns]

  void add(ChunkIndex chunk, bool has_messages);
  /// Of the metadata record in the `length` bytes at `offset`.
  void addMetadata(std::string_view name, std::uint64_t offset, std::uint64_t length);
  /// All records after the data, and the final magic bytes; `offset` [bytes]: where they begin in the file.
  [[nodiscard]] std::vector<std::uint8_t> bytes(std::uint64_t offset) const;

 private:
  void addStatistics(FieldWriter& summary) const;
  void addChunkIndices(FieldWriter& summary) const;
};

/// Appends a record to `to`.
void append(FieldWriter& to, Opcode opcode, const FieldWriter& fields);

}  // namespace tenon::record::mcap
