#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"

namespace tenon {

struct McapMessage {
  std::string_view topic;
  std::string_view type_name;
  std::int64_t log_time_ns = 0;
  std::uint32_t sequence = 0;
  std::span<const std::uint8_t> data;  ///< valid until the next call of the reader
};

struct McapChannel {
  std::string topic;
  std::string type_name;
  std::string schema_text;
  std::uint64_t messages = 0;  ///< as the file's statistics count them; 0 in a file that was cut
};

struct McapAttachment {
  std::string name;
  std::string media_type;
  std::span<const std::uint8_t> data;  ///< valid as long as the reader
};

/// Reads an MCAP file in file order. A file that was cut (a crash, a full disk) is read as far as its last
/// whole chunk; a chunk whose checksum is wrong is left out; `problem` says so.
///
/// Threads: one at a time. Real-time: no.
class McapReader {
 public:
  [[nodiscard]] static Result<McapReader> open(const std::filesystem::path& file);
  ~McapReader();
  McapReader(McapReader&&) noexcept;
  McapReader& operator=(McapReader&&) noexcept;

  /// The next message; false at the end.
  bool next(McapMessage& message);
  /// Goes on with the first chunk that holds messages at or after this time, leaving out earlier ones.
  void seek(std::int64_t log_time_ns);

  [[nodiscard]] bool complete() const;               ///< false: the file has no proper end
  [[nodiscard]] const std::string& problem() const;  ///< what was wrong with the file, or empty
  [[nodiscard]] const std::vector<McapChannel>& channels() const;
  [[nodiscard]] const std::multimap<std::string, std::map<std::string, std::string>>& metadata() const;
  [[nodiscard]] const std::vector<McapAttachment>& attachments() const;

 private:
  struct Impl;
  explicit McapReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon
