#pragma once

#include <cstddef>
#include <vector>

namespace tenon::structures {

inline constexpr std::size_t kHugePageBytes = std::size_t{2} << 20U;

/// Uninitialised memory of `bytes`, aligned to 64 bytes. From kHugePageBytes on it consists of whole huge
/// pages, which the kernel is asked to back with one translation each; where it does not (no such pages, none
/// free, switched off) the memory is in ordinary pages. Throws std::bad_alloc as operator new.
[[nodiscard]] void* allocateInHugePages(std::size_t bytes);
void freeHugePages(void* memory, std::size_t bytes) noexcept;

/// Allocator of the arrays that queries read at random: the samples of one field take ten thousands of
/// ordinary pages, many more than the processor has translations for.
///
/// Threads: any. Real-time: no.
template <typename T>
class HugePageAllocator {
 public:
  using value_type = T;
  HugePageAllocator() = default;
  template <typename Other>
  HugePageAllocator(const HugePageAllocator<Other>&) {
  }  // NOLINT(google-explicit-constructor): as std::allocator

  [[nodiscard]] T* allocate(std::size_t count) {
    static_assert(alignof(T) <= 64);
    return static_cast<T*>(allocateInHugePages(count * sizeof(T)));
  }
  void deallocate(T* memory, std::size_t count) noexcept { freeHugePages(memory, count * sizeof(T)); }

  friend bool operator==(const HugePageAllocator&, const HugePageAllocator&) { return true; }
};

template <typename T>
using HugeVector = std::vector<T, HugePageAllocator<T>>;

}  // namespace tenon::structures
