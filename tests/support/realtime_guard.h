#pragma once

#include <cstdint>

namespace tenon::test {

/// Counts heap calls and locks of this thread while the guard exists: a 1 kHz loop must have none.
///
/// The test program's malloc family and pthread lock functions interpose those of the C library, so calls by
/// libraries on this thread are counted as well. ASan and TSan interpose the same functions: then the guard
/// counts nothing and available() is false.
///
/// Threads: counts and belongs to the thread that constructed it. Real-time: reading the counts.
class RealtimeGuard {
 public:
  RealtimeGuard();

  /// malloc, calloc, realloc, aligned allocation and free, operators new and delete included.
  [[nodiscard]] std::int64_t allocations() const;
  /// Mutexes and read-write locks taken, or tried.
  [[nodiscard]] std::int64_t locks() const;
  [[nodiscard]] static bool available();

 private:
  std::int64_t allocations_before_;
  std::int64_t locks_before_;
};

}  // namespace tenon::test
