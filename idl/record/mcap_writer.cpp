#include "idl/record/mcap_writer.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include "idl/record/mcap_summary.h"
#include "idl/record/mcap_unfinished.h"

namespace tenon::record {
namespace {

using mcap::FieldWriter;

constexpr std::size_t kChunkBytes = 1U << 20U;
constexpr auto kSyncAge = std::chrono::seconds(1);
constexpr int kCompressionLevel = 1;

}  // namespace

struct McapWriter::Impl {
  std::filesystem::path file;
  int descriptor = -1;
  bool compress = true;
  std::chrono::milliseconds chunk_age{0};
  std::string problem;       // of the first write that failed; empty: none did
  std::uint64_t offset = 0;  // of the next record
  std::uint32_t data_crc = 0;
  bool has_data_crc = true;  // not of a continued file, which would have to be read as a whole
  std::chrono::steady_clock::time_point synced = std::chrono::steady_clock::now();

  // the current chunk
  record::mcap::FieldWriter chunk;
  std::chrono::steady_clock::time_point chunk_start;
  std::int64_t first_time = std::numeric_limits<std::int64_t>::max();
  std::int64_t last_time = 0;
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> index;

  mcap::Summary summary;

  ~Impl() {
    if (descriptor >= 0) ::close(descriptor);
  }

  /// Before anything is changed: it may be the file of a session that runs. Devices and pipes have no lock.
  Result<void> lock(const std::string& what_to_do) const {
    if (flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
      return fail(file.string() + ": another program is writing it; " + what_to_do);
    return {};
  }
  /// After a failure the file ends before the record that could not be written, and stays so.
  Result<void> put(std::span<const std::uint8_t> bytes) {
    if (!problem.empty()) return fail(problem);
    for (auto rest = bytes; !rest.empty();) {
      const ssize_t written = ::write(descriptor, rest.data(), rest.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) {
        problem = file.string() + ": cannot write (" + std::strerror(errno) + ")";
        static_cast<void>(ftruncate(descriptor, static_cast<off_t>(offset)) == 0);
        return fail(problem);
      }
      rest = rest.subspan(static_cast<std::size_t>(written));
    }
    data_crc = mcap::crc32(bytes, data_crc);
    offset += bytes.size();
    return {};
  }
  Result<void> record(mcap::Opcode opcode, const record::mcap::FieldWriter& fields) {
    record::mcap::FieldWriter whole;
    mcap::append(whole, opcode, fields);
    return put(whole.bytes);
  }
  void beginChunk();
  Result<void> endChunk();
  Result<void> writeIndices(mcap::ChunkIndex& chunk_index);
  Result<void> writeSummary();
};

McapWriter::McapWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
McapWriter::McapWriter(McapWriter&&) noexcept = default;
McapWriter& McapWriter::operator=(McapWriter&&) noexcept = default;
McapWriter::~McapWriter() {
  if (impl_ != nullptr) (void)close();
}

Result<McapWriter> McapWriter::open(const std::filesystem::path& file, const McapOptions& options) {
  auto impl = std::make_unique<Impl>();
  impl->file = file;
  impl->compress = options.compress;
  impl->chunk_age = options.chunk_age;
  std::error_code ignored;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), ignored);
  impl->descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);  // a pipe is not waited for
  if (impl->descriptor < 0) return fail(file.string() + ": cannot be written (" + std::strerror(errno) + ")");
  struct stat status {};
  if (fstat(impl->descriptor, &status) != 0 || S_ISFIFO(status.st_mode))
    return fail(file.string() + ": is a pipe; name a file");
  if (auto locked = impl->lock("name another file"); !locked) return fail(locked.error().what);
  if (ftruncate(impl->descriptor, 0) != 0 && errno != EINVAL)
    return fail(file.string() + ": cannot be emptied (" + std::strerror(errno) + ")");
  if (auto done = impl->put(mcap::kMagic); !done) return fail(done.error().what);
  record::mcap::FieldWriter header;
  header.put(std::string_view("tenon"));
  header.put(std::string_view("tenon"));
  if (auto done = impl->record(mcap::kHeader, header); !done) return fail(done.error().what);
  return McapWriter(std::move(impl));
}

Result<McapWriter> McapWriter::reopen(const std::filesystem::path& file, const McapOptions& options) {
  auto impl = std::make_unique<Impl>();
  impl->file = file;
  impl->compress = options.compress;
  impl->chunk_age = options.chunk_age;
  impl->descriptor = ::open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (impl->descriptor < 0)
    return fail(file.string() + ": cannot be continued (" + std::strerror(errno) + ")");
  if (auto locked = impl->lock("end that one first"); !locked) return fail(locked.error().what);
  auto unfinished = mcap::readUnfinished(file);
  if (!unfinished) return fail(unfinished.error().what);
  impl->summary = std::move(unfinished->summary);
  impl->offset = unfinished->end;
  impl->has_data_crc = false;
  if (ftruncate(impl->descriptor, static_cast<off_t>(impl->offset)) != 0 ||
      lseek(impl->descriptor, 0, SEEK_END) < 0)
    return fail(file.string() + ": cannot be cut to its last complete chunk (" + std::strerror(errno) + ")");
  // the last chunk is written anew, with its indices
  impl->chunk.bytes = std::move(unfinished->last_chunk);
  impl->index = std::move(unfinished->last_index);
  for (const auto& [channel, records] : impl->index)
    for (const auto& [time, at] : records) {
      impl->first_time = std::min(impl->first_time, static_cast<std::int64_t>(time));
      impl->last_time = std::max(impl->last_time, static_cast<std::int64_t>(time));
    }
  if (auto done = impl->endChunk(); !done) return fail(done.error().what);
  for (const auto& [name, bytes] : unfinished->later_metadata) {
    mcap::FieldWriter fields;
    fields.putBytes(bytes);
    const std::uint64_t at = impl->offset;
    if (auto done = impl->record(mcap::kMetadata, fields); !done) return fail(done.error().what);
    impl->summary.addMetadata(name, at, impl->offset - at);
  }
  return McapWriter(std::move(impl));
}

std::uint16_t McapWriter::addChannel(std::string_view topic, std::string_view type_name,
                                     std::string_view schema_text) {
  Impl& to = *impl_;
  if (const auto known = to.summary.channel_ids.find(std::string(topic));
      known != to.summary.channel_ids.end())
    return known->second;
  if (to.chunk.bytes.empty()) to.beginChunk();
  auto [schema, is_new] =
      to.summary.schema_ids.try_emplace(std::string(type_name), to.summary.schema_ids.size() + 1);
  record::mcap::FieldWriter both;
  if (is_new) {
    record::mcap::FieldWriter fields;
    fields.put(schema->second);
    fields.put(type_name);
    fields.put(std::string_view("omgidl"));
    fields.put(schema_text);
    mcap::append(both, mcap::kSchema, fields);
    to.summary.schemas.putBytes(both.bytes);
  }
  const auto id = static_cast<std::uint16_t>(to.summary.counts.size());
  to.summary.counts[id] = 0;
  to.summary.channel_ids[std::string(topic)] = id;
  record::mcap::FieldWriter channel;
  channel.put(id);
  channel.put(schema->second);
  channel.put(topic);
  channel.put(std::string_view("cdr"));
  channel.put(std::map<std::string, std::string>{});
  record::mcap::FieldWriter record;
  mcap::append(record, mcap::kChannel, channel);
  to.summary.channels.putBytes(record.bytes);
  // schema and channel precede the channel's first message in its chunk
  to.chunk.putBytes(both.bytes);
  to.chunk.putBytes(record.bytes);
  return id;
}

Result<void> McapWriter::write(std::uint16_t channel, std::int64_t log_time_ns, std::uint32_t sequence,
                               std::span<const std::uint8_t> data) {
  Impl& to = *impl_;
  if (to.descriptor < 0) return fail(to.file.string() + ": is already closed");
  if (!to.problem.empty()) return fail(to.problem);
  if (to.chunk.bytes.empty()) to.beginChunk();
  to.index[channel].emplace_back(log_time_ns, to.chunk.bytes.size());
  constexpr std::size_t kMessageFields = 2 + 4 + 8 + 8;
  to.chunk.put(mcap::kMessage);
  to.chunk.put(static_cast<std::uint64_t>(kMessageFields + data.size()));
  to.chunk.put(channel);
  to.chunk.put(sequence);
  to.chunk.put(log_time_ns);
  to.chunk.put(log_time_ns);
  to.chunk.putBytes(data);
  to.first_time = std::min(to.first_time, log_time_ns);
  to.last_time = std::max(to.last_time, log_time_ns);
  ++to.summary.counts[channel];
  ++to.summary.messages;

  const auto now = std::chrono::steady_clock::now();
  if (to.chunk.bytes.size() >= kChunkBytes || now - to.chunk_start > to.chunk_age)
    if (auto done = to.endChunk(); !done) return done;
  if (now - to.synced > kSyncAge) {
    ::fdatasync(to.descriptor);
    to.synced = now;
  }
  return {};
}

/// Chunk 2, 4, 8 and so on repeat the schemas and channels of those before: they are found again unless half
/// of the file is lost.
void McapWriter::Impl::beginChunk() {
  chunk_start = std::chrono::steady_clock::now();
  if (!std::has_single_bit(summary.chunks.size() + 1)) return;
  chunk.putBytes(summary.schemas.bytes);
  chunk.putBytes(summary.channels.bytes);
}

Result<void> McapWriter::Impl::endChunk() {
  if (chunk.bytes.empty()) return {};
  const bool has_messages = !index.empty();
  std::vector<std::uint8_t> compressed_bytes;
  if (compress) {
    compressed_bytes.resize(ZSTD_compressBound(chunk.bytes.size()));
    const std::size_t size = ZSTD_compress(compressed_bytes.data(), compressed_bytes.size(),
                                           chunk.bytes.data(), chunk.bytes.size(), kCompressionLevel);
    if (ZSTD_isError(size) != 0) return fail(file.string() + ": " + ZSTD_getErrorName(size));
    compressed_bytes.resize(size);
  }
  const bool is_compressed =
      compress && chunk.bytes.size() <= mcap::kAnyChunkBytes + mcap::kMostRatio * compressed_bytes.size();
  mcap::ChunkIndex entry;
  entry.first_time = has_messages ? first_time : 0;
  entry.last_time = has_messages ? last_time : 0;
  entry.offset = offset;
  entry.plain = chunk.bytes.size();
  entry.compression = is_compressed ? "zstd" : "";
  entry.compressed = is_compressed ? compressed_bytes.size() : chunk.bytes.size();

  record::mcap::FieldWriter fields;
  fields.put(entry.first_time);
  fields.put(entry.last_time);
  fields.put(entry.plain);
  fields.put(mcap::crc32(chunk.bytes));
  fields.put(std::string_view(is_compressed ? "zstd" : ""));
  fields.put(entry.compressed);
  fields.putBytes(is_compressed ? compressed_bytes : chunk.bytes);
  if (auto done = record(mcap::kChunk, fields); !done) return done;
  entry.length = offset - entry.offset;
  if (auto done = writeIndices(entry); !done) return done;
  summary.add(std::move(entry), has_messages);
  chunk.bytes.clear();
  index.clear();
  first_time = std::numeric_limits<std::int64_t>::max();
  last_time = 0;
  return {};
}

Result<void> McapWriter::Impl::writeIndices(mcap::ChunkIndex& entry) {
  const std::uint64_t begin = offset;
  for (auto& [channel, records] : index) {
    std::stable_sort(records.begin(), records.end(), [](const auto& a, const auto& b) {
      return static_cast<std::int64_t>(a.first) < static_cast<std::int64_t>(b.first);
    });
    entry.message_indices[channel] = offset;
    record::mcap::FieldWriter fields;
    fields.put(channel);
    fields.put(static_cast<std::uint32_t>(records.size() * 16));
    for (const auto& [time, at] : records) fields.put(time), fields.put(at);
    if (auto done = record(mcap::kMessageIndex, fields); !done) return done;
  }
  entry.indices_length = offset - begin;
  return {};
}

Result<void> McapWriter::addMetadata(std::string_view name,
                                     const std::map<std::string, std::string>& values) {
  Impl& to = *impl_;
  if (auto done = to.endChunk(); !done) return done;
  record::mcap::FieldWriter fields;
  std::map<std::string, std::string> all = values;
  all[mcap::kChecksumKey] = mcap::checksumOf(name, values);
  fields.put(name);
  fields.put(all);
  const std::uint64_t at = to.offset;
  if (auto done = to.record(mcap::kMetadata, fields); !done) return done;
  to.summary.addMetadata(name, at, to.offset - at);
  return {};
}

Result<void> McapWriter::addAttachment(std::string_view name, std::string_view media_type,
                                       std::span<const std::uint8_t> data) {
  Impl& to = *impl_;
  if (auto done = to.endChunk(); !done) return done;
  record::mcap::FieldWriter fields;
  const std::int64_t time = to.summary.end;
  fields.put(time);
  fields.put(time);
  fields.put(name);
  fields.put(media_type);
  fields.put(static_cast<std::uint64_t>(data.size()));
  fields.putBytes(data);
  fields.put(mcap::crc32(fields.bytes));
  const std::uint64_t at = to.offset;
  if (auto done = to.record(mcap::kAttachment, fields); !done) return done;
  record::mcap::FieldWriter entry;
  entry.put(at);
  entry.put(to.offset - at);
  entry.put(time);
  entry.put(time);
  entry.put(static_cast<std::uint64_t>(data.size()));
  entry.put(name);
  entry.put(media_type);
  mcap::append(to.summary.attachment_index, mcap::kAttachmentIndex, entry);
  ++to.summary.attachments;
  return {};
}

Result<void> McapWriter::endChunk() {
  if (impl_->descriptor < 0) return fail(impl_->file.string() + ": is already closed");
  return impl_->endChunk();
}

Result<void> McapWriter::flush() {
  if (impl_->descriptor < 0) return fail(impl_->file.string() + ": is already closed");
  auto done = impl_->endChunk();
  ::fdatasync(impl_->descriptor);
  return done;
}

Result<void> McapWriter::Impl::writeSummary() {
  record::mcap::FieldWriter data_end;
  data_end.put(has_data_crc ? data_crc : 0U);
  if (auto done = record(mcap::kDataEnd, data_end); !done) return done;
  return put(summary.bytes(offset));
}

Result<void> McapWriter::close() {
  Impl& to = *impl_;
  if (to.descriptor < 0) return {};
  auto done = to.endChunk();
  if (done) done = to.writeSummary();
  ::fdatasync(to.descriptor);
  const int closed = ::close(std::exchange(to.descriptor, -1));
  if (done && closed != 0)
    return fail(to.file.string() + ": cannot be closed (" + std::strerror(errno) + ")");
  return done;
}

std::uint64_t McapWriter::messages() const { return impl_->summary.messages; }

}  // namespace tenon::record
