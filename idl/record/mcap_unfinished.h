#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "idl/record/mcap_summary.h"
#include "idl/types/result.h"

namespace tenon::record::mcap {

/// The content of a file whose program was killed while it wrote it.
struct Unfinished {
  Summary summary;  ///< of what is before `end`
  /// [bytes] Where the last complete chunk begins; where that is damaged, it stays: its end. Where what
  /// follows that is damaged and not torn, it stays too: the end of the file.
  std::uint64_t end = 0;
  std::vector<std::uint8_t> last_chunk;  ///< the records of the one that begins there
  /// Its messages by channel: log time [ns] and place in last_chunk [bytes].
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> last_index;
  /// Metadata after that chunk: name and fields of each record.
  std::vector<std::pair<std::string, std::vector<std::uint8_t>>> later_metadata;
};

/// Reads the heads of its records; of its chunks the last one alone, and as many from the first as define the
/// channels. Fails when it is no MCAP file, was closed, has no complete chunk, or is damaged so that its end
/// is not found.
[[nodiscard]] Result<Unfinished> readUnfinished(const std::filesystem::path& file);

}  // namespace tenon::record::mcap
