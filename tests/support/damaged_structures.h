#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include <xxhash.h>

#include "tests/support/file_damage.h"

namespace tenon::test {

/// [bytes] The header of a structure file begins with magic, version and byte order, which are tested by
/// themselves.
inline constexpr std::size_t kStructureFileStart = 16;
inline constexpr std::size_t kStructureFileHeader = 568;
/// Where the header lists the first byte of each section, then the number of elements of each.
inline constexpr std::size_t kSectionsAt = 112;
inline constexpr std::size_t kSections = 22;

/// Sets the size and the checksum that the header of a structure file states to those of `bytes`.
inline void correctStructureChecksum(std::vector<std::uint8_t>& bytes) {
  constexpr std::size_t kSizeAt = 16;
  constexpr std::size_t kChecksumAt = 24;
  if (bytes.size() < kChecksumAt + 8) return;
  const std::uint64_t size = bytes.size();
  std::memcpy(bytes.data() + kSizeAt, &size, sizeof size);
  std::memset(bytes.data() + kChecksumAt, 0, 8);
  const std::uint64_t checksum = XXH64(bytes.data(), bytes.size(), 0);
  std::memcpy(bytes.data() + kChecksumAt, &checksum, sizeof checksum);
}

/// Damage number `seed` of a structure file, with a right checksum: in its header, or in one of its sections.
inline std::vector<std::uint8_t> damagedStructures(const std::vector<std::uint8_t>& whole,
                                                   std::uint64_t seed) {
  constexpr std::array<std::size_t, kSections> kElementBytes{4, 2,  2,  28, 24, 24, 32, 1, 1,  1, 1,
                                                             4, 28, 24, 24, 32, 36, 28, 4, 72, 4, 16};
  constexpr std::size_t kCountAt = kSectionsAt + 8 * kElementBytes.size();
  const auto number = [&whole](std::size_t at) {
    std::uint64_t value = 0;
    std::memcpy(&value, whole.data() + at, sizeof value);
    return static_cast<std::size_t>(value);
  };
  std::vector<std::uint8_t> bytes = whole;
  FileDamage damage(seed);
  if (seed % 16 == 0) damage.truncate(bytes);
  if (seed % 3 == 0) {
    damage.damage(bytes, kStructureFileStart, kStructureFileHeader);
  } else {
    const std::size_t section = damage.below(kElementBytes.size());
    const std::size_t first = number(kSectionsAt + 8 * section);
    damage.damage(bytes, first, first + kElementBytes[section] * number(kCountAt + 8 * section));
  }
  correctStructureChecksum(bytes);
  return bytes;
}

}  // namespace tenon::test
