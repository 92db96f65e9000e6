#pragma once

#include <cstdint>

namespace tenon::test {

/// Counts what a 1 kHz loop must not do: heap calls and locks of this thread while the guard lives.
///
/// The test program's own malloc family and pthread lock functions stand before those of the C library, so
/// what libraries do on this thread counts too. Under ASan and TSan these stand there themselves: then the
/// guard counts nothing and available() is false.
///
/// Threads: belongs to the thread that made it. Real-time: reading the counts.
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
