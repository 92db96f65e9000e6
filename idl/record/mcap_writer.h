#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "idl/types/result.h"

namespace tenon {

struct McapOptions {
  bool compress = true;
};

/// Writes a recording as an MCAP file (encoding `cdr`, schemas `omgidl`) that public tools open.
///
/// Messages go into zstd chunks of at most 1 MiB; a chunk is closed at least every 250 ms of writing and the
/// file is brought to the disk every second, so after a crash all but the last moment is readable. Checksums
/// over chunks, data and summary; indices for seeking.
///
/// Threads: one at a time. Real-time: no.
class McapWriter {
 public:
  [[nodiscard]] static Result<McapWriter> open(const std::filesystem::path& file,
                                               const McapOptions& options = {});
  ~McapWriter();  ///< closes
  McapWriter(McapWriter&&) noexcept;
  McapWriter& operator=(McapWriter&&) noexcept;

  /// A channel with its schema; the same type name shares one schema.
  std::uint16_t addChannel(std::string_view topic, std::string_view type_name, std::string_view schema_text);
  [[nodiscard]] Result<void> write(std::uint16_t channel, std::int64_t log_time_ns, std::uint32_t sequence,
                                   std::span<const std::uint8_t> data);
  [[nodiscard]] Result<void> addMetadata(std::string_view name,
                                         const std::map<std::string, std::string>& values);
  [[nodiscard]] Result<void> addAttachment(std::string_view name, std::string_view media_type,
                                           std::span<const std::uint8_t> data);
  /// Everything so far is in the file.
  [[nodiscard]] Result<void> flush();
  /// Writes the summary and ends the file; the writer takes nothing more.
  [[nodiscard]] Result<void> close();
  [[nodiscard]] std::uint64_t messages() const;

 private:
  struct Impl;
  explicit McapWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon
