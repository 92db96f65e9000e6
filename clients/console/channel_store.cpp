#include "clients/console/channel_store.h"

#include <algorithm>

namespace tenon::console {

const Channel* ChannelStore::find(ChannelId id) const {
  return id >= 1 && id <= channels_.size() ? &channels_[id - 1] : nullptr;
}

void ChannelStore::keep(const Publication& publication) {
  const Channel* channel = find(publication.channel);
  if (channel == nullptr) return;
  Kept& kept = kept_[publication.channel - 1];
  if (publication.payload == nullptr) {
    kept.newest.erase(publication.instance);
  } else if (channel->delivery == Delivery::kEach) {
    kept.events.push_back(publication);
    ++kept.counts[publication.instance];
    if (kept.events.size() > kMaxEvents) dropEvent(kept);
  } else if (kept.newest.size() < kMaxInstances || kept.newest.contains(publication.instance)) {
    kept.newest.insert_or_assign(publication.instance, publication);
  }
}

/// The oldest of those that come most often.
void ChannelStore::dropEvent(Kept& kept) {
  const auto most = std::max_element(kept.counts.begin(), kept.counts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  const auto oldest = std::find_if(kept.events.begin(), kept.events.end(),
                                   [&](const Publication& event) { return event.instance == most->first; });
  kept.events.erase(oldest);
  if (--most->second == 0) kept.counts.erase(most);
}

void ChannelStore::forEachKept(ChannelId id, const std::function<void(const Publication&)>& handler) const {
  if (find(id) == nullptr) return;
  for (const Publication& event : kept_[id - 1].events) handler(event);
  for (const auto& [instance, newest] : kept_[id - 1].newest) handler(newest);
}

}  // namespace tenon::console
