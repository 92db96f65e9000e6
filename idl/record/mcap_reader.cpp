#include "idl/record/mcap_reader.h"

#include <cerrno>
#include <cstring>
#include <limits>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include "idl/record/mcap_format.h"

namespace tenon {
namespace {

using mcap::FieldReader;

constexpr std::uint64_t kLargestChunk = 256U << 20U;  // [bytes] unpacked: more is damage or an attack

/// A file's bytes, mapped; nothing when it cannot be.
class MappedFile {
 public:
  ~MappedFile() {
    if (data_ != nullptr) ::munmap(data_, size_);
  }
  Result<std::span<const std::uint8_t>> map(const std::filesystem::path& file) {
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return fail(file.string() + ": cannot be opened (" + std::strerror(errno) + ")");
    struct stat status {};
    const bool known = ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0;
    if (known) {
      size_ = static_cast<std::size_t>(status.st_size);
      void* data = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
      if (data != MAP_FAILED) data_ = data;
    }
    ::close(descriptor);
    if (data_ == nullptr) return fail(file.string() + ": is empty or not a file");
    return std::span(static_cast<const std::uint8_t*>(data_), size_);
  }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

struct ChunkPlace {
  std::int64_t first_time = 0, last_time = 0;
  std::span<const std::uint8_t> fields;
};

/// The next record of a list of records; false at its end or where it is cut.
bool takeRecord(std::span<const std::uint8_t>& rest, std::uint8_t& opcode,
                std::span<const std::uint8_t>& fields) {
  if (rest.size() < mcap::kRecordHead) return false;
  std::uint64_t length = 0;
  opcode = rest[0];
  std::memcpy(&length, rest.data() + 1, sizeof(length));
  if (rest.size() - mcap::kRecordHead < length) return false;
  fields = rest.subspan(mcap::kRecordHead, length);
  rest = rest.subspan(mcap::kRecordHead + length);
  return true;
}

}  // namespace

struct McapReader::Impl {
  MappedFile mapped;
  std::string name;
  bool complete = false;
  bool summary_is_good = true;
  std::string problem;
  std::vector<ChunkPlace> chunks;
  std::map<std::uint16_t, std::pair<std::string, std::string>> schemas;  // type name, text
  std::map<std::uint16_t, std::size_t> channel_places;                   // id -> index into channels
  std::vector<McapChannel> channels;
  std::multimap<std::string, std::map<std::string, std::string>> metadata;
  std::vector<McapAttachment> attachments;

  std::size_t next_chunk = 0;
  std::int64_t not_before = std::numeric_limits<std::int64_t>::min();
  std::vector<std::uint8_t> unpacked;
  std::span<const std::uint8_t> rest;

  void scan(std::span<const std::uint8_t> bytes);
  void checkSummary(std::span<const std::uint8_t> summary);
  void readDefinition(std::uint8_t opcode, std::span<const std::uint8_t> fields);
  void readTopLevel(std::uint8_t opcode, std::span<const std::uint8_t> fields);
  void readStatistics(std::span<const std::uint8_t> fields);
  bool unpack(const ChunkPlace& place);
  void complain(const std::string& what) {
    if (problem.empty()) problem = name + ": " + what;
  }
};

McapReader::McapReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
McapReader::McapReader(McapReader&&) noexcept = default;
McapReader& McapReader::operator=(McapReader&&) noexcept = default;
McapReader::~McapReader() = default;

bool McapReader::complete() const { return impl_->complete; }
const std::string& McapReader::problem() const { return impl_->problem; }
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
  if (bytes->size() < sizeof(mcap::kMagic) ||
      std::memcmp(bytes->data(), mcap::kMagic, sizeof(mcap::kMagic)) != 0)
    return fail(file.string() + ": is not a recording (no MCAP file)");
  impl->scan(bytes->subspan(sizeof(mcap::kMagic)));

  // without a summary the channels are those that the chunks define
  if (!impl->complete || !impl->summary_is_good) {
    if (!impl->complete) impl->complain("was cut: read up to its last whole chunk");
    for (const ChunkPlace& place : impl->chunks) {
      if (!impl->unpack(place)) continue;
      std::uint8_t opcode = 0;
      std::span<const std::uint8_t> fields;
      while (takeRecord(impl->rest, opcode, fields)) impl->readDefinition(opcode, fields);
    }
    impl->rest = {};
  }
  return McapReader(std::move(impl));
}

void McapReader::Impl::scan(std::span<const std::uint8_t> bytes) {
  std::uint8_t opcode = 0;
  std::span<const std::uint8_t> fields, summary;
  while (takeRecord(bytes, opcode, fields)) {
    readTopLevel(opcode, fields);
    if (opcode == mcap::kDataEnd) summary = bytes;
    if (opcode != mcap::kFooter) continue;
    complete =
        bytes.size() == sizeof(mcap::kMagic) && std::memcmp(bytes.data(), mcap::kMagic, bytes.size()) == 0;
    checkSummary(summary.first(summary.empty() ? 0 : summary.size() - bytes.size()));
    return;
  }
}

void McapReader::Impl::checkSummary(std::span<const std::uint8_t> summary) {
  std::uint32_t crc = 0;
  if (summary.size() >= sizeof(crc)) {
    std::memcpy(&crc, summary.data() + summary.size() - sizeof(crc), sizeof(crc));
    if (crc == 0 || crc == mcap::crc32(summary.first(summary.size() - sizeof(crc)))) return;
  }
  complain("its summary is damaged, its chunks are read without it");
  schemas.clear();
  channel_places.clear();
  channels.clear();
  summary_is_good = false;
}

void McapReader::Impl::readTopLevel(std::uint8_t opcode, std::span<const std::uint8_t> fields) {
  FieldReader in(fields);
  switch (opcode) {
    case mcap::kChunk: {
      ChunkPlace place;
      place.first_time = in.get<std::int64_t>();
      place.last_time = in.get<std::int64_t>();
      place.fields = in.rest;
      if (in.ok) chunks.push_back(place);
      return;
    }
    case mcap::kMetadata: {
      const std::string title(in.text());
      auto values = in.values();
      if (in.ok) metadata.emplace(title, std::move(values));
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
        return complain("an attachment is damaged and left out");
      attachments.push_back(std::move(attachment));
      return;
    }
    case mcap::kStatistics:
      return readStatistics(fields);
    default:
      return readDefinition(opcode, fields);
  }
}

void McapReader::Impl::readDefinition(std::uint8_t opcode, std::span<const std::uint8_t> fields) {
  FieldReader in(fields);
  const auto id = in.get<std::uint16_t>();
  if (opcode == mcap::kSchema) {
    const std::string type(in.text());
    in.text();
    const std::string text(in.text());
    if (in.ok) schemas[id] = {type, text};
  }
  if (opcode == mcap::kChannel && !channel_places.contains(id)) {
    const auto schema = schemas.find(in.get<std::uint16_t>());
    const std::string topic(in.text());
    if (!in.ok || schema == schemas.end()) return complain("a channel without a schema is left out");
    channel_places[id] = channels.size();
    channels.push_back({topic, schema->second.first, schema->second.second, 0});
  }
}

void McapReader::Impl::readStatistics(std::span<const std::uint8_t> fields) {
  FieldReader in(fields);
  in.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8);
  FieldReader counts(in.take(in.get<std::uint32_t>()));
  while (counts.ok && !counts.rest.empty()) {
    const auto id = counts.get<std::uint16_t>();
    const auto count = counts.get<std::uint64_t>();
    if (const auto place = channel_places.find(id); counts.ok && place != channel_places.end())
      channels[place->second].messages = count;
  }
}

bool McapReader::Impl::unpack(const ChunkPlace& place) {
  FieldReader in(place.fields);
  const auto size = in.get<std::uint64_t>();
  const auto crc = in.get<std::uint32_t>();
  const std::string_view compression = in.text();
  const auto packed = in.take(in.get<std::uint64_t>());
  const bool known = compression.empty() || compression == "zstd";
  if (!in.ok || !known || size > kLargestChunk) {
    complain("a chunk cannot be read and is left out");
    return false;
  }
  if (compression.empty()) {
    unpacked.assign(packed.begin(), packed.end());
  } else {
    // the frame itself says its size too: nothing is allocated on the word of one number alone
    if (ZSTD_getFrameContentSize(packed.data(), packed.size()) != size) {
      complain("a chunk is damaged and left out");
      return false;
    }
    unpacked.resize(size);
    const std::size_t got = ZSTD_decompress(unpacked.data(), size, packed.data(), packed.size());
    if (ZSTD_isError(got) != 0 || got != size) {
      complain("a chunk is damaged and left out");
      return false;
    }
  }
  if (crc != 0 && mcap::crc32(unpacked) != crc) {
    complain("a chunk has the wrong checksum and is left out");
    return false;
  }
  rest = unpacked;
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
      FieldReader in(fields);
      const auto channel = from.channel_places.find(in.get<std::uint16_t>());
      message.sequence = in.get<std::uint32_t>();
      message.log_time_ns = in.get<std::int64_t>();
      in.get<std::int64_t>();
      if (!in.ok || channel == from.channel_places.end() || message.log_time_ns < from.not_before) continue;
      message.topic = from.channels[channel->second].topic;
      message.type_name = from.channels[channel->second].type_name;
      message.data = in.rest;
      return true;
    }
    do {
      if (from.next_chunk == from.chunks.size()) return false;
    } while (from.chunks[from.next_chunk].last_time < from.not_before
                 ? (++from.next_chunk, true)
                 : !from.unpack(from.chunks[from.next_chunk++]));
  }
}

void McapReader::seek(std::int64_t log_time_ns) {
  impl_->not_before = log_time_ns;
  impl_->next_chunk = 0;
  impl_->rest = {};
}

}  // namespace tenon
