#include "server/structures/huge_pages.h"

#include <new>

#include <sys/mman.h>

namespace tenon::structures {
namespace {

constexpr std::align_val_t kCacheLine{64};
constexpr std::align_val_t kHugePage{kHugePageBytes};

}  // namespace

void* allocateInHugePages(std::size_t bytes) {
  if (bytes < kHugePageBytes) return ::operator new(bytes, kCacheLine);
  if (bytes > static_cast<std::size_t>(-1) - kHugePageBytes) throw std::bad_alloc();
  const std::size_t whole = (bytes + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
  void* memory = ::operator new(whole, kHugePage);
  // a refusal changes speed alone
  (void)::madvise(memory, whole, MADV_HUGEPAGE);
  return memory;
}

void freeHugePages(void* memory, std::size_t bytes) noexcept {
  ::operator delete(memory, bytes < kHugePageBytes ? kCacheLine : kHugePage);
}

}  // namespace tenon::structures
