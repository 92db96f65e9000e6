#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace tenon::threads {

/// Bounded lock-free queue from one producer to one consumer thread, for events of which none may be
/// overwritten (a grab, a tick's input for the journal).
///
/// All slots are constructed once and filled in place, so that elements may own memory without allocating
/// later. When the queue is full, the new element is dropped and counted: the producer never waits.
///
/// Threads: one producer (beginPush, commitPush, push), one consumer (front, pop); size and dropped: any.
/// Real-time: everything but the constructor, as far as copying T is.
template <class T>
class SpscQueue {
 public:
  /// `capacity`: number of slots, at least 1.
  explicit SpscQueue(std::size_t capacity) : capacity_(capacity), slots_(std::make_unique<T[]>(capacity)) {}

  /// The slot to fill before commitPush(); null, and the drop counted, when the queue is full.
  [[nodiscard]] T* beginPush() noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - cached_head_ == capacity_) {
      cached_head_ = head_.load(std::memory_order_acquire);
      if (tail - cached_head_ == capacity_) {
        dropped_.fetch_add(1, std::memory_order_relaxed);
        return nullptr;
      }
    }
    return &slots_[tail % capacity_];
  }
  void commitPush() noexcept {
    tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }
  bool push(const T& value) noexcept {
    T* slot = beginPush();
    if (slot == nullptr) return false;
    *slot = value;
    commitPush();
    return true;
  }

  /// The oldest element, to be used in place until pop(); null when the queue is empty.
  [[nodiscard]] T* front() noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == cached_tail_) {
      cached_tail_ = tail_.load(std::memory_order_acquire);
      if (head == cached_tail_) return nullptr;
    }
    return &slots_[head % capacity_];
  }
  /// Releases the slot of front().
  void pop() noexcept { head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }
  bool pop(T& out) noexcept {
    const T* slot = front();
    if (slot == nullptr) return false;
    out = *slot;
    pop();
    return true;
  }

  [[nodiscard]] std::size_t size() const noexcept {
    // head before tail: a tail read later is never less than the head
    const std::size_t head = head_.load(std::memory_order_acquire);
    return tail_.load(std::memory_order_acquire) - head;
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::size_t capacity_;
  std::unique_ptr<T[]> slots_;
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::size_t cached_head_ = 0;  ///< head_ as the producer read it last
  std::atomic<std::uint64_t> dropped_{0};
  alignas(64) std::atomic<std::size_t> head_{0};
  std::size_t cached_tail_ = 0;  ///< tail_ as the consumer read it last
};

}  // namespace tenon::threads
