#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <utility>

#include "idl/threads/latest.h"
#include "idl/threads/spsc_queue.h"
#include "server/session/reading_playout.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Passes inputs from the wire thread to the tick: a reading of each hand and every change, in order.
///
/// A tick takes the newest reading. On a link that loses inputs it may take the one some ticks before it
/// (playout), so that a reading that is lost and comes with the next message has its tick nevertheless. Of a
/// hand that sends less than one sample a tick, it takes one between two samples (ReadingPlayout).
///
/// Threads: one writer (wire: put, setPlayout, setPeriod, setFreeze, freeChanges), one reader (tick:
/// collect); counts from any. Real-time: all but construction.
class InputBuffer {
 public:
  static constexpr std::size_t kChanges = 256;      ///< that wait for ticks, at most
  static constexpr std::uint32_t kMostPlayout = 2;  ///< [ticks]

  /// `hands`: number of hands of the scenario.
  explicit InputBuffer(std::size_t hands) : hands_(std::make_unique<Hand[]>(hands)), count_(hands) {}

  /// A reading newer than all before it; `reading.hand` must be below the number of hands.
  void put(const HandReading& reading) noexcept {
    Hand& hand = hands_[reading.hand.value];
    const Numbered numbered{reading, hand.station.load(std::memory_order_relaxed)};
    const bool waits = hand.playout.load(std::memory_order_relaxed) > 0 ||
                       hand.period.load(std::memory_order_relaxed) > 1 ||
                       hand.catches_up.load(std::memory_order_relaxed);
    if (waits) hand.queue.push(numbered);
    if (hand.newest.write(numbered) && !waits) hand.replaced.fetch_add(1, std::memory_order_relaxed);
  }
  /// From now on readings of `hand` wait for `ticks` [ticks], at most kMostPlayout.
  void setPlayout(HandId hand, std::uint32_t ticks) noexcept {
    hands_[hand.value].playout.store(std::min(ticks, kMostPlayout), std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint32_t playout(HandId hand) const noexcept {
    return hands_[hand.value].playout.load(std::memory_order_relaxed);
  }
  /// From now on samples of `hand` come each `ticks` [ticks], at most kMostInputPeriod; 1 at first.
  void setPeriod(HandId hand, std::uint32_t ticks) noexcept {
    hands_[hand.value].period.store(std::clamp<std::uint32_t>(ticks, 1, kMostInputPeriod),
                                    std::memory_order_relaxed);
  }
  /// [ticks] by which readings of `hand` are taken later than they come: its playout; of sparse samples what
  /// the newest is ahead, in the last seconds and without what is being worked off (ReadingPlayout).
  [[nodiscard]] std::uint32_t keptBack(HandId hand) const noexcept {
    const Hand& of = hands_[hand.value];
    const std::uint32_t period = of.period.load(std::memory_order_relaxed);
    if (period == 1) return playout(hand);
    return std::clamp(of.most_behind.load(std::memory_order_relaxed), period - 1,
                      ReadingPlayout::kUsualPeriodsBehind * period);
  }
  /// From now on a silence of more than `ticks` [ticks] freezes `hand` (LinkLimits::freeze); kFreezeTicks at
  /// first.
  void setFreeze(HandId hand, std::uint32_t ticks) noexcept {
    hands_[hand.value].freeze.store(ticks, std::memory_order_relaxed);
  }
  /// What has come of `hand` so far is dropped: from now on another station moves it, at first with no
  /// playout, a sample each tick and the freeze limit kFreezeTicks.
  void restart(HandId hand) noexcept {
    setPlayout(hand, 0);
    setPeriod(hand, 1);
    setFreeze(hand, kFreezeTicks);
    hands_[hand.value].station.fetch_add(1, std::memory_order_release);
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
      hands_[i].silent = reading == nullptr ? hands_[i].silent + 1 : 0;
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
  struct Numbered {
    HandReading reading;
    std::uint32_t station = 0;  ///< Hand::station when it came
  };
  struct Hand {
    threads::Latest<Numbered> newest;
    threads::SpscQueue<Numbered> queue{64};  ///< used with a playout or a period
    std::atomic<std::uint32_t> playout = 0, period = 1, freeze = kFreezeTicks, replaced = 0, missed = 0;
    std::atomic<std::uint32_t> most_behind = 0;  ///< [ticks] ReadingPlayout::mostBehind()
    std::atomic<bool> catches_up = false;        ///< the period is 1 again, and the ticks are still behind
    std::atomic<std::uint32_t> station = 0;      ///< number of the one that moves it now
    // of the tick
    std::uint32_t known_station = 0;
    ReadingPlayout readings;
    std::uint32_t silent = 0;   ///< [ticks] without a reading, up to the last one
    std::uint32_t counted = 0;  ///< of readings.replaced()
  };

  /// The reading for this tick; null: none.
  static const HandReading* take(Hand& hand) noexcept {
    const std::uint32_t playout = hand.playout.load(std::memory_order_relaxed);
    const std::uint32_t period = hand.period.load(std::memory_order_relaxed);
    const bool has_come = hand.newest.update();
    // after update(), which may have got a reading of this station
    const std::uint32_t station = hand.station.load(std::memory_order_acquire);
    const bool is_new = has_come && hand.newest.value().station == station;
    if (station != hand.known_station) {
      hand.known_station = station;
      hand.readings.clear();
      hand.catches_up.store(false, std::memory_order_relaxed);
    }
    if (period > 1) hand.catches_up.store(true, std::memory_order_relaxed);
    const bool is_between = hand.catches_up.load(std::memory_order_relaxed);
    if (playout == 0 && !is_between) {
      while (hand.queue.front() != nullptr) hand.queue.pop();
      return is_new ? hand.readings.take(hand.newest.value().reading) : nullptr;
    }
    for (const Numbered* next = hand.queue.front(); next != nullptr; next = hand.queue.front()) {
      if (next->station == station) hand.readings.add(next->reading);
      hand.queue.pop();
    }
    if (is_new) hand.readings.add(hand.newest.value().reading);  // the queue may have been full
    const bool was_frozen = hand.silent > hand.freeze.load(std::memory_order_relaxed);
    const HandReading* const taken =
        is_between ? hand.readings.takeBetween(period, was_frozen) : hand.readings.takeBehind(playout);
    hand.most_behind.store(hand.readings.mostBehind(), std::memory_order_relaxed);
    if (period == 1 && hand.readings.behind() == 0) hand.catches_up.store(false, std::memory_order_relaxed);
    const std::uint32_t replaced = hand.readings.replaced();
    hand.replaced.fetch_add(replaced - std::exchange(hand.counted, replaced), std::memory_order_relaxed);
    return taken;
  }

  std::unique_ptr<Hand[]> hands_;
  std::size_t count_;
  threads::SpscQueue<Change> changes_{kChanges};
};

}  // namespace tenon::session
