#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace tenon::record::mcap {

/// A part of a file that cannot be read, with records after it that can.
struct UnreadablePart {
  std::size_t begin = 0, end = 0;  ///< [bytes] of the file
};

/// Follows the records of a file in their order. A record counts only where its own lengths agree with its
/// length, and the footer only at the end of the file. Where there is none that counts, it continues with the
/// next chunk, attachment, metadata or end of the data: after damage nothing is lost that can be read. What
/// is torn at the end is no record, with or without the zeros that a power loss leaves there.
///
/// Of what looks like records after damage and is none, it reads a few times the size of the file at most.
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
  /// What was skipped right before the record; nothing: no damage.
  [[nodiscard]] const std::optional<UnreadablePart>& unreadable() const { return unreadable_; }
  /// At the end: what follows end() was searched no further, although records may be there.
  [[nodiscard]] bool gaveUp() const { return has_given_up_; }
  /// At the end: what follows end() is not the begin of a record that is torn, but one that is damaged.
  [[nodiscard]] bool hasDamagedEnd() const { return has_damaged_end_; }

 private:
  bool take(std::size_t at, std::uint8_t& opcode, std::span<const std::uint8_t>& fields);
  bool isRecordAt(std::size_t at);
  [[nodiscard]] bool isTornAt(std::size_t at) const;
  bool isFoundAt(std::size_t at);
  bool agrees(std::uint8_t opcode, std::span<const std::uint8_t> fields);
  bool isWholeChunk(std::span<const std::uint8_t> fields);
  bool hasItsChecksum(std::span<const std::uint8_t> attachment);
  [[nodiscard]] std::optional<std::size_t> search(std::size_t from);
  void spend(std::uint64_t bytes);

  std::span<const std::uint8_t> file_;
  std::size_t zeros_;      ///< [bytes] from where on the file has nothing but zeros
  std::size_t begin_ = 0;  ///< [bytes]
  std::size_t end_;        ///< [bytes]
  std::optional<UnreadablePart> unreadable_;
  std::uint64_t budget_;  ///< [bytes] that searches may still read in vain
  bool has_given_up_ = false;
  bool has_damaged_end_ = false;
  std::vector<std::uint8_t> plain_;
};

}  // namespace tenon::record::mcap
