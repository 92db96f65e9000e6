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

/// Replaces `plain` by the records of a chunk. What is wrong with it, as in "is damaged"; empty: nothing.
[[nodiscard]] std::string openChunk(std::span<const std::uint8_t> fields, std::vector<std::uint8_t>& plain);

}  // namespace tenon::record::mcap
