#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace tenon::threads {

/// Passes the newest value (a pose, a manifold) from one thread to another; older values are overwritten.
///
/// Wait-free triple buffer: the writer fills one slot, the reader reads another, and the third is exchanged
/// atomically. The reader always gets the newest value published before update().
///
/// Threads: one writer (write, or back and publish), one reader (update and value, or read).
/// Real-time: everything, as far as copying T is.
template <class T>
class Latest {
 public:
  Latest() = default;
  explicit Latest(const T& initial) { slots_.fill(initial); }

  /// The slot to be filled before publish(); it holds some older value.
  [[nodiscard]] T& back() noexcept { return slots_[back_]; }
  /// True when it replaces a value that no update() has taken.
  bool publish() noexcept {
    const std::uint32_t old = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel);
    back_ = old & kSlot;
    return (old & kFresh) != 0;
  }
  /// As publish().
  bool write(const T& value) noexcept {
    back() = value;
    return publish();
  }

  /// Makes the newest value that of value(); false when nothing was published since the last update.
  bool update() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kSlot;
    return true;
  }
  /// The value of the last update(); unchanged until the next one.
  [[nodiscard]] const T& value() const noexcept { return slots_[front_]; }
  const T& read() noexcept {
    update();
    return value();
  }

 private:
  static constexpr std::uint32_t kSlot = 3;
  static constexpr std::uint32_t kFresh = 4;

  std::array<T, 3> slots_{};
  alignas(64) std::uint32_t back_ = 0;
  alignas(64) std::atomic<std::uint32_t> middle_{1};
  alignas(64) std::uint32_t front_ = 2;
};

}  // namespace tenon::threads
