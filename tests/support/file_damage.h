#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

namespace tenon::test {

/// Damages the bytes of a file, the same way on every machine for the same seed. Whoever reads files with
/// checksums has to correct them afterwards, or no damage reaches what validates the content.
class FileDamage {
 public:
  using Bytes = std::vector<std::uint8_t>;

  explicit FileDamage(std::uint64_t seed) : random_(seed) {}

  /// Damages bytes[first..last) in one to three ways; `last` may be beyond the end.
  void damage(Bytes& bytes, std::size_t first = 0, std::size_t last = SIZE_MAX) {
    for (std::uint64_t ways = 1 + random_() % 3; ways > 0; --ways) {
      last = std::min(last, bytes.size());
      if (first >= last) return;
      damageOnce(bytes, first, last);
    }
  }
  /// Cuts bytes off the end.
  void truncate(Bytes& bytes) { bytes.resize(below(bytes.size())); }

  /// A number in [0, end), 0 when that is empty.
  std::size_t below(std::size_t end) { return end == 0 ? 0 : static_cast<std::size_t>(random_() % end); }

 private:
  void damageOnce(Bytes& bytes, std::size_t first, std::size_t last) {
    const auto at = [&] { return first + below(last - first); };
    switch (random_() % 4) {
      case 0:
        bytes[at()] ^= static_cast<std::uint8_t>(1U << (random_() % 8));
        return;
      case 1:
        bytes[at()] = static_cast<std::uint8_t>(random_());
        return;
      case 2:
        return putExtreme(bytes, at(), last);
      default: {
        // eight bytes from elsewhere: numbers that are plausible, in the wrong place
        const std::size_t from = at() & ~std::size_t{3};
        const std::size_t to = at() & ~std::size_t{3};
        for (std::size_t i = 0; i < 8 && from + i < bytes.size() && to + i < last; ++i)
          if (to + i >= first) bytes[to + i] = bytes[from + i];
      }
    }
  }

  /// A number at the limit of its type, at a multiple of its size: counts of 0 and of billions, NaN,
  /// infinity.
  void putExtreme(Bytes& bytes, std::size_t at, std::size_t last) {
    static constexpr std::array<std::uint64_t, 13> kNumbers{0,
                                                            1,
                                                            0x7F,
                                                            0xFF,
                                                            0xFFFF,
                                                            0x7FFFFFFF,
                                                            0x40000000,            // DistanceField::kRefined
                                                            0x80000000,            // -0 as a float
                                                            0x7FC00000,            // NaN as a float
                                                            0x7F800000,            // infinity as a float
                                                            0x7FF8000000000000,    // NaN as a double
                                                            0x7FEFFFFFFFFFFFFF,    // the largest double
                                                            0xFFFFFFFFFFFFFFFFU};  // -1; as a double NaN
    const std::uint64_t number = kNumbers[below(kNumbers.size())];
    static constexpr std::array<std::size_t, 4> kSizes{1, 2, 4, 8};
    const std::size_t size =
        number > 0xFFFFFFFFU && number != kNumbers.back() ? 8 : kSizes[below(kSizes.size())];
    at -= at % size;
    std::array<std::uint8_t, 8> raw{};
    std::memcpy(raw.data(), &number, sizeof number);
    for (std::size_t i = 0; i < size && at + i < last; ++i) bytes[at + i] = raw[i];
  }

  std::mt19937_64 random_;
};

inline std::vector<std::uint8_t> bytesOf(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void writeBytes(const std::filesystem::path& file, const std::vector<std::uint8_t>& bytes) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace tenon::test
