#include "idl/record/compression.h"

#include <zstd.h>

namespace tenon::record {

Result<std::vector<std::uint8_t>> compress(std::span<const std::uint8_t> plain) {
  constexpr int kLevel = 3;
  std::vector<std::uint8_t> bytes(ZSTD_compressBound(plain.size()));
  const std::size_t size = ZSTD_compress(bytes.data(), bytes.size(), plain.data(), plain.size(), kLevel);
  if (ZSTD_isError(size) != 0) return fail(ZSTD_getErrorName(size));
  bytes.resize(size);
  return bytes;
}

Result<std::vector<std::uint8_t>> decompress(std::span<const std::uint8_t> compressed, std::size_t most) {
  // also of what is no frame, or does not state its size
  const unsigned long long size = ZSTD_getFrameContentSize(compressed.data(), compressed.size());
  if (size > most) return fail("is damaged or too large");
  std::vector<std::uint8_t> plain(size);
  const std::size_t got = ZSTD_decompress(plain.data(), plain.size(), compressed.data(), compressed.size());
  if (ZSTD_isError(got) != 0 || got != size) return fail("is damaged");
  return plain;
}

}  // namespace tenon::record
