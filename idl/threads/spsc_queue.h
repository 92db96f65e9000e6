#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace tenon {

/// Events that count, in order, from one thread to another (a grab, a tick's input for the journal).
///
/// All slots are made at construction and used in place, so nothing is allocated later even for large T.
/// When it is full the new event is dropped and counted: the producer never waits.
///
/// Threads: one producer (beginPush, commitPush, push), one consumer (front, pop); size and dropped: any.
/// Real-time: everything but the constructor, as far as copying T is.
template <class T>
class SpscQueue {
 public:
  explicit SpscQueue(std::size_t capacity) : capacity_(capacity), slots_(std::make_unique<T[]>(capacity)) {}

  /// The slot to fill before commitPush(); null, and one more dropped, when the queue is full.
  [[nodiscard]] T* beginPush() noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_seen_ == capacity_) {
      head_seen_ = head_.load(std::memory_order_acquire);
      if (tail - head_seen_ == capacity_) {
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

  /// The oldest event, to be used in place until pop(); null when there is none.
  [[nodiscard]] T* front() noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_seen_) {
      tail_seen_ = tail_.load(std::memory_order_acquire);
      if (head == tail_seen_) return nullptr;
    }
    return &slots_[head % capacity_];
  }
  /// Gives the slot of front() back.
  void pop() noexcept { head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }
  bool pop(T& out) noexcept {
    const T* slot = front();
    if (slot == nullptr) return false;
    out = *slot;
    pop();
    return true;
  }

  [[nodiscard]] std::size_t size() const noexcept {
    // head first: the tail read after it is never behind it
    const std::size_t head = head_.load(std::memory_order_acquire);
    return tail_.load(std::memory_order_acquire) - head;
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::size_t capacity_;
  std::unique_ptr<T[]> slots_;
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::size_t head_seen_ = 0;  ///< the producer's last look at head_
  std::atomic<std::uint64_t> dropped_{0};
  alignas(64) std::atomic<std::size_t> head_{0};
  std::size_t tail_seen_ = 0;  ///< the consumer's last look at tail_
};

}  // namespace tenon
