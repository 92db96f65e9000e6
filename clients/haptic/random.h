#pragma once

#include <cstdint>

namespace tenon {

/// Seeded numbers for simulated people: the same on every machine (SplitMix64, Steele et al. 2014), which the
/// distributions of the standard library are not.
///
/// Threads: one. Real-time: everything.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() noexcept {
    state_ += 0x9E3779B97F4A7C15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31U);
  }
  double uniform(double from, double to) noexcept {
    return from + (to - from) * (static_cast<double>(next() >> 11U) * 0x1.0p-53);
  }

 private:
  std::uint64_t state_;
};

}  // namespace tenon
