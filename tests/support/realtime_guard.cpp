#include "tests/support/realtime_guard.h"

#include <atomic>
#include <cerrno>
#include <cstddef>

#include <dlfcn.h>
#include <pthread.h>

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TENON_COUNTS_CALLS 1
#else
#define TENON_COUNTS_CALLS 0
#endif

namespace {

thread_local std::int64_t heap_calls = 0;
thread_local std::int64_t lock_calls = 0;

}  // namespace

#if TENON_COUNTS_CALLS

namespace {

// calls the C library's function of that name, resolved at its first use
template <class Argument>
int callReal(std::atomic<int (*)(Argument*)>& real, const char* name, Argument* argument) {
  auto function = real.load(std::memory_order_relaxed);
  if (function == nullptr) {
    function = reinterpret_cast<int (*)(Argument*)>(dlsym(RTLD_NEXT, name));
    real.store(function, std::memory_order_relaxed);
  }
  return function(argument);
}

}  // namespace

extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* block);

void* malloc(std::size_t size) noexcept {
  ++heap_calls;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  ++heap_calls;
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
  ++heap_calls;
  return __libc_realloc(block, size);
}
void* memalign(std::size_t alignment, std::size_t size) noexcept {
  ++heap_calls;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++heap_calls;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) noexcept {
  ++heap_calls;
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) noexcept {
  if (block != nullptr) ++heap_calls;
  __libc_free(block);
}

int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  static std::atomic<int (*)(pthread_mutex_t*)> real{nullptr};
  ++lock_calls;
  return callReal(real, "pthread_mutex_lock", mutex);
}
int pthread_mutex_trylock(pthread_mutex_t* mutex) noexcept {
  static std::atomic<int (*)(pthread_mutex_t*)> real{nullptr};
  ++lock_calls;
  return callReal(real, "pthread_mutex_trylock", mutex);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) noexcept {
  static std::atomic<int (*)(pthread_rwlock_t*)> real{nullptr};
  ++lock_calls;
  return callReal(real, "pthread_rwlock_rdlock", lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept {
  static std::atomic<int (*)(pthread_rwlock_t*)> real{nullptr};
  ++lock_calls;
  return callReal(real, "pthread_rwlock_wrlock", lock);
}

}  // extern "C"

#endif

namespace tenon::test {

RealtimeGuard::RealtimeGuard() : allocations_before_(heap_calls), locks_before_(lock_calls) {}

std::int64_t RealtimeGuard::allocations() const { return heap_calls - allocations_before_; }
std::int64_t RealtimeGuard::locks() const { return lock_calls - locks_before_; }
bool RealtimeGuard::available() { return TENON_COUNTS_CALLS == 1; }

}  // namespace tenon::test
