#include "idl/record/mcap_reader.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <set>

#include "idl/record/mcap_chunk.h"
#include "idl/record/mcap_format.h"
#include "idl/record/mcap_sequence.h"

namespace tenon::record {
namespace {

using mcap::takeRecord;

constexpr std::size_t kDamageNamed = 3;  // places

struct ChunkLocation {
  mcap::TimeRange times;    ///< by its head, which has no checksum
  mcap::TimeRange indexed;  ///< by its message indices, which have none either
  std::span<const std::uint8_t> fields;
};

}  // namespace

struct McapReader::Impl {
  mcap::MappedFile mapped;
  std::span<const std::uint8_t> bytes;  ///< of the file
  std::string name;
  bool complete = false;
  bool summary_valid = true;
  std::set<std::string> damage;
  std::vector<std::string> first_damage;  ///< kDamageNamed of them at most
  std::vector<ChunkLocation> chunks;
  std::map<std::uint16_t, std::pair<std::string, std::string>> schemas;  // type name, text
  std::map<std::uint16_t, std::size_t> channel_indices;                  // id -> index into channels
  std::vector<McapChannel> channels;
  std::multimap<std::string, std::map<std::string, std::string>> metadata;
  std::vector<McapAttachment> attachments;
  std::set<std::uint16_t> indexed;  ///< channels with an index of messages

  std::size_t next_chunk = 0;
  std::int64_t not_before = std::numeric_limits<std::int64_t>::min();
  std::vector<std::uint8_t> decompressed;
  std::span<const std::uint8_t> rest;

  void scan();
  void checkTimes();
  void checkSummary(std::span<const std::uint8_t> summary);
  void readDefinition(std::uint8_t opcode, std::span<const std::uint8_t> fields);
  void readTopLevel(std::uint8_t opcode, std::span<const std::uint8_t> fields);
  void readStatistics(std::span<const std::uint8_t> fields);
  bool decompress(const ChunkLocation& location);
  [[nodiscard]] bool allDefined() const {
    return std::all_of(indexed.begin(), indexed.end(),
                       [this](std::uint16_t channel) { return channel_indices.contains(channel); });
  }
  void reportDamage(const std::string& what) {
    if (damage.insert(what).second && first_damage.size() < kDamageNamed) first_damage.push_back(what);
  }
  /// "a chunk (bytes 35 to 4506)"
  [[nodiscard]] std::string place(const char* record, std::span<const std::uint8_t> fields) const {
    const auto end = static_cast<std::size_t>(fields.data() - bytes.data()) + fields.size();
    return std::string(record) + " (bytes " + std::to_string(end - fields.size() - mcap::kRecordHeaderBytes) +
           " to " + std::to_string(end) + ")";
  }
};

McapReader::McapReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
McapReader::McapReader(McapReader&&) noexcept = default;
McapReader& McapReader::operator=(McapReader&&) noexcept = default;
McapReader::~McapReader() = default;

std::int64_t McapReader::lastTime() const {
  const auto& chunks = impl_->chunks;
  const auto last = std::find_if(chunks.rbegin(), chunks.rend(),
                                 [](const ChunkLocation& chunk) { return chunk.times.last != 0; });
  return last == chunks.rend() ? 0 : last->times.last;
}
bool McapReader::complete() const { return impl_->complete; }
bool McapReader::isDamaged() const { return !impl_->damage.empty(); }
std::string McapReader::problem() const {
  std::string problem;
  const auto add = [&problem](const std::string& what) { problem += (problem.empty() ? "" : "; ") + what; };
  for (const std::string& what : impl_->first_damage) add(what);
  if (const std::size_t more = impl_->damage.size() - impl_->first_damage.size(); more > 0)
    add(std::to_string(more) + " more places are damaged");
  if (!impl_->complete) add("is truncated: read up to its last complete chunk");
  return problem.empty() ? "" : impl_->name + ": " + problem;
}
const std::vector<McapChannel>& McapReader::channels() const { return impl_->channels; }
const std::vector<McapAttachment>& McapReader::attachments() const { return impl_->attachments; }
const std::multimap<std::string, std::map<std::string, std::string>>& McapReader::metadata() const {
  return impl_->metadata;
}

Result<McapReader> McapReader::open(const std::filesystem::path& file) {
  auto impl = std::make_unique<Impl>();
  impl->name = file.string();
  const auto bytes = impl->mapped.map(file);
  if (!bytes) return fail(bytes.error().what);
  if (!mcap::beginsWithMagic(*bytes))
    return fail(file.string() + ": is not a recording (no MCAP file): `tenon record -o FILE` writes one");
  impl->bytes = *bytes;
  impl->scan();
  impl->checkTimes();

  // without a summary the channels are those that the chunks define
  if (!impl->complete || !impl->summary_valid) {
    for (const ChunkLocation& location : impl->chunks) {
      // as many as it takes to define what the indices of the messages name; all of a file without indices
      if (!impl->indexed.empty() && impl->allDefined()) break;
      if (!impl->decompress(location)) continue;
      std::uint8_t opcode = 0;
      std::span<const std::uint8_t> fields;
      while (takeRecord(impl->rest, opcode, fields)) impl->readDefinition(opcode, fields);
    }
    impl->rest = {};
  }
  return McapReader(std::move(impl));
}

void McapReader::Impl::scan() {
  mcap::RecordSequence records(bytes);
  std::span<const std::uint8_t> fields;
  std::size_t summary = 0;  // [bytes] where it begins; 0: there is none
  for (std::uint8_t opcode = 0; records.next(opcode, fields);) {
    if (const auto& part = records.unreadable())
      reportDamage("is damaged between bytes " + std::to_string(part->begin) + " and " +
                   std::to_string(part->end) + ": read without them");
    readTopLevel(opcode, fields);
    if (opcode == mcap::kDataEnd) summary = records.end();
    if (opcode != mcap::kFooter) continue;
    complete = true;
    return checkSummary(bytes.subspan(summary, summary == 0 ? 0 : records.end() - summary));
  }
  if (records.hasDamagedEnd() && !records.gaveUp())
    reportDamage("is damaged from byte " + std::to_string(records.end()) + " to its end");
  if (records.gaveUp())
    reportDamage("is damaged from byte " + std::to_string(records.end()) +
                 " on, and what follows is not read: too much of it looks like records and is none");
}

/// Times decide what is read after a seek: where a chunk's head and indices disagree its messages are asked.
void McapReader::Impl::checkTimes() {
  for (ChunkLocation& location : chunks) {
    // a file of another program may have no indices
    if (indexed.empty() || location.times == location.indexed || !decompress(location)) continue;
    const mcap::TimeRange times = mcap::timesOfMessages(rest);
    if (location.times != times)
      reportDamage(place("a chunk", location.fields) + " says other times than those of its messages");
    location.times = times;
  }
  rest = {};
}

void McapReader::Impl::checkSummary(std::span<const std::uint8_t> summary) {
  std::uint32_t crc = 0;
  if (summary.size() >= sizeof(crc)) {
    std::memcpy(&crc, summary.data() + summary.size() - sizeof(crc), sizeof(crc));
    if (crc == 0 || crc == mcap::crc32(summary.first(summary.size() - sizeof(crc)))) return;
  }
  reportDamage("the summary is damaged: chunks are read without it");
  schemas.clear();
  channel_indices.clear();
  channels.clear();
  summary_valid = false;
}

void McapReader::Impl::readTopLevel(std::uint8_t opcode, std::span<const std::uint8_t> fields) {
  record::mcap::FieldReader in(fields);
  switch (opcode) {
    case mcap::kChunk: {
      ChunkLocation location;
      location.times.first = in.get<std::int64_t>();
      location.times.last = in.get<std::int64_t>();
      location.fields = fields;
      if (in.ok) chunks.push_back(location);
      return;
    }
    case mcap::kMetadata: {
      const std::string title(in.text());
      auto values = in.values();
      if (!in.ok) return;
      if (!mcap::takeChecksum(title, values)) reportDamage(place("metadata", fields) + " are damaged");
      metadata.emplace(title, std::move(values));
      return;
    }
    case mcap::kAttachment: {
      in.take(16);
      McapAttachment attachment;
      attachment.name = in.text();
      attachment.media_type = in.text();
      attachment.data = in.take(in.get<std::uint64_t>());
      const auto crc = in.get<std::uint32_t>();
      if (!in.ok || crc != mcap::crc32(fields.first(fields.size() - sizeof(crc))))
        return reportDamage(place("an attachment", fields) + " is damaged and skipped");
      attachments.push_back(std::move(attachment));
      return;
    }
    case mcap::kMessageIndex: {
      const auto channel = in.get<std::uint16_t>();
      if (!in.ok) return;
      indexed.insert(channel);
      if (!chunks.empty()) chunks.back().indexed = joined(chunks.back().indexed, mcap::timesOfIndex(fields));
      return;
    }
    case mcap::kStatistics:
      return readStatistics(fields);
    default:
      return readDefinition(opcode, fields);
  }
}

void McapReader::Impl::readDefinition(std::uint8_t opcode, std::span<const std::uint8_t> fields) {
  record::mcap::FieldReader in(fields);
  const auto id = in.get<std::uint16_t>();
  if (opcode == mcap::kSchema) {
    const std::string type(in.text());
    in.text();
    const std::string text(in.text());
    if (in.ok) schemas[id] = {type, text};
  }
  if (opcode == mcap::kChannel && !channel_indices.contains(id)) {
    const auto schema = schemas.find(in.get<std::uint16_t>());
    const std::string topic(in.text());
    if (!in.ok || schema == schemas.end()) return reportDamage("a channel without a schema is skipped");
    channel_indices[id] = channels.size();
    channels.push_back({topic, schema->second.first, schema->second.second, 0});
  }
}

void McapReader::Impl::readStatistics(std::span<const std::uint8_t> fields) {
  record::mcap::FieldReader in(fields);
  in.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8);
  record::mcap::FieldReader counts(in.take(in.get<std::uint32_t>()));
  while (counts.ok && !counts.rest.empty()) {
    const auto id = counts.get<std::uint16_t>();
    const auto count = counts.get<std::uint64_t>();
    if (const auto index = channel_indices.find(id); counts.ok && index != channel_indices.end())
      channels[index->second].messages = count;
  }
}

bool McapReader::Impl::decompress(const ChunkLocation& location) {
  if (const std::string wrong = mcap::openChunk(location.fields, decompressed); !wrong.empty()) {
    reportDamage(place("a chunk", location.fields) + " " + wrong +
                 (wrong == "is damaged" ? " and skipped" : " and is skipped"));
    return false;
  }
  rest = decompressed;
  return true;
}

bool McapReader::next(McapMessage& message) {
  Impl& from = *impl_;
  while (true) {
    std::uint8_t opcode = 0;
    std::span<const std::uint8_t> fields;
    while (takeRecord(from.rest, opcode, fields)) {
      if (opcode != mcap::kMessage) {
        from.readDefinition(opcode, fields);
        continue;
      }
      record::mcap::FieldReader in(fields);
      const auto channel = from.channel_indices.find(in.get<std::uint16_t>());
      message.sequence = in.get<std::uint32_t>();
      message.log_time_ns = in.get<std::int64_t>();
      in.get<std::int64_t>();
      if (!in.ok || channel == from.channel_indices.end() || message.log_time_ns < from.not_before) continue;
      message.topic = from.channels[channel->second].topic;
      message.type_name = from.channels[channel->second].type_name;
      message.data = in.rest;
      return true;
    }
    do {
      if (from.next_chunk == from.chunks.size()) return false;
    } while (from.chunks[from.next_chunk].times.last < from.not_before
                 ? (++from.next_chunk, true)
                 : !from.decompress(from.chunks[from.next_chunk++]));
  }
}

void McapReader::seek(std::int64_t log_time_ns) {
  impl_->not_before = log_time_ns;
  impl_->next_chunk = 0;
  impl_->rest = {};
}

}  // namespace tenon::record
