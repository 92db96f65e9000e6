#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>

#include "idl/threads/latest.h"
#include "idl/threads/spsc_queue.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Passes inputs from the wire thread to the tick: a reading of each hand and every change, in order.
///
/// A tick takes the newest reading. On a link that loses inputs it may take the one some ticks before it
/// (playout), so that a reading that is lost and comes with the next message has its tick nevertheless.
///
/// Threads: one writer (wire: put, setPlayout, freeChanges), one reader (tick: collect); counts from any.
/// Real-time: all but construction.
class InputBuffer {
 public:
  static constexpr std::size_t kChanges = 256;      ///< that wait for ticks, at most
  static constexpr std::uint32_t kMostPlayout = 2;  ///< [ticks]

  /// `hands`: number of hands of the scenario.
  explicit InputBuffer(std::size_t hands) : hands_(std::make_unique<Hand[]>(hands)), count_(hands) {}

  /// A reading newer than all before it; `reading.hand` must be below the number of hands.
  void put(const HandReading& reading) noexcept {
    Hand& hand = hands_[reading.hand.value];
    if (hand.playout.load(std::memory_order_relaxed) > 0) hand.queue.push(reading);
    if (hand.newest.write(reading) && hand.playout.load(std::memory_order_relaxed) == 0)
      hand.replaced.fetch_add(1, std::memory_order_relaxed);
  }
  /// From now on readings of `hand` wait for `ticks` [ticks], at most kMostPlayout.
  void setPlayout(HandId hand, std::uint32_t ticks) noexcept {
    hands_[hand.value].playout.store(std::min(ticks, kMostPlayout), std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint32_t playout(HandId hand) const noexcept {
    return hands_[hand.value].playout.load(std::memory_order_relaxed);
  }
  /// False, and the change is dropped, when the queue is full because the tick has fallen behind.
  bool put(const Change& change) noexcept { return changes_.push(change); }
  /// Changes that put() accepts before the queue is full.
  [[nodiscard]] std::size_t freeChanges() const noexcept { return changes_.capacity() - changes_.size(); }

  /// Fills the input of `tick`: of each hand a reading newer than that of the tick before, if there is one,
  /// and up to kMaxChanges changes; the rest waits for the next tick.
  void collect(Tick tick, TickInput& input) noexcept {
    input.tick = tick;
    input.readings.clear();
    input.changes.clear();
    for (std::size_t i = 0; i < count_; ++i) {
      const HandReading* const reading = take(hands_[i]);
      if (reading != nullptr) input.readings.push_back(*reading);
      if (reading == nullptr) hands_[i].missed.fetch_add(1, std::memory_order_relaxed);
    }
    for (Change* change = changes_.front(); change != nullptr; change = changes_.front()) {
      if (!input.changes.push_back(*change)) return;
      changes_.pop();
    }
  }

  /// Readings that a newer one replaced before a tick took them, since the start.
  [[nodiscard]] std::uint32_t replaced(HandId hand) const noexcept {
    return hands_[hand.value].replaced.load(std::memory_order_relaxed);
  }
  /// Ticks without a reading of the hand, since the start.
  [[nodiscard]] std::uint32_t missed(HandId hand) const noexcept {
    return hands_[hand.value].missed.load(std::memory_order_relaxed);
  }

 private:
  static constexpr std::size_t kWaiting = 8;
  struct Hand {
    threads::Latest<HandReading> newest;
    threads::SpscQueue<HandReading> queue{64};  ///< used with a playout
    std::atomic<std::uint32_t> playout = 0, replaced = 0, missed = 0;
    // of the tick
    FixedVector<HandReading, kWaiting> waiting;  ///< by seq, ascending
    HandReading taken;                           ///< the last one
    std::optional<std::uint32_t> heard;          ///< seq of the newest one that has waited
  };

  /// The reading for this tick; null: none.
  static const HandReading* take(Hand& hand) noexcept {
    const std::uint32_t playout = hand.playout.load(std::memory_order_relaxed);
    const bool is_new = hand.newest.update();
    if (playout == 0) {
      while (hand.queue.front() != nullptr) hand.queue.pop();
      hand.waiting.clear();
      hand.heard.reset();
      if (!is_new) return nullptr;
      hand.taken = hand.newest.value();
      return &hand.taken;
    }
    for (const HandReading* reading = hand.queue.front(); reading != nullptr; reading = hand.queue.front()) {
      wait(hand, *reading);
      hand.queue.pop();
    }
    if (is_new) wait(hand, hand.newest.value());  // the queue may have been full
    return playOut(hand, playout);
  }

  static void wait(Hand& hand, const HandReading& reading) noexcept {
    if (hand.heard && !isBefore(*hand.heard, reading.seq)) return;
    hand.heard = reading.seq;
    if (hand.waiting.full()) {
      hand.replaced.fetch_add(1, std::memory_order_relaxed);
      dropFirst(hand, 1);
    }
    hand.waiting.push_back(reading);
  }

  /// The reading `playout` before the newest one. Without one that is new, the next of those that wait; a
  /// newer one that waits alone is not kept back, so the delay begins with the first input that is lost.
  static const HandReading* playOut(Hand& hand, std::uint32_t playout) noexcept {
    if (hand.waiting.empty()) return nullptr;
    const std::uint32_t due = hand.waiting[hand.waiting.size() - 1].seq - playout;
    std::size_t next = 0;
    while (next + 1 < hand.waiting.size() && !isBefore(due, hand.waiting[next + 1].seq)) ++next;
    hand.taken = hand.waiting[next];
    hand.replaced.fetch_add(static_cast<std::uint32_t>(next), std::memory_order_relaxed);
    dropFirst(hand, next + 1);
    return &hand.taken;
  }

  static void dropFirst(Hand& hand, std::size_t count) noexcept {
    std::copy(hand.waiting.begin() + count, hand.waiting.end(), hand.waiting.begin());
    hand.waiting.resize(hand.waiting.size() - count);
  }
  /// Of sequence numbers, which begin again at 0 after the largest.
  static bool isBefore(std::uint32_t a, std::uint32_t b) noexcept {
    return static_cast<std::int32_t>(a - b) < 0;
  }

  std::unique_ptr<Hand[]> hands_;
  std::size_t count_;
  threads::SpscQueue<Change> changes_{kChanges};
};

}  // namespace tenon::session
