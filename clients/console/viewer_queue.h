#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "clients/console/channel.h"
#include "clients/console/foxglove_protocol.h"

namespace tenon::console {

/// What waits to be sent to one viewer, bounded however slowly it reads.
///
/// Of each instance of a Delivery::kNewest channel the newest message waits, in the place of the one that it
/// replaces; instances take turns. Of a Delivery::kEach channel the last kMaxEvents wait. Texts (what the
/// server says about itself) are never dropped: a viewer that asks for more than it reads has overflowed and
/// is to be disconnected. Payloads are shared with other viewers, so a message that waits costs some 100
/// bytes.
///
/// Threads: one. Real-time: no.
class ViewerQueue {
 public:
  static constexpr std::size_t kMaxTexts = 64;
  static constexpr std::size_t kMaxEvents = 4'000;
  static constexpr std::size_t kMaxMessages = 8'000;

  /// Either a text or a message.
  struct Item {
    std::string text;
    MessageHeader header{};
    Payload payload;  ///< null: a text
  };

  void addText(std::string text);
  void add(SubscriptionId subscription, Delivery delivery, const Publication& publication);
  /// Nothing of this subscription waits any more.
  void remove(SubscriptionId subscription);
  /// Takes what is to be sent next; texts first.
  [[nodiscard]] std::optional<Item> take();

  [[nodiscard]] std::size_t size() const { return texts_.size() + waiting_.size(); }
  [[nodiscard]] bool hasOverflowed() const { return has_overflowed_; }
  /// Messages that were replaced or dropped before they were sent.
  [[nodiscard]] std::uint64_t skipped() const { return skipped_; }

 private:
  struct Message {
    std::uint64_t order = 0;
    Publication publication;
    bool is_event = false;
  };
  using Key = std::pair<SubscriptionId, std::uint64_t>;  ///< with the instance, or the number of an event

  void drop(std::uint64_t order);

  std::deque<std::string> texts_;
  std::map<Key, Message> waiting_;
  std::map<std::uint64_t, Key> order_;         ///< by Message::order: the next to be sent first
  std::map<std::uint64_t, Key> event_orders_;  ///< those of events
  std::uint64_t next_order_ = 0;
  std::uint64_t next_event_ = 0;
  std::uint64_t skipped_ = 0;
  bool has_overflowed_ = false;
};

}  // namespace tenon::console
