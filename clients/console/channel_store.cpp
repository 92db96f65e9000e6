#include "clients/console/channel_store.h"

#include <algorithm>
#include <utility>

namespace tenon::console {

const Channel* ChannelStore::find(ChannelId id) const {
  return id >= 1 && id <= channels_.size() ? &channels_[id - 1] : nullptr;
}

void ChannelStore::keep(const Publication& publication) {
  const Channel* channel = find(publication.channel);
  if (channel == nullptr) return;
  Kept& kept = kept_[publication.channel - 1];
  if (publication.payload == nullptr) {
    dropInstance(kept, publication.instance);
  } else if (channel->delivery == Delivery::kEach) {
    keepEvent(kept, publication);
  } else {
    keepNewest(kept, publication);
  }
}

void ChannelStore::keepNewest(Kept& kept, const Publication& publication) {
  dropInstance(kept, publication.instance);
  kept.instances[publication.writer].emplace(kept.next_order, publication.instance);
  kept.newest.emplace(publication.instance, Kept::Newest{publication, kept.next_order++});
  if (kept.newest.size() <= kMaxInstances) return;
  const auto most = std::max_element(kept.instances.begin(), kept.instances.end(),
                                     [](auto& a, auto& b) { return a.second.size() < b.second.size(); });
  dropInstance(kept, most->second.begin()->second);
  countForgotten(kept);
}

void ChannelStore::dropInstance(Kept& kept, std::uint64_t instance) {
  const auto found = kept.newest.find(instance);
  if (found == kept.newest.end()) return;
  const auto of_writer = kept.instances.find(found->second.publication.writer);
  of_writer->second.erase(found->second.order);
  if (of_writer->second.empty()) kept.instances.erase(of_writer);
  kept.newest.erase(found);
}

void ChannelStore::keepEvent(Kept& kept, const Publication& publication) {
  kept.events.push_back(publication);
  Kept::Counts& counts = kept.counts[publication.writer];
  ++counts.all;
  ++counts.by_kind[publication.instance];
  if (kept.events.size() <= kMaxEvents) return;
  dropEvent(kept);
  countForgotten(kept);
}

void ChannelStore::countForgotten(Kept& kept) {
  ++kept.forgotten;
  has_forgotten_ = true;
}

std::vector<std::string> ChannelStore::toTell() {
  std::vector<std::string> sentences;
  if (!std::exchange(has_forgotten_, false)) return sentences;
  for (const Channel& channel : channels_) {
    Kept& kept = kept_[channel.id - 1];
    if (kept.forgotten == 0 || kept.forgotten < 2 * kept.told) continue;
    kept.told = kept.forgotten;
    const bool is_of_events = channel.delivery == Delivery::kEach;
    sentences.push_back(
        "of " + channel.topic + " " + std::to_string(is_of_events ? kMaxEvents : kMaxInstances) +
        (is_of_events ? " events" : " instances") +
        " are kept for pages that are opened later; forgotten so far: " + std::to_string(kept.forgotten));
  }
  return sentences;
}

/// Of the writer that has most, the oldest of those that come most often.
void ChannelStore::dropEvent(Kept& kept) {
  const auto writer = std::max_element(kept.counts.begin(), kept.counts.end(),
                                       [](auto& a, auto& b) { return a.second.all < b.second.all; });
  auto& kinds = writer->second.by_kind;
  const auto most =
      std::max_element(kinds.begin(), kinds.end(), [](auto& a, auto& b) { return a.second < b.second; });
  const auto oldest = std::find_if(kept.events.begin(), kept.events.end(), [&](const Publication& event) {
    return event.writer == writer->first && event.instance == most->first;
  });
  kept.events.erase(oldest);
  if (--most->second == 0) kinds.erase(most);
  if (--writer->second.all == 0) kept.counts.erase(writer);
}

void ChannelStore::forEachKept(ChannelId id, const std::function<void(const Publication&)>& handler) const {
  if (find(id) == nullptr) return;
  for (const Publication& event : kept_[id - 1].events) handler(event);
  for (const auto& [instance, newest] : kept_[id - 1].newest) handler(newest.publication);
}

}  // namespace tenon::console
