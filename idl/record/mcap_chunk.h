#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "idl/types/result.h"

/// What all readers of MCAP files share.
namespace tenon::record::mcap {

/// A file mapped read-only into memory, as long as this lives.
class MappedFile {
 public:
  MappedFile() = default;
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  /// Fails when it cannot be opened, is empty or no file.
  [[nodiscard]] Result<std::span<const std::uint8_t>> map(const std::filesystem::path& file);

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

/// Whether a file begins as MCAP files do.
[[nodiscard]] bool beginsWithMagic(std::span<const std::uint8_t> bytes);

/// Takes the next record from `rest`; false at the end or when the record is incomplete or none.
bool takeRecord(std::span<const std::uint8_t>& rest, std::uint8_t& opcode,
                std::span<const std::uint8_t>& fields);

/// Log times [ns] of messages.
struct TimeRange {
  std::int64_t first = 0, last = 0;  ///< [ns] 0: there is no message
  bool operator==(const TimeRange&) const = default;
};
/// Of a message index whose entries are in the order of their times.
[[nodiscard]] TimeRange timesOfIndex(std::span<const std::uint8_t> fields);
/// That of both; one without a message changes nothing.
[[nodiscard]] TimeRange joined(const TimeRange& one, const TimeRange& other);
/// Of the messages among the records of a chunk.
[[nodiscard]] TimeRange timesOfMessages(std::span<const std::uint8_t> records);

/// Replaces `plain` by the records of a chunk. What is wrong with it, as in "is damaged"; empty: nothing.
[[nodiscard]] std::string openChunk(std::span<const std::uint8_t> fields, std::vector<std::uint8_t>& plain);

}  // namespace tenon::record::mcap
