#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace tenon {

/// A fact that the next one replaces, passed from one thread to another (a pose, a manifold).
///
/// Three slots: the writer fills one, the reader reads another, the third is exchanged in one atomic step.
/// So neither ever waits, the reader always sees a whole value, and the newest one that was complete when it
/// asked; values in between are lost on purpose.
///
/// Threads: one writer (write, or back and publish), one reader (update and value, or read).
/// Real-time: everything, as far as copying T is.
template <class T>
class Latest {
 public:
  Latest() = default;
  explicit Latest(const T& initial) { slots_.fill(initial); }

  /// The slot that the next publish() shows; what is in it is some older value.
  [[nodiscard]] T& back() noexcept { return slots_[back_]; }
  void publish() noexcept { back_ = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel) & kSlot; }
  void write(const T& value) noexcept {
    back() = value;
    publish();
  }

  /// Moves on to the newest value; false when it is the one the reader has already.
  bool update() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kSlot;
    return true;
  }
  /// The value of the last update(); stays as it is until the next one.
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

}  // namespace tenon
