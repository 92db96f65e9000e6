#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
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

/// Replaces `plain` by the records of a chunk. What is wrong with it, as in "is damaged"; empty: nothing.
[[nodiscard]] std::string openChunk(std::span<const std::uint8_t> fields, std::vector<std::uint8_t>& plain);

/// A part of a file that cannot be read, with chunks after it.
struct UnreadablePart {
  std::size_t begin = 0, end = 0;  ///< [bytes] of the file
};

/// Follows the records of a file in their order. Where there is none although chunks follow, it goes on with
/// the first of them: after damage nothing is lost that can be read.
///
/// Threads: one at a time. Real-time: no.
class RecordSequence {
 public:
  /// `file` begins with the magic, and must outlive this.
  explicit RecordSequence(std::span<const std::uint8_t> file);

  /// The next record; false at the end.
  bool next(std::uint8_t& opcode, std::span<const std::uint8_t>& fields);
  [[nodiscard]] std::size_t begin() const { return begin_; }  ///< [bytes] of the record
  [[nodiscard]] std::size_t end() const { return end_; }      ///< [bytes] likewise
  /// The first one so far; none: all was read.
  [[nodiscard]] const std::optional<UnreadablePart>& unreadable() const { return unreadable_; }

 private:
  bool skipDamage();

  std::span<const std::uint8_t> file_;
  std::size_t begin_ = 0;  ///< [bytes]
  std::size_t end_;        ///< [bytes]
  std::size_t chunk_ = 0;  ///< [bytes] begin of the last chunk
  std::optional<UnreadablePart> unreadable_;
};

}  // namespace tenon::record::mcap
