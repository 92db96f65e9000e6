#include "tests/support/realtime_guard.h"

#include <atomic>
#include <cerrno>
#include <cstddef>

#include <dlfcn.h>
#include <pthread.h>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TENON_OWN_ALLOCATOR 1  // a sanitizer's, which reports each call to two hooks
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*of_malloc)(const volatile void*, std::size_t),
                                                         void (*of_free)(const volatile void*));
#else
#define TENON_OWN_ALLOCATOR 0
#endif

namespace {

thread_local std::int64_t heap_calls = 0;
thread_local std::int64_t lock_calls = 0;
std::atomic<std::int64_t> heap_calls_of_all{0};
std::atomic<std::int64_t> lock_calls_of_all{0};

void countHeapCall() noexcept {
  ++heap_calls;
  heap_calls_of_all.fetch_add(1, std::memory_order_relaxed);
}
void countLock() noexcept {
  ++lock_calls;
  lock_calls_of_all.fetch_add(1, std::memory_order_relaxed);
}

/// The next definition of a lock function, the C library's or a sanitizer's, found at its first use.
template <class Lock>
class RealFunction {
 public:
  constexpr explicit RealFunction(const char* name) : name_(name) {}
  int operator()(Lock* lock) { return resolved()(lock); }
  using Function = int (*)(Lock*);
  Function resolved() {
    auto function = function_.load(std::memory_order_relaxed);
    if (function == nullptr) {
      function = reinterpret_cast<Function>(dlsym(RTLD_NEXT, name_));
      function_.store(function, std::memory_order_relaxed);
    }
    return function;
  }

 private:
  const char* name_;
  std::atomic<Function> function_{nullptr};
};

constinit RealFunction<pthread_mutex_t> real_mutex_lock("pthread_mutex_lock");
constinit RealFunction<pthread_mutex_t> real_mutex_trylock("pthread_mutex_trylock");
constinit RealFunction<pthread_rwlock_t> real_rwlock_rdlock("pthread_rwlock_rdlock");
constinit RealFunction<pthread_rwlock_t> real_rwlock_wrlock("pthread_rwlock_wrlock");

}  // namespace

extern "C" {

#if !TENON_OWN_ALLOCATOR

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* block);

void* malloc(std::size_t size) noexcept {
  countHeapCall();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  countHeapCall();
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
  countHeapCall();
  return __libc_realloc(block, size);
}
void* memalign(std::size_t alignment, std::size_t size) noexcept {
  countHeapCall();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  countHeapCall();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) noexcept {
  countHeapCall();
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) noexcept {
  if (block != nullptr) countHeapCall();
  __libc_free(block);
}

#endif

int pthread_mutex_lock(pthread_mutex_t* lock) noexcept {
  countLock();
  return real_mutex_lock(lock);
}
int pthread_mutex_trylock(pthread_mutex_t* lock) noexcept {
  countLock();
  return real_mutex_trylock(lock);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) noexcept {
  countLock();
  return real_rwlock_rdlock(lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept {
  countLock();
  return real_rwlock_wrlock(lock);
}

}  // extern "C"

namespace tenon::test {

#if TENON_OWN_ALLOCATOR
namespace {

[[maybe_unused]] const int hooks =
    __sanitizer_install_malloc_and_free_hooks([](const volatile void*, std::size_t) { countHeapCall(); },
                                              [](const volatile void* block) {
                                                if (block != nullptr) countHeapCall();
                                              });

}  // namespace
#endif

RealtimeGuard::RealtimeGuard(CountedThreads threads)
    : threads_(threads), allocations_before_(0), locks_before_(0) {
  // finding them allocates under a sanitizer
  real_mutex_lock.resolved();
  real_mutex_trylock.resolved();
  real_rwlock_rdlock.resolved();
  real_rwlock_wrlock.resolved();
  allocations_before_ = allocations();
  locks_before_ = locks();
}

std::int64_t RealtimeGuard::allocations() const {
  return (threads_ == CountedThreads::kAll ? heap_calls_of_all.load() : heap_calls) - allocations_before_;
}
std::int64_t RealtimeGuard::locks() const {
  return (threads_ == CountedThreads::kAll ? lock_calls_of_all.load() : lock_calls) - locks_before_;
}

}  // namespace tenon::test
