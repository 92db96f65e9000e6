#pragma once

#include <cstdint>

namespace tenon::test {

/// Whose calls a RealtimeGuard counts.
enum class CountedThreads {
  kCalling,  ///< the thread that constructed the guard
  kAll,      ///< every thread of the process: a tick with workers
};

/// Counts heap calls and locks while the guard exists: a 1 kHz loop must have none.
///
/// The test program's pthread lock functions interpose those of the C library, and so does its malloc family;
/// under ASan and TSan, whose allocators replace it, the heap calls are counted by their hooks. Calls by
/// libraries are counted as well.
///
/// Threads: belongs to the thread that constructed it, whichever threads it counts. Real-time: reading the
/// counts.
class RealtimeGuard {
 public:
  explicit RealtimeGuard(CountedThreads threads = CountedThreads::kCalling);

  /// malloc, calloc, realloc, aligned allocation and free, operators new and delete included.
  [[nodiscard]] std::int64_t allocations() const;
  /// Mutexes and read-write locks taken, or tried.
  [[nodiscard]] std::int64_t locks() const;

 private:
  CountedThreads threads_;
  std::int64_t allocations_before_;
  std::int64_t locks_before_;
};

}  // namespace tenon::test
