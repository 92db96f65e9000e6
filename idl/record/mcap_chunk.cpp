#include "idl/record/mcap_chunk.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include "idl/record/mcap_format.h"

namespace tenon::record::mcap {
namespace {

// Uncompressed; a larger size is damage or an attack.
constexpr std::uint64_t kMaxChunkBytes = 256U << 20U;  // [bytes]

}  // namespace

MappedFile::~MappedFile() {
  if (data_ != nullptr) ::munmap(data_, size_);
}

Result<std::span<const std::uint8_t>> MappedFile::map(const std::filesystem::path& file) {
  // a pipe is not waited for
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
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

bool beginsWithMagic(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= sizeof(kMagic) && std::memcmp(bytes.data(), kMagic, sizeof(kMagic)) == 0;
}

bool takeRecord(std::span<const std::uint8_t>& rest, std::uint8_t& opcode,
                std::span<const std::uint8_t>& fields) {
  if (rest.size() < kRecordHeaderBytes) return false;
  std::uint64_t length = 0;
  opcode = rest[0];
  if (opcode == 0) return false;  // of no record: a block of the disk that was never written
  std::memcpy(&length, rest.data() + 1, sizeof(length));
  if (rest.size() - kRecordHeaderBytes < length) return false;
  fields = rest.subspan(kRecordHeaderBytes, length);
  rest = rest.subspan(kRecordHeaderBytes + length);
  return true;
}

TimeRange timesOfIndex(std::span<const std::uint8_t> fields) {
  constexpr std::size_t kEntry = 16;  // [bytes] time and place
  FieldReader in(fields);
  in.take(sizeof(std::uint16_t));
  const auto entries = in.take(in.get<std::uint32_t>());
  if (entries.size() < kEntry) return {};
  FieldReader first(entries), last(entries.last(kEntry));
  return {first.get<std::int64_t>(), last.get<std::int64_t>()};
}

TimeRange joined(const TimeRange& one, const TimeRange& other) {
  if (one == TimeRange{} || other == TimeRange{}) return one == TimeRange{} ? other : one;
  return {std::min(one.first, other.first), std::max(one.last, other.last)};
}

TimeRange timesOfMessages(std::span<const std::uint8_t> records) {
  TimeRange times;
  std::uint8_t opcode = 0;
  for (std::span<const std::uint8_t> fields; takeRecord(records, opcode, fields);) {
    if (opcode != kMessage) continue;
    FieldReader in(fields);
    in.take(sizeof(std::uint16_t) + sizeof(std::uint32_t));
    const auto time = in.get<std::int64_t>();
    if (in.ok) times = joined(times, {time, time});
  }
  return times;
}

std::string openChunk(std::span<const std::uint8_t> fields, std::vector<std::uint8_t>& plain) {
  FieldReader in(fields);
  in.take(8 + 8);
  const auto size = in.get<std::uint64_t>();
  const auto crc = in.get<std::uint32_t>();
  const std::string_view compression = in.text();
  const auto compressed = in.take(in.get<std::uint64_t>());
  const bool known = compression.empty() || compression == "zstd";
  if (!in.ok || !known || size > kMaxChunkBytes) return "cannot be read";
  if (size > kAnyChunkBytes + kMostRatio * compressed.size()) return "claims to hold more than it can";
  if (compression.empty()) {
    plain.assign(compressed.begin(), compressed.end());
  } else {
    // the size must be that of the zstd frame: one damaged number must not cause a huge allocation
    if (ZSTD_getFrameContentSize(compressed.data(), compressed.size()) != size) return "is damaged";
    plain.resize(size);
    const std::size_t got = ZSTD_decompress(plain.data(), size, compressed.data(), compressed.size());
    if (ZSTD_isError(got) != 0 || got != size) return "is damaged";
  }
  return crc != 0 && crc32(plain) != crc ? "has a wrong checksum" : "";
}

}  // namespace tenon::record::mcap
