#include "clients/console/viewer_queue.h"

namespace tenon::console {

void ViewerQueue::addText(std::string text) {
  if (texts_.size() >= kMaxTexts) {
    has_overflowed_ = true;
    return;
  }
  texts_.push_back(std::move(text));
}

void ViewerQueue::add(SubscriptionId subscription, Delivery delivery, const Publication& publication) {
  const bool is_event = delivery == Delivery::kEach;
  const Key key{subscription, is_event ? next_event_++ : publication.instance};
  const auto [entry, is_new] = waiting_.try_emplace(key);
  entry->second.publication = publication;
  if (!is_new) {
    ++skipped_;
    return;
  }
  entry->second.order = next_order_++;
  entry->second.is_event = is_event;
  order_.emplace(entry->second.order, key);
  if (is_event) event_orders_.emplace(entry->second.order, key);
  if (event_orders_.size() > kMaxEvents) drop(event_orders_.begin()->first);
  if (waiting_.size() > kMaxMessages) drop(order_.begin()->first);
}

void ViewerQueue::drop(std::uint64_t order) {
  const auto found = order_.find(order);
  waiting_.erase(found->second);
  order_.erase(found);
  event_orders_.erase(order);
  ++skipped_;
}

void ViewerQueue::remove(SubscriptionId subscription) {
  auto entry = waiting_.lower_bound({subscription, 0});
  while (entry != waiting_.end() && entry->first.first == subscription) {
    order_.erase(entry->second.order);
    event_orders_.erase(entry->second.order);
    entry = waiting_.erase(entry);
  }
}

std::optional<ViewerQueue::Item> ViewerQueue::take() {
  Item item;
  if (!texts_.empty()) {
    item.text = std::move(texts_.front());
    texts_.pop_front();
    return item;
  }
  if (order_.empty()) return std::nullopt;
  const auto first = order_.begin();
  const auto entry = waiting_.find(first->second);
  item.header = messageHeader(entry->first.first, entry->second.publication.time_ns);
  item.payload = std::move(entry->second.publication.payload);
  event_orders_.erase(first->first);
  waiting_.erase(entry);
  order_.erase(first);
  return item;
}

}  // namespace tenon::console
