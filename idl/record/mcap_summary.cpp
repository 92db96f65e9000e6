#include "idl/record/mcap_summary.h"

#include <algorithm>
#include <utility>

namespace tenon::record::mcap {

void append(FieldWriter& to, Opcode opcode, const FieldWriter& fields) {
  to.put(opcode);
  to.put(static_cast<std::uint64_t>(fields.bytes.size()));
  to.putBytes(fields.bytes);
}

void Summary::add(ChunkIndex chunk, bool has_messages) {
  if (has_messages) {
    start = std::min(start, chunk.first_time);
    end = std::max(end, chunk.last_time);
  }
  chunks.push_back(std::move(chunk));
}

void Summary::addMetadata(std::string_view name, std::uint64_t offset, std::uint64_t length) {
  FieldWriter entry;
  entry.put(offset);
  entry.put(length);
  entry.put(name);
  append(metadata_index, kMetadataIndex, entry);
  ++metadata;
}

void Summary::addStatistics(FieldWriter& summary) const {
  FieldWriter fields;
  fields.put(messages);
  fields.put(static_cast<std::uint16_t>(schema_ids.size()));
  fields.put(static_cast<std::uint32_t>(counts.size()));
  fields.put(attachments);
  fields.put(metadata);
  fields.put(static_cast<std::uint32_t>(chunks.size()));
  fields.put(messages > 0 ? start : std::int64_t{0});
  fields.put(end);
  fields.put(static_cast<std::uint32_t>(counts.size() * 10));
  for (const auto& [channel, count] : counts) fields.put(channel), fields.put(count);
  append(summary, kStatistics, fields);
}

void Summary::addChunkIndices(FieldWriter& summary) const {
  for (const ChunkIndex& entry : chunks) {
    FieldWriter fields;
    fields.put(entry.first_time);
    fields.put(entry.last_time);
    fields.put(entry.offset);
    fields.put(entry.length);
    fields.put(static_cast<std::uint32_t>(entry.message_indices.size() * 10));
    for (const auto& [channel, at] : entry.message_indices) fields.put(channel), fields.put(at);
    fields.put(entry.indices_length);
    fields.put(std::string_view(entry.compression));
    fields.put(entry.compressed);
    fields.put(entry.plain);
    append(summary, kChunkIndex, fields);
  }
}

std::vector<std::uint8_t> Summary::bytes(std::uint64_t offset) const {
  // groups of the summary and their offsets
  FieldWriter summary, offsets;
  const auto group = [&](Opcode opcode, auto&& add) {
    const std::uint64_t at = offset + summary.bytes.size();
    add();
    const std::uint64_t length = offset + summary.bytes.size() - at;
    if (length == 0) return;
    FieldWriter fields;
    fields.put(opcode);
    fields.put(at);
    fields.put(length);
    append(offsets, kSummaryOffset, fields);
  };
  group(kSchema, [&] { summary.putBytes(schemas.bytes); });
  group(kChannel, [&] { summary.putBytes(channels.bytes); });
  group(kStatistics, [&] { addStatistics(summary); });
  group(kChunkIndex, [&] { addChunkIndices(summary); });
  group(kAttachmentIndex, [&] { summary.putBytes(attachment_index.bytes); });
  group(kMetadataIndex, [&] { summary.putBytes(metadata_index.bytes); });
  const std::uint64_t offsets_start = offset + summary.bytes.size();
  summary.putBytes(offsets.bytes);

  // the checksum covers the summary and the footer up to the checksum
  FieldWriter footer;
  footer.put(offset);
  footer.put(offsets_start);
  summary.put(kFooter);
  summary.put(std::uint64_t{20});
  summary.putBytes(footer.bytes);
  summary.put(crc32(summary.bytes));
  summary.putBytes(kMagic);
  return std::move(summary.bytes);
}

}  // namespace tenon::record::mcap
