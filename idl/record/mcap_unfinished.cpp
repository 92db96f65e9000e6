#include "idl/record/mcap_unfinished.h"

#include <algorithm>
#include <set>
#include <span>
#include <string>

#include "idl/record/mcap_chunk.h"
#include "idl/record/mcap_sequence.h"

namespace tenon::record::mcap {
namespace {

using Records = std::span<const std::uint8_t>;

/// A chunk, and what of the summary comes before it.
struct Found {
  ChunkIndex index;
  Records fields;
  std::uint32_t metadata = 0, attachments = 0;           ///< before it
  std::size_t metadata_index = 0, attachment_index = 0;  ///< [bytes] likewise
  std::map<std::uint16_t, std::uint64_t> counts;         ///< its messages by channel
  TimeRange indexed;                                     ///< of them, by the indices
  std::size_t end = 0;                                   ///< [bytes] of it and its indices
};

/// Follows the records of a file in their order.
class Scan {
 public:
  explicit Scan(Records bytes) : records_(bytes) {}

  void run() {
    Records fields;
    for (std::uint8_t opcode = 0; records_.next(opcode, fields);) read(opcode, fields);
  }
  /// Whether chunks may follow that were not found.
  [[nodiscard]] bool gaveUp() const { return records_.gaveUp(); }
  [[nodiscard]] bool hasDamagedEnd() const { return records_.hasDamagedEnd(); }

  struct Metadata {
    std::size_t chunks = 0;  ///< before it
    std::string name;
    std::vector<std::uint8_t> fields;
  };
  std::vector<Found> chunks;
  std::vector<Metadata> metadata;
  Summary summary;  ///< metadata and attachments
  bool closed = false;

 private:
  void read(std::uint8_t opcode, Records fields) {
    FieldReader in(fields);
    if (opcode == kChunk) return readChunk(in);
    if (opcode == kMessageIndex && !chunks.empty()) {
      chunks.back().indexed = joined(chunks.back().indexed, timesOfIndex(fields));
      return readIndex(in);
    }
    if (opcode == kMetadata) return readMetadata(in);
    if (opcode == kAttachment) return readAttachment(in);
    if (opcode == kDataEnd) closed = true;
  }
  void readChunk(FieldReader in) {
    Found& chunk = chunks.emplace_back();
    chunk.fields = in.rest;
    chunk.index.first_time = in.get<std::int64_t>();
    chunk.index.last_time = in.get<std::int64_t>();
    chunk.index.plain = in.get<std::uint64_t>();
    in.get<std::uint32_t>();
    chunk.index.compression = in.text();
    chunk.index.compressed = in.get<std::uint64_t>();
    chunk.index.offset = records_.begin();
    chunk.index.length = length();
    chunk.end = records_.end();
    chunk.metadata = summary.metadata;
    chunk.metadata_index = summary.metadata_index.bytes.size();
    chunk.attachments = summary.attachments;
    chunk.attachment_index = summary.attachment_index.bytes.size();
  }
  void readIndex(FieldReader in) {
    Found& chunk = chunks.back();
    const auto channel = in.get<std::uint16_t>();
    constexpr std::uint32_t kEntry = 16;  // [bytes]
    chunk.counts[channel] += in.get<std::uint32_t>() / kEntry;
    chunk.index.message_indices[channel] = records_.begin();
    chunk.index.indices_length += length();
    chunk.end = records_.end();
  }
  void readMetadata(FieldReader in) {
    const Records whole = in.rest;
    metadata.push_back({chunks.size(), std::string(in.text()), {whole.begin(), whole.end()}});
    summary.addMetadata(metadata.back().name, records_.begin(), length());
  }
  void readAttachment(FieldReader in) {
    FieldWriter entry;
    entry.put(static_cast<std::uint64_t>(records_.begin()));
    entry.put(static_cast<std::uint64_t>(length()));
    entry.put(in.get<std::int64_t>());
    entry.put(in.get<std::int64_t>());
    const std::string_view name = in.text(), media_type = in.text();
    entry.put(in.get<std::uint64_t>());
    entry.put(name);
    entry.put(media_type);
    append(summary.attachment_index, kAttachmentIndex, entry);
    ++summary.attachments;
  }

  /// [bytes] of the record that is read
  [[nodiscard]] std::size_t length() const { return records_.end() - records_.begin(); }

  RecordSequence records_;
};

/// Schemas and channels that a chunk defines.
void define(Records chunk, Summary& summary, std::set<std::uint16_t>& missing) {
  Records fields;
  std::uint8_t opcode = 0;
  while (takeRecord(chunk, opcode, fields)) {
    if (opcode != kSchema && opcode != kChannel) continue;
    FieldReader in(fields);
    const auto id = in.get<std::uint16_t>();
    FieldWriter record;
    record.putBytes(fields);
    if (opcode == kSchema && summary.schema_ids.try_emplace(std::string(in.text()), id).second)
      append(summary.schemas, kSchema, record);
    if (opcode != kChannel || summary.counts.contains(id)) continue;
    in.get<std::uint16_t>();
    summary.channel_ids[std::string(in.text())] = id;
    summary.counts[id] = 0;
    append(summary.channels, kChannel, record);
    missing.erase(id);
  }
}

/// Head and indices of a chunk have no checksum: where they disagree its messages are asked.
void correctTimes(Found& chunk) {
  TimeRange times{chunk.index.first_time, chunk.index.last_time};
  std::vector<std::uint8_t> plain;
  if (times == chunk.indexed || !openChunk(chunk.fields, plain).empty()) return;
  times = timesOfMessages(plain);
  chunk.index.first_time = times.first;
  chunk.index.last_time = times.last;
}

/// Whether the indices of a chunk are all there.
bool isIndexed(const Found& chunk, Records records) {
  Records fields;
  for (std::uint8_t opcode = 0; takeRecord(records, opcode, fields);) {
    if (opcode != kMessage) continue;
    FieldReader in(fields);
    if (!chunk.counts.contains(in.get<std::uint16_t>())) return false;
  }
  return true;
}

void indexMessages(Unfinished& file) {
  const Records all(file.last_chunk);
  Records rest = all, fields;
  std::uint8_t opcode = 0;
  while (true) {
    const std::size_t at = all.size() - rest.size();
    if (!takeRecord(rest, opcode, fields)) return;
    if (opcode != kMessage) continue;
    FieldReader in(fields);
    const auto channel = in.get<std::uint16_t>();
    in.get<std::uint32_t>();
    file.last_index[channel].emplace_back(in.get<std::uint64_t>(), at);
    ++file.summary.counts[channel];
    ++file.summary.messages;
  }
}

}  // namespace

Result<Unfinished> readUnfinished(const std::filesystem::path& file) {
  MappedFile mapped;
  const auto bytes = mapped.map(file);
  if (!bytes) return fail(bytes.error().what);
  if (!beginsWithMagic(*bytes))
    return fail(file.string() + ": is not a recording (no MCAP file): `tenon record -o FILE` writes one");
  Scan scan(*bytes);
  scan.run();
  if (scan.closed) return fail(file.string() + ": is complete, there is nothing to continue");
  if (scan.gaveUp())
    return fail(file.string() + ": is damaged, and where it continues after that cannot be found");

  Unfinished result;
  std::vector<Found>& chunks = scan.chunks;
  std::vector<std::uint8_t> plain;
  const auto is_sound = [&](const Found& chunk) { return openChunk(chunk.fields, plain).empty(); };
  if (std::none_of(chunks.rbegin(), chunks.rend(), is_sound))
    return fail(file.string() + ": has no complete chunk, there is nothing to continue");
  for (Scan::Metadata& metadata : scan.metadata)
    if (metadata.chunks >= chunks.size())
      result.later_metadata.emplace_back(std::move(metadata.name), std::move(metadata.fields));
  const Found last = chunks.back();
  const bool can_be_read = openChunk(last.fields, result.last_chunk).empty();
  // damage that is not of its indices, which are written anew, is of what came after it, and is not cut off
  const bool ends_damaged =
      scan.hasDamagedEnd() && (!can_be_read || isIndexed(last, Records(result.last_chunk)));
  if (can_be_read && !ends_damaged) {
    chunks.pop_back();
    result.end = last.index.offset;
  } else {
    result.last_chunk.clear();
    result.end = ends_damaged ? bytes->size() : last.end;
  }
  for (Found& chunk : chunks) correctTimes(chunk);

  Summary& summary = result.summary;
  if (ends_damaged) {
    result.later_metadata.clear();
    summary = std::move(scan.summary);
  } else {
    summary.metadata_index.putBytes(Records(scan.summary.metadata_index.bytes).first(last.metadata_index));
    summary.metadata = last.metadata;
    summary.attachment_index.putBytes(
        Records(scan.summary.attachment_index.bytes).first(last.attachment_index));
    summary.attachments = last.attachments;
  }
  std::set<std::uint16_t> missing;
  for (const Found& chunk : chunks)
    for (const auto& [channel, count] : chunk.counts) missing.insert(channel);
  for (auto chunk = chunks.begin(); chunk != chunks.end() && !missing.empty(); ++chunk)
    if (openChunk(chunk->fields, plain).empty()) define(plain, summary, missing);
  define(result.last_chunk, summary, missing);
  if (summary.channel_ids.empty() && !missing.empty())
    return fail(file.string() + ": is damaged, no chunk that defines its channels can be read");
  for (Found& chunk : chunks) {
    // what has no channel is a damaged index
    std::erase_if(chunk.counts, [&missing](const auto& entry) { return missing.contains(entry.first); });
    std::erase_if(chunk.index.message_indices,
                  [&missing](const auto& entry) { return missing.contains(entry.first); });
    for (const auto& [channel, count] : chunk.counts) {
      summary.counts[channel] += count;
      summary.messages += count;
    }
    summary.add(std::move(chunk.index), !chunk.counts.empty());
  }
  indexMessages(result);
  return result;
}

}  // namespace tenon::record::mcap
