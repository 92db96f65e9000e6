#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/result.h"

/// Attachments of recordings, which MCAP keeps as they are (media type kCompressedType).
namespace tenon::record {

inline constexpr char kCompressedType[] = "application/zstd";

/// One zstd frame that states its size. Threads: any. Real-time: no.
[[nodiscard]] Result<std::vector<std::uint8_t>> compress(std::span<const std::uint8_t> plain);
/// Fails when `compressed` is no such frame, is damaged, or is of more than `most` bytes.
[[nodiscard]] Result<std::vector<std::uint8_t>> decompress(std::span<const std::uint8_t> compressed,
                                                           std::size_t most);

}  // namespace tenon::record
