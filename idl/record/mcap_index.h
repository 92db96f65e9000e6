#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace tenon::record::mcap {

/// What of a file a player cannot read, which asks the index at its end where the chunks are, and message
/// indices where the messages of a channel are within a chunk.
struct IndexFindings {
  std::string problem;      ///< at which a player ends, in plain words; empty: none
  std::size_t skipped = 0;  ///< chunks that are not in the index: they are not played
};

/// Called with the fraction that is checked, after each chunk.
using CheckProgress = std::function<void(double fraction)>;

/// Reads all chunks, unless `stop` is set meanwhile. `file` begins with the magic and ends with a footer.
///
/// Threads: any. Real-time: no.
[[nodiscard]] IndexFindings checkIndex(std::span<const std::uint8_t> file, const std::atomic<bool>& stop,
                                       const CheckProgress& progress);

}  // namespace tenon::record::mcap
