#pragma once

#include <cstdint>

namespace tenon {

/// Seeded pseudo-random generator of simulated people and devices (SplitMix64, Steele et al. 2014). Its
/// numbers are the same on every machine; the distributions of the standard library are
/// implementation-defined.
///
/// Threads: one. Real-time: everything.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  /// The next 64 random bits.
  std::uint64_t next() noexcept {
    state_ += 0x9E3779B97F4A7C15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31U);
  }
  /// Uniformly distributed in [`low`, `high`), for `low` and `high` [any unit].
  double uniform(double low, double high) noexcept {
    return low + (high - low) * (static_cast<double>(next() >> 11U) * 0x1.0p-53);
  }

 private:
  std::uint64_t state_;
};

}  // namespace tenon
