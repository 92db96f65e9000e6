#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// What writer and reader share of the MCAP file format (version 0, https://mcap.dev/spec).
namespace tenon::record::mcap {

inline constexpr std::uint8_t kMagic[8] = {0x89, 'M', 'C', 'A', 'P', 0x30, '\r', '\n'};

enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

inline constexpr std::size_t kRecordHeaderBytes = 9;  // opcode and length

// A chunk whose size is more than that beyond its compressed one is an attack. Messages that hardly differ
// from each other shrink to a 150th, zeros to less: such a chunk is stored as it is.
inline constexpr std::uint64_t kMostRatio = 256;             // [-]
inline constexpr std::uint64_t kAnyChunkBytes = 64U << 10U;  // [bytes] whatever the ratio

/// CRC-32 (IEEE 802.3), the checksum of the format. `crc`: result for the bytes before, to continue it.
[[nodiscard]] std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t crc = 0);

/// Metadata have no checksum in the format: ours have one among their values.
inline constexpr const char* kChecksumKey = "tenon checksum";
[[nodiscard]] std::string checksumOf(std::string_view title,
                                     const std::map<std::string, std::string>& values);
/// Takes it from `values`; false: it is another one than that of the rest. Those of other programs have none.
[[nodiscard]] bool takeChecksum(std::string_view title, std::map<std::string, std::string>& values);

/// Builds a record from little-endian fields.
class FieldWriter {
 public:
  template <typename T>
  void put(T value) {
    const auto at = bytes.size();
    bytes.resize(at + sizeof(T));
    std::memcpy(bytes.data() + at, &value, sizeof(T));
  }
  void put(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size()));
    putBytes({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  }
  void put(const std::map<std::string, std::string>& values) {
    FieldWriter inner;
    for (const auto& [key, value] : values)
      inner.put(std::string_view(key)), inner.put(std::string_view(value));
    put(static_cast<std::uint32_t>(inner.bytes.size()));
    putBytes(inner.bytes);
  }
  void putBytes(std::span<const std::uint8_t> more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

  std::vector<std::uint8_t> bytes;
};

/// Reads the fields of a record. Past the end, values are zero or empty and `ok` stays false.
class FieldReader {
 public:
  explicit FieldReader(std::span<const std::uint8_t> bytes) : rest(bytes) {}

  template <typename T>
  T get() {
    T value{};
    if (const auto part = take(sizeof(T)); part.size() == sizeof(T))
      std::memcpy(&value, part.data(), sizeof(T));
    return value;
  }
  std::string_view text() {
    const auto part = take(get<std::uint32_t>());
    return {reinterpret_cast<const char*>(part.data()), part.size()};
  }
  std::map<std::string, std::string> values() {
    FieldReader inner(take(get<std::uint32_t>()));
    std::map<std::string, std::string> found;
    while (inner.ok && !inner.rest.empty()) {
      const std::string key(inner.text());
      found[key] = inner.text();
    }
    ok = ok && inner.ok;
    return found;
  }
  std::span<const std::uint8_t> take(std::uint64_t count) {
    if (rest.size() < count) {
      ok = false;
      rest = {};
      return {};
    }
    const auto part = rest.first(count);
    rest = rest.subspan(count);
    return part;
  }

  std::span<const std::uint8_t> rest;  ///< not read yet
  bool ok = true;
};

}  // namespace tenon::record::mcap
