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

namespace tenon::record {

/// A message of a recording. Its views are valid until the next call of the reader.
struct McapMessage {
  std::string_view topic;
  std::string_view type_name;
  std::int64_t log_time_ns = 0;  ///< [ns] since 1970, as the writer gave it
  std::uint32_t sequence = 0;
  std::span<const std::uint8_t> data;  ///< in the channel's encoding
};

struct McapChannel {
  std::string topic;
  std::string type_name;
  std::string schema_text;
  std::uint64_t messages = 0;  ///< by the statistics of the file; 0 in a truncated file
};

struct McapAttachment {
  std::string name;
  std::string media_type;
  std::span<const std::uint8_t> data;  ///< valid during the life of the reader
};

/// Reads an MCAP file in file order. A truncated file (crash, full disk) is read up to its last complete
/// chunk, and a damaged part is skipped, also one at the end; problem() tells them apart.
///
/// Threads: one at a time. Real-time: no.
class McapReader {
 public:
  /// Fails when `file` cannot be read or is no MCAP file.
  [[nodiscard]] static Result<McapReader> open(const std::filesystem::path& file);
  ~McapReader();
  McapReader(McapReader&&) noexcept;
  McapReader& operator=(McapReader&&) noexcept;

  /// The next message; false at the end.
  bool next(McapMessage& message);
  /// Continues with the first message in the file whose log time [ns] is not before `log_time_ns`; earlier
  /// messages after it are skipped.
  void seek(std::int64_t log_time_ns);

  /// [ns] Log time of the newest message in the last chunk that has messages; 0: there is none.
  [[nodiscard]] std::int64_t lastTime() const;
  [[nodiscard]] bool complete() const;   ///< false: the file is truncated
  [[nodiscard]] bool isDamaged() const;  ///< as found so far, beyond a truncation
  /// Both, as found so far: the first places that are damaged and how many more, or empty.
  [[nodiscard]] std::string problem() const;
  [[nodiscard]] const std::vector<McapChannel>& channels() const;
  [[nodiscard]] const std::multimap<std::string, std::map<std::string, std::string>>& metadata() const;
  [[nodiscard]] const std::vector<McapAttachment>& attachments() const;

 private:
  struct Impl;
  explicit McapReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon::record
