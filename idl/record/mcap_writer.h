#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "idl/types/result.h"

namespace tenon::record {

struct McapOptions {
  bool compress = true;                      ///< chunks by zstd
  std::chrono::milliseconds chunk_age{250};  ///< at which a chunk is closed: longer ones are smaller
};

/// Writes a recording as an MCAP file (encoding `cdr`, schemas `omgidl`) for public tools.
///
/// Messages are collected in chunks of about 1 MiB. A chunk is closed when it is McapOptions::chunk_age old
/// at the next write, and the file is synchronised to disk (fdatasync) every second, so that after a crash
/// all but the last second is readable. It has checksums of chunks, data and summary, and indices for
/// seeking; metadata have a checksum among their values. Schemas and channels are repeated in some later
/// chunks: damage of the first does not lose them.
///
/// Threads: one at a time. Real-time: no.
class McapWriter {
 public:
  /// Overwrites `file` and creates its folder. Fails when it cannot be written.
  [[nodiscard]] static Result<McapWriter> open(const std::filesystem::path& file,
                                               const McapOptions& options = {});
  /// Continues a file whose program was killed, after its last complete chunk; what is torn after that is
  /// cut, and what is damaged stays.
  /// Its channels are found again by addChannel. Fails when it is no MCAP file, was closed, is being written
  /// by another program, or has no complete chunk.
  [[nodiscard]] static Result<McapWriter> reopen(const std::filesystem::path& file,
                                                 const McapOptions& options = {});
  ~McapWriter();  ///< closes the file and ignores errors
  McapWriter(McapWriter&&) noexcept;
  McapWriter& operator=(McapWriter&&) noexcept;

  /// Adds a channel and returns its id; of a topic that has one, that. Channels of one type name share the
  /// schema of the first.
  std::uint16_t addChannel(std::string_view topic, std::string_view type_name, std::string_view schema_text);
  /// `log_time_ns` in [ns], by convention since 1970. Fails when the disk is full or the file closed; so do
  /// all functions below.
  [[nodiscard]] Result<void> write(std::uint16_t channel, std::int64_t log_time_ns, std::uint32_t sequence,
                                   std::span<const std::uint8_t> data);
  [[nodiscard]] Result<void> addMetadata(std::string_view name,
                                         const std::map<std::string, std::string>& values);
  [[nodiscard]] Result<void> addAttachment(std::string_view name, std::string_view media_type,
                                           std::span<const std::uint8_t> data);
  /// Closes the current chunk: what was written survives the end of this process, not yet that of the
  /// machine.
  [[nodiscard]] Result<void> endChunk();
  /// Writes all messages so far to the disk.
  [[nodiscard]] Result<void> flush();
  /// Writes the summary and closes the file; without effect when it is closed.
  [[nodiscard]] Result<void> close();
  /// Messages written so far.
  [[nodiscard]] std::uint64_t messages() const;

 private:
  struct Impl;
  explicit McapWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon::record
